"""Boxes around the elements that yield and the nodes in contact, for windows of the tangent.

Boxes lie on a coarse lattice, so that a few boxes cover all positions of a moving load. A box
depends only on the elements and nodes it encloses, not on earlier increments.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

Box = tuple[float, float, float, float]
"""Centre (x, y) and half the sides (x, y) [mm]."""

_LATTICE = 8.0
"""Largest ratio of the enclosed size to the spacing of the lattice."""


def box_around(X: NDArray[np.float64]) -> Box:
    """Return the box of the lattice that encloses all nodes X (2, n)."""
    low, high = X.min(axis=1), X.max(axis=1)
    size = float((high - low).max())
    step = 2.0 ** np.ceil(np.log2(size / _LATTICE))
    centre = step * np.round((low + high) / 2 / step)
    reach = np.maximum(high - centre, centre - low)
    half = step * np.ceil(reach / step)
    return (*centre.tolist(), *half.tolist())


def inside(box: Box, X: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return whether points X (2, n) are in a box (n,)."""
    x, y, across, deep = box
    return np.asarray((np.abs(X[0] - x) <= across) & (np.abs(X[1] - y) <= deep))
