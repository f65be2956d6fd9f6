"""Comparison of places up to rounding of coordinates: meshers may write single precision."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from skfem import Mesh

from solver.typing import Array, Bools

ROUNDED = 1e-7
"""Distance of two places over the size of the mesh: they are the same below this ratio."""
_OF_SIDE = 1e-3
"""The same, over the shortest side of the elements there."""


def with_zeros(mesh: Mesh) -> Mesh:
    """Return the mesh with 0 for coordinates that are 0 up to rounding, as on axes of symmetry."""
    p, nodes = mesh.doflocs, np.asarray(mesh.dofs.element_dofs)
    corners = p[:, mesh.t]
    side = np.full(p.shape[1], np.inf)
    shortest = np.hypot(*(np.roll(corners, -1, axis=1) - corners)).min(axis=0)
    for each in nodes:  # one by one: when it broadcasts, numpy 2.4 gives a false warning
        np.minimum.at(side, each, shortest)
    least = np.minimum(ROUNDED * np.ptp(p, axis=1).max(), _OF_SIDE * side)
    return replace(mesh, doflocs=np.where(np.abs(p) <= least, 0.0, p))


def in_box(places: Array, spans: Sequence[tuple[float, float] | None], size: float) -> Bools:
    """Return which places lie in a box, up to rounding of coordinates.

    Parameters
    ----------
    places : (n_axes, n) places [mm]
    spans : limits along each axis [mm]; None sets no limit
    size : size of the mesh [mm]
    """
    inside = np.ones(places.shape[1], dtype=bool)
    for at, span in zip(places, spans, strict=False):
        if span is not None:
            slack = ROUNDED * size
            inside &= (at >= span[0] - slack) & (at <= span[1] + slack)
    return inside
