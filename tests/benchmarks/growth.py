"""How the processor time of a run grows with its unknowns: CPU = c unknowns^exponent.

The meshes are those of `draft`, `standard` and `fine`, the increments of load those of `standard`:
what grows otherwise is the cost of an iteration and the number of iterations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from studies.scenes.registry import scene_named
from tests.benchmarks.accuracy import anew
from tests.benchmarks.measure import Point, timed
from tests.stress.measure import Figure


@dataclass(frozen=True, slots=True)
class Series:
    """A problem on meshes that become finer.

    Attributes
    ----------
    scene, parameters : the scene, and what all its runs have
    meshes : what each run has, the coarsest first
    most : the largest exponent that is allowed; None if it is only told
    """

    scene: str
    meshes: Sequence[Mapping[str, float]]
    parameters: Mapping[str, float] = field(default_factory=dict)
    most: float | None = None


SERIES: Mapping[str, Series] = {
    "punch": Series(
        "punch",
        [
            {"smallest_element": 5e-3, "growth": 1.6},
            {"smallest_element": 5e-4, "growth": 1.4},
            {"smallest_element": 1e-4, "growth": 1.2},
        ],
        {"friction": 0.4, "load_ratio": 0.8571},
        most=1.4,
    ),
    "ball": Series(
        "ball",
        [
            {"element_size": 1 / 12, "growth": 1.5},
            {"element_size": 1 / 24, "growth": 1.3},
            {"element_size": 1 / 48, "growth": 1.15},
        ],
    ),
    "rolling, endless": Series(
        "rolling",
        [{"element_size": h, "growth": 1.15**h} for h in (1.0, 0.5, 0.25)],
    ),
}


_MILD: Mapping[str, Mapping[str, float]] = {
    "punch": {"load_ratio": 0.3},
    "rolling, endless": {"load_ratio": 2.0},
}
"""Loads of the quick benchmark, under which little yields."""


def measure(quick: bool, repeats: int) -> tuple[list[Point], list[Figure]]:
    """Return a point for every run and the exponent of every problem; quick: two meshes of two."""
    points, figures = [], []
    for name in _MILD if quick else SERIES:
        series, mild = SERIES[name], _MILD[name] if quick else {}
        meshes = series.meshes[: 2 if quick else None]
        own = [_point(name, series, {**mesh, **mild}, repeats) for mesh in meshes]
        points += own
        figures.append(Figure(f"{name}: exponent", exponent(own), most=series.most))
    return points, figures


def exponent(points: Sequence[Point]) -> float:
    """Return the slope of log CPU over log unknowns, by least squares."""
    unknowns, cpu = np.log([[p.unknowns, p.cpu] for p in points]).T
    return float(np.polyfit(unknowns, cpu, 1)[0])


def _point(name: str, series: Series, mesh: Mapping[str, Any], repeats: int) -> Point:
    parameters = scene_named(series.scene).parameters(**{**series.parameters, **mesh})
    run = timed(lambda _: anew(series.scene, parameters), repeats)
    return Point(
        problem="growth",
        series=name,
        setting="{} {:.2g}".format(*next(iter(mesh.items()))),
        unknowns=int(run.result.scalars["degrees_of_freedom"]),
        cpu=run.cpu,
        spread=run.spread,
        repeats=run.repeats,
        values={"iterations": float(run.result.scalars.get("iterations", np.nan))},
    )
