"""Hertz contact on matching grids: a cylinder or a ball, held by contact alone, on a half-space."""

from __future__ import annotations

import numpy as np

from solver import Body, ContactPair, Material, Model, Solution, solve
from solver.mesh import graded, grid
from tests.verification.bodies import NU, E, bent, cells
from tests.verification.closed_forms import HertzLine, plane_strain_modulus

SIZE = 100.0
"""Width and height of both bodies, and radius of the cylinder [mm]; a is 1."""
_MODULUS = plane_strain_modulus(E, NU) / 2


def exact(size: float = SIZE) -> HertzLine:
    """Return the closed form of half-planes.

    Bodies of finite size disturb half-width and pressure by (a / size)^2, stress elsewhere by
    a / size: the load leaves a half-plane through its far end.
    """
    return HertzLine(force=np.pi * _MODULUS / (4 * size), radius=size, modulus=_MODULUS)


def pressure(x: np.ndarray, kinematics: str, size: float = SIZE) -> np.ndarray:
    """Return the closed form of the pressure at ``x`` from the middle: cylinder or ball."""
    if kinematics == "plane_strain":
        return exact(size).pressure(x)
    peak = 2 * _MODULUS / (np.pi * size)  # K.L. Johnson (1985), eq. 4.24
    return np.asarray(peak * np.sqrt(np.maximum(0.0, 1 - x**2)))


def press(
    n: float,
    element: str = "quad8",
    thickness: float = 1.0,
    size: float = SIZE,
    kinematics: str = "plane_strain",
) -> Solution:
    """Press with ``n`` elements in the half-width; the growth of the others halves with theirs."""
    h, growth = 1.0 / n, 1 + 1.8 / n
    fine = np.arange(round(1.5 * n) + 1) / n
    mean = exact(size).force / 2 / size
    if kinematics == "axisymmetric":
        mean = 4 * _MODULUS / (3 * size) / (np.pi * size**2)  # K.L. Johnson (1985), eq. 4.22
    x = np.concatenate([fine, fine[-1] + graded(size - fine[-1], h, growth, size / 10)[1:]])
    y = graded(size, h, growth, size / 10)

    def bulge(p: np.ndarray) -> np.ndarray:
        profile = np.minimum(p[0] ** 2 / (2 * size), size / 8)
        return np.stack([p[0], profile + p[1] * (size - profile) / size])

    given = {
        "material": Material(youngs_modulus=E, poisson_ratio=NU),
        "element": element,
        "thickness": thickness,
        "kinematics": kinematics,
    }
    cylinder = Body(
        name="cylinder",
        mesh=bent(grid(x, y, cells(element)), bulge),
        supports={"left": "x"},
        pressure={"top": mean},
        **given,
    )
    plane = Body(
        name="plane",
        mesh=grid(x, -y[::-1], cells(element)),
        supports={"left": "x", "bottom": "y"},
        **given,
    )
    # the closed form has places and directions of contact before loading
    pair = ContactPair(slave=("cylinder", "bottom"), master=("plane", "top"), sliding="small")
    return solve(Model(bodies=(cylinder, plane), contacts=(pair,)))
