"""Graded tensor grids and meshes mapped from them.

Any scikit-fem mesh with named boundaries serves as well, also one read with
``skfem.Mesh.load`` (meshio).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from skfem import MeshQuad, MeshQuad2, MeshTri

from solver.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray
    from skfem import Mesh


def graded(length: float, smallest: float, ratio: float, largest: float) -> NDArray[np.float64]:
    """Return node positions from 0 to ``length``, growing geometrically from ``smallest``.

    Element sizes are smallest, smallest * ratio, ... up to ``largest``; all are then scaled by
    the one factor (below 1) that makes them fill ``length`` exactly, so the first one is never
    larger than asked for.
    """
    if not 0 < smallest <= length:
        raise ModelError("smallest", smallest, f"must be in (0, {length:g}] [mm]")
    if not ratio >= 1:
        raise ModelError("ratio", ratio, "must be at least 1")
    sizes = []
    total, size = 0.0, smallest
    while total < length * (1 - 1e-9):
        sizes.append(min(size, max(largest, smallest)))
        total += sizes[-1]
        size *= ratio
    nodes = np.concatenate([[0.0], np.cumsum(sizes)])
    return np.asarray(nodes * (length / nodes[-1]))


def grid(x: NDArray[np.float64], y: NDArray[np.float64], cells: str = "quad") -> Mesh:
    """Return the tensor grid with boundaries ``left``, ``right``, ``bottom``, ``top``."""
    make = MeshTri if cells == "tri" else MeshQuad
    mesh = make.init_tensor(np.asarray(x, float), np.asarray(y, float))
    tolerance = 1e-9 * max(np.ptp(x), np.ptp(y))
    sides = {
        "left": (0, np.min(x)),
        "right": (0, np.max(x)),
        "bottom": (1, np.min(y)),
        "top": (1, np.max(y)),
    }
    return mesh.with_boundaries(
        {
            name: lambda m, axis=axis, value=value: np.abs(m[axis] - value) < tolerance
            for name, (axis, value) in sides.items()
        }
    )


def mapped(mesh: Mesh, function: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> Mesh:
    """Return a quadrilateral mesh with curved quadratic edges, its points moved by ``function``.

    ``function`` takes and returns coordinates (2, n); boundary names are kept. It must keep
    orientation.
    """
    curved = MeshQuad2.from_mesh(mesh)
    moved = MeshQuad2(
        doflocs=np.asarray(function(curved.doflocs)), t=curved.t, sort_t=False, validate=False
    )
    return moved.with_boundaries(dict(mesh.boundaries or {}))
