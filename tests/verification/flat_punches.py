"""Flat punches on a half-plane, meshed finely towards the corner.

The corner is the origin (x < 0 under the punch, y < 0 in the half-plane), so that coordinates
resolve elements of 1e-5 half-widths.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver import ContactPair, Model, PathControl, Solution, solve
from solver.mesh import graded
from tests.verification.bodies import block, steel


@dataclass(frozen=True)
class Pressed:
    """Distances from the corner over the half-width, growing, and what acts there over p0."""

    r: NDArray[np.float64]
    pressure: NDArray[np.float64]
    shear: NDArray[np.float64]
    sliding: NDArray[np.bool_]
    solution: Solution


def press(
    smallest: float,
    friction: float = 0.0,
    stiffness: float = 1.0,
    size: float = 20.0,
    growth: float = 1.4,
    element: str = "quad8",
    steps: int = 1,
    slave: str = "punch",
) -> Pressed:
    """Press an elastic punch of half-width 1 on an elastic half-plane in plane strain.

    ``stiffness`` is the punch's Young's modulus over the half-plane's, ``size`` the half-plane's
    width and depth; the mean pressure is 1e-3 of Young's modulus.
    """
    under = -graded(1.0, smallest, growth, 0.08)[::-1]
    beyond = graded(size - 1.0, smallest, growth, size / 8)
    punch = block(
        "punch",
        under,
        graded(2.0, smallest, growth, 0.25),
        element,
        material=steel(youngs_modulus=2e5 * stiffness),
        supports={"left": "x"},
        pressure={"top": 200.0},
    )
    plane = block(
        "half_plane",
        np.concatenate([under, beyond[1:]]),
        -graded(size, smallest, growth, size / 8)[::-1],
        element,
        supports={"left": "x", "bottom": "y"},
    )
    sides = [("punch", "bottom"), ("half_plane", "top")]
    if slave != "punch":
        sides.reverse()
    pair = ContactPair(slave=sides[0], master=sides[1], friction=friction)
    model = Model(bodies=(punch, plane), contacts=(pair,))
    solution = solve(model, control=PathControl(load_step=1 / steps, unload_steps=1))
    acting = solution.contact()
    x, pressure, shear = acting.X, acting.pressure, -acting.shear  # on the slave
    inside = x[0] <= 0
    order = np.argsort(-x[0, inside])
    status = solution.loaded.state.contacts[0].status
    return Pressed(
        r=-x[0, inside][order],
        pressure=pressure[inside][order] / 200.0,
        shear=shear[inside][order] / 200.0,
        sliding=status[inside][order] > 1,
        solution=solution,
    )
