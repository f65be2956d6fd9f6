"""One problem in other units of length and stress: the same numbers in its own units."""

from __future__ import annotations

from functools import cache, partial

import numpy as np

from solver import Body, ContactPair, Material, Model, PathControl, Solution, solve
from solver.mesh import grid
from tests.stability.closed import passed
from tests.stability.trial import Figure, Scene

BODIES = ("punch", "base")
SAME = 1e-7
"""Scaling is exact but for rounding, and increments end within 1e-8 of balance."""


def pressed(
    length: float = 1.0,
    stress: float = 1.0,
    at: tuple[float, float] = (0.0, 0.0),
    friction: float = 0.3,
    cells: str = "quad",
) -> Solution:
    """Return a yielding punch on a wider yielding base, all lengths and stresses scaled."""

    def material(factor: float) -> Material:
        return Material(
            youngs_modulus=2e5 * stress * factor,
            poisson_ratio=0.3,
            yield_stress=300.0 * stress,
            hardening="kinematic",
            hardening_ratio=0.05,
        )

    def block(x: np.ndarray, y: np.ndarray) -> object:
        return grid(at[0] + length * x, at[1] + length * y, cells)

    fields = {"thickness": length, "element": "quad8" if cells == "quad" else "tri6"}
    punch = Body(
        name="punch",
        mesh=block(np.linspace(0, 3, 5), np.linspace(0, 2, 3)),
        material=material(0.5),
        supports={"left": "x"},
        pressure={"top": 400.0 * stress},
        **fields,
    )
    base = Body(
        name="base",
        mesh=block(np.linspace(0, 6, 7), np.linspace(-4, 0, 4)),
        material=material(1.0),
        supports={"left": "x", "bottom": "y"},
        **fields,
    )
    pair = ContactPair(slave=("punch", "bottom"), master=("base", "top"), friction=friction)
    control = PathControl(load_step=0.25, unload_steps=2)
    return solve(Model(bodies=(punch, base), contacts=(pair,)), control=control)


@cache
def _unscaled(friction: float, cells: str) -> Solution:
    return pressed(friction=friction, cells=cells)


def compare(
    solution: Solution, wanted: Solution, length: float, stress: float, limit: float
) -> dict[str, Figure]:
    """Return how far a solution, its scales taken out, is from another."""
    figures = {"audit": passed(solution)}
    for stage in ("loaded", "unloaded"):
        here, there = getattr(solution, stage), getattr(wanted, stage)
        moved, strained = 0.0, 0.0
        for body in BODIES:
            u = solution.displacement(body, stage) / length
            moved = max(moved, _apart(u, wanted.displacement(body, stage), wanted, body))
            points = solution.system.state(body, here).stress / stress
            same = wanted.system.state(body, there).stress
            strained = max(strained, float(np.abs(points - same).max()) / 300.0)
        figures[f"displacement {stage}"] = Figure(moved, limit)
        figures[f"stress {stage}"] = Figure(strained, limit)
    force = solution.loaded.state.contacts[0].normal / (stress * length**2)
    same = wanted.loaded.state.contacts[0].normal
    figures["contact forces"] = Figure(float(np.abs(force - same).max() / same.sum()), limit)
    return figures


def _apart(u: np.ndarray, other: np.ndarray, wanted: Solution, body: str) -> float:
    size = float(np.abs(wanted.displacement(body, "loaded")).max())
    return float(np.abs(u - other).max()) / size


def _judge(
    length: float, stress: float, friction: float, cells: str, solution: Solution
) -> dict[str, Figure]:
    return compare(solution, _unscaled(friction, cells), length, stress, SAME)


def scenes() -> list[Scene]:
    """Return lengths from nanometres to kilometres, stresses in pascals and in 1e6 MPa."""
    scales = (
        (1e-6, 1.0, 0.3, "quad"),
        (1e-4, 1.0, 0.0, "tri"),
        (1e-2, 1.0, 0.3, "quad"),
        (1e3, 1.0, 0.3, "quad"),
        (1.0, 1e6, 0.3, "quad"),
        (1e-3, 1e-6, 0.0, "tri"),
    )
    return [
        Scene(
            what=f"lengths times {length:g}, stresses times {stress:g}, friction {mu:g}, {cells}",
            run=partial(pressed, length, stress, friction=mu, cells=cells),
            judge=partial(_judge, length, stress, mu, cells),
        )
        for length, stress, mu, cells in scales
    ]
