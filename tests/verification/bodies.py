"""Bodies that several verification problems are made of."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh, MeshTri2

from solver import Body, Material, System
from solver.mesh import grid, mapped

E, NU = 2.0e5, 0.3


def steel(
    yield_stress: float = math.inf, poisson_ratio: float = NU, youngs_modulus: float = E
) -> Material:
    """Return a material without hardening."""
    return Material(
        youngs_modulus=youngs_modulus, poisson_ratio=poisson_ratio, yield_stress=yield_stress
    )


def cells(element: str) -> str:
    """Return the cells that an element needs."""
    return "tri" if element.startswith("tri") else "quad"


def block(
    name: str, x: NDArray[np.float64], y: NDArray[np.float64], element: str = "quad8", **fields
) -> Body:
    """Return a rectangular body of steel on a tensor grid."""
    fields = {"material": steel()} | fields
    return Body(name=name, mesh=grid(x, y, cells(element)), element=element, **fields)


def bent(mesh: Mesh, function: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> Mesh:
    """Return a mesh of either cells with quadratic edges, its points moved by ``function``."""
    if mesh.t.shape[0] == 4:
        return mapped(mesh, function)
    curved = MeshTri2.from_mesh(mesh)
    moved = MeshTri2(doflocs=function(curved.doflocs), t=curved.t, sort_t=False, validate=False)
    return moved.with_boundaries(dict(mesh.boundaries))


def sector(radii: NDArray[np.float64], n_angle: int, element: str = "quad8", **fields) -> Body:
    """Return a quarter of a ring; ``left`` is the bore, ``bottom`` y = 0, ``top`` x = 0."""

    def to_ring(p: NDArray[np.float64]) -> NDArray[np.float64]:
        # np.abs: cos(pi/2) is 6e-17, and its sign must not put a node beyond the axis
        return np.abs(p[0] * np.stack([np.cos(p[1]), np.sin(p[1])]))

    angles = np.linspace(0.0, np.pi / 2, n_angle + 1)
    mesh = bent(grid(radii, angles, cells(element)), to_ring)
    return Body(
        name="ring",
        mesh=mesh,
        element=element,
        supports={"bottom": "y", "top": "x"},
        **fields,
    )


def polar_stress(
    system: System, name: str, stress: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return radius, radial and in-plane hoop stress at the points; ``stress`` is Mandel."""
    x, y = system.full(name).points.reshape(2, -1)
    r = np.hypot(x, y)
    c, s = x / r, y / r
    shear = 2 * stress[3] / np.sqrt(2) * c * s
    radial = c**2 * stress[0] + s**2 * stress[1] + shear
    hoop = s**2 * stress[0] + c**2 * stress[1] - shear
    return r, radial, hoop
