"""Notches and holes: cells taken out of a mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.errors import ModelError

if TYPE_CHECKING:
    from skfem import Mesh

_SAME = 1e-9
"""Ratio of the distance to the size of a mesh, below which lines are the same."""


def without(mesh: Mesh, name: str, x: tuple[float, float], y: tuple[float, float]) -> Mesh:
    """Return a mesh without the cells of a rectangle; the boundary this opens is ``name``.

    Other boundaries keep what is left of them. On the side of a body the rectangle is a notch,
    inside it is a hole.

    Parameters
    ----------
    mesh : of straight cells, whose edges run along the sides of the rectangle
    x, y : from where to where it goes [mm]; beyond the body is allowed

    Raises
    ------
    ModelError
        no cell lies inside, none outside, or one lies across a side
    """
    (low, high), corners = np.array([x, y], dtype=float).T[:, :, None], mesh.p[:, mesh.t]
    slack = _SAME * float(np.ptp(mesh.p, axis=1).max())
    least, most = corners.min(axis=1), corners.max(axis=1)
    inside = ((least > low - slack) & (most < high + slack)).all(axis=0)
    touched = ((least < high - slack) & (most > low + slack)).all(axis=0)
    rectangle = f"x {x[0]:g} to {x[1]:g}, y {y[0]:g} to {y[1]:g}"
    if (touched & ~inside).any():
        raise ModelError(name, rectangle, "must have its sides along lines of the mesh")
    if inside.all() or not inside.any():
        raise ModelError(name, rectangle, "must hold some cells of the mesh, and leave some")
    kept = np.flatnonzero(~inside)
    facets = np.unique(mesh.t2f[:, kept])  # in the order in which the new mesh numbers them
    one, other = mesh.f2t[:, facets]
    opened = (other >= 0) & (inside[one] != inside[other])
    return mesh.restrict(kept).with_boundaries({name: np.flatnonzero(opened)})
