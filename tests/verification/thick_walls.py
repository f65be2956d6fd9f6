"""Thick walls under internal pressure, loaded beyond yield and released: a quarter of a ring."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from solver import Model, PathControl, Solution, solve
from solver.materials import Law
from tests.verification.bodies import polar_stress, sector, steel
from tests.verification.closed_forms import ThickCylinder, ThickSphere

YIELD = 300.0
SPHERE = ThickSphere(inner=1.0, outer=2.0, yield_stress=YIELD, front=1.4)
CYLINDER = ThickCylinder(inner=1.0, outer=2.0, yield_stress=YIELD, front=1.4)


_STAGES: Mapping[str, Callable[..., tuple[NDArray[np.float64], NDArray[np.float64]]]] = {
    "elastic": lambda wall, r: wall.elastic(r, wall.pressure),
    "loaded": lambda wall, r: wall.loaded(r),
    "unloaded": lambda wall, r: wall.residual(r),
}


def press(
    state: str,
    pressure: float,
    poisson_ratio: float,
    n_radius: int,
    n_angle: int,
    element: str = "quad8",
    steps: int = 1,
    material: Law | None = None,
) -> Solution:
    """Return a wall of ``n_radius`` by ``n_angle`` elements, put under pressure and released.

    Its material is a steel without hardening, unless one is given.
    """
    body = sector(
        np.linspace(1.0, 2.0, n_radius + 1),
        n_angle,
        material=material or steel(YIELD, poisson_ratio),
        kinematics=state,
        element=element,
        pressure={"left": pressure},
        condense=False,
    )
    control = PathControl(load_step=1 / steps, unload_steps=1)
    return solve(Model(bodies=(body,)), control=control)


def exact_stress(
    wall: ThickCylinder | ThickSphere, stage: str, poisson_ratio: float, x: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the Mandel stress (4, n) of a stage at positions (2, n)."""
    r = np.hypot(*x)
    radial, hoop = _STAGES[stage](wall, r)
    c, s = x / r
    across = hoop if isinstance(wall, ThickSphere) else poisson_ratio * (radial + hoop)
    return np.stack([
        c**2 * radial + s**2 * hoop,
        s**2 * radial + c**2 * hoop,
        across,
        np.sqrt(2) * c * s * (radial - hoop),
    ])  # fmt: skip


def misfit(
    solution: Solution, wall: ThickCylinder | ThickSphere, stage: str
) -> NDArray[np.float64]:
    """Return the errors of radial and hoop stress (2, n_points) / yield stress at a stage."""
    stress = solution.system.state("ring", getattr(solution, stage)).stress
    r, radial, hoop = polar_stress(solution.system, "ring", stress)
    return (np.stack([radial, hoop]) - np.stack(_STAGES[stage](wall, r))) / wall.yield_stress


def errors(solution: Solution, wall: ThickCylinder | ThickSphere) -> dict[str, float]:
    """Return the largest error of radial and hoop stress at the points / yield stress, by stage."""
    return {s: float(np.abs(misfit(solution, wall, s)).max()) for s in ("loaded", "unloaded")}
