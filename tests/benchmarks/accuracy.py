"""What `accuracy = "draft" | "standard" | "fine"` costs, and the largest error it leaves.

The error is that of residual sigma_x, in percent of the yield stress, against a run of finer
elements and smaller increments. It is taken where the documentation promises accuracy: along the
surfaces of the punch problem up to 0.005 half-widths from the corner (0.028 in the punch itself),
on a rolled track from 1 mm down, and at the surface, or the first row of points if it has ends.
Each run makes its mesh and its factors anew.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver import Record
from solver.memory import release
from solver.rolling.scenes.rolling import RollingParameters
from solver.scenes.punch import PunchParameters
from studies.scenes.registry import scene_named
from tests.benchmarks.measure import Point, timed

Array = NDArray[np.float64]
LEVELS = ("draft", "standard", "fine")
MEASURES = {"largest": "largest error of residual σxx [% of the yield stress]"}
_SHALLOW = 1.0  # mm
_FROM_CORNER = {"punch": 0.028, "half_plane": 0.005}


@dataclass(frozen=True, slots=True)
class Problem:
    """A scene whose levels are measured.

    Attributes
    ----------
    parameters : all but `accuracy`
    finest : the elements and increments of the reference
    stress : gives the stresses [MPa] that are compared, from a record
    levels : those that are measured
    """

    parameters: Any
    finest: Mapping[str, float]
    stress: Callable[[Record], Array]
    levels: tuple[str, ...] = LEVELS
    scene: str = field(default="rolling")


def _near_corner(record: Record) -> Array:
    s = np.asarray(record.coordinates["s"]) / record.parameters.half_width
    lines = np.asarray(record.fields["surface_residual"][1])[:, 0]
    kept = [
        line[(s < 1 - distance * 0.999) & np.isfinite(line)]
        for line, distance in zip(lines, _FROM_CORNER.values(), strict=True)
    ]
    return np.concatenate(kept)


def _under_track(record: Record) -> Array:
    profiles = np.asarray(record.fields["residual_profile"][1])[-1]
    deep = np.asarray(record.coordinates["depth"]) >= _SHALLOW
    endless = record.parameters.endless
    top = record.scalars["surface_residual_x" if endless else "first_row_residual_x"]
    return np.concatenate([[top], profiles[len(profiles) // 2, 0, deep]])


_ENDLESS = RollingParameters()
PROBLEMS: Mapping[str, Problem] = {
    "punch": Problem(
        PunchParameters(friction=0.4),
        {"smallest_element": 5e-5, "growth": 1.15, "load_step": 0.0125, "unload_steps": 10},
        _near_corner,
        scene="punch",
    ),
    "rolling, endless": Problem(
        _ENDLESS, {"element_size": _ENDLESS.mesh_width / 64, "growth": 1.05}, _under_track
    ),
    "rolling, 50 mm": Problem(
        RollingParameters(track=50.0),
        {"element_size": 0.25, "growth": 1.15**0.25, "advance_step": 0.125},
        _under_track,
        levels=LEVELS[:2],
    ),
}

_SOMEWHAT_FINER = {"element_size": _ENDLESS.mesh_width / 12}


def measure(quick: bool, repeats: int) -> list[Point]:
    """Return a point for every level of every problem; quick: draft against somewhat finer."""
    points = []
    for name, problem in PROBLEMS.items():
        if quick and name != "rolling, endless":
            continue
        levels = problem.levels[: 1 if quick else None]
        finest = _SOMEWHAT_FINER if quick else problem.finest
        exact = problem.stress(anew(problem.scene, replace(problem.parameters, **finest)))
        for level in levels:
            own = at_level(problem.parameters, level)
            run = timed(lambda _, scene=problem.scene, own=own: anew(scene, own), repeats)
            error = np.abs(problem.stress(run.result) - exact) / problem.parameters.yield_stress
            points.append(
                Point(
                    problem="accuracy",
                    series=name,
                    setting=level,
                    unknowns=int(run.result.scalars["degrees_of_freedom"]),
                    cpu=run.cpu,
                    spread=run.spread,
                    repeats=run.repeats,
                    values={},
                    errors={"largest": 100 * float(error.max())},
                )
            )
    return points


def at_level(parameters: Any, level: str) -> Any:
    """Return the parameters of a level, whose elements and increments are those of `usual`."""
    return replace(parameters, accuracy=level, **dict.fromkeys(parameters.usual()))


def anew(name: str, parameters: Any) -> Record:
    """Return the record of a run that shares nothing with one before; raise where it failed."""
    release(0)
    scene = scene_named(name)
    (record,) = scene.path(parameters, [getattr(parameters, scene.branch)], lambda share: None)
    if not record.status.solved:
        raise RuntimeError(f"{record.status.name}: {record.message} ({parameters})")
    return record
