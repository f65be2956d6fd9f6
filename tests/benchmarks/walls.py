"""Thick walls pressed beyond yield and released: residual hoop stress against Hill's closed forms.

The cylinder is in plane strain and almost incompressible, as its closed form is: elements that lock
are told from those that do not. The sphere is of Poisson ratio 0.3; its elements at the axis are
the worst ones. The plastic front crosses elements in every mesh.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tests.benchmarks.measure import Point, timed
from tests.verification.closed_forms import ThickCylinder, ThickSphere
from tests.verification.effectivity import effectivity
from tests.verification.thick_walls import CYLINDER, SPHERE, exact_stress, misfit, press

ELEMENTS = ("quad8", "quad9", "quad4", "tri6", "tri3")
INCREMENTS = "increments"
MEASURES = {
    "mean": "residual hoop stress, mean square / yield stress",
    "largest": "residual hoop stress, largest error / yield stress",
}


EFFECTIVITY = "estimated / true"
"""Error of residual stress in the energy norm."""


@dataclass(frozen=True, slots=True)
class Wall:
    """A closed form, and the body it is for."""

    exact: ThickCylinder | ThickSphere
    kinematics: str
    poisson_ratio: float


WALLS = {
    "cylinder": Wall(CYLINDER, "plane_strain", 0.4999),
    "sphere": Wall(SPHERE, "axisymmetric", 0.3),
}


@dataclass(frozen=True, slots=True)
class Case:
    """A mesh of ``n`` by ``n`` elements, loaded in a number of increments."""

    series: str
    element: str
    n: int
    steps: int = 1


def plan(quick: bool) -> tuple[Case, ...]:
    """Return the cases of each wall."""
    return tuple(_cases((8, 16) if quick else (8, 16, 32, 64), (1,) if quick else (1, 4, 16)))


def _cases(meshes: Sequence[int], steps: Sequence[int]) -> Iterator[Case]:
    for element in ELEMENTS:
        for n in meshes:
            yield Case(element, element, n)
    for count in steps:
        yield Case(INCREMENTS, "quad8", 16, count)


def measure(quick: bool, repeats: int) -> list[Point]:
    """Return a point for every case of every wall."""
    return [
        _point(name, wall, case, repeats) for name, wall in WALLS.items() for case in plan(quick)
    ]


def _point(name: str, wall: Wall, case: Case, repeats: int) -> Point:
    run = timed(
        lambda _: press(
            wall.kinematics, wall.exact.pressure, wall.poisson_ratio, case.n, case.n,
            case.element, case.steps,
        ),
        repeats,
    )  # fmt: skip
    hoop = misfit(run.result, wall.exact, "unloaded")[1]
    system = run.result.system
    body = system.full("ring")
    mean = np.sqrt(hoop**2 @ body.volumes / body.volumes.sum())
    estimate = effectivity(
        body,
        system.state("ring", run.result.unloaded).stress,
        lambda x: exact_stress(wall.exact, "unloaded", wall.poisson_ratio, x),
    )
    several = case.series == INCREMENTS
    return Point(
        problem="walls",
        series=case.series,
        setting=(f"{case.steps} increments" if several else f"{case.n} x {case.n}") + f", {name}",
        size=float("nan") if several else 1.0 / case.n,
        unknowns=system.n_unknowns,
        cpu=run.cpu,
        spread=run.spread,
        repeats=run.repeats,
        values={EFFECTIVITY: estimate},
        errors={"mean": float(mean), "largest": float(np.abs(hoop).max())},
    )
