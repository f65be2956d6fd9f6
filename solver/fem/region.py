"""Where a body may yield and touch: a box of elements around where it does.

A box is placed on a coarse lattice. It depends on the elements and nodes it is for, and on nothing
that was before, and few boxes do for all places on the way of a load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

Box = tuple[float, float, float, float]
"""Centre (x, y) and half the sides (x, y) [mm]."""

_LATTICE = 8.0
"""Size of what a box is for / distance of the lattice's points, at most."""


def box_around(X: NDArray[np.float64]) -> Box:
    """Return a box that has all nodes X (2, n) inside."""
    low, high = X.min(axis=1), X.max(axis=1)
    size = float((high - low).max())
    step = 2.0 ** np.ceil(np.log2(size / _LATTICE))
    centre = step * np.round((low + high) / 2 / step)
    reach = np.maximum(high - centre, centre - low)
    half = step * np.ceil(reach / step)
    return (*centre.tolist(), *half.tolist())


def inside(box: Box, X: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which points X (2, n) are in a box."""
    x, y, across, deep = box
    return np.asarray((np.abs(X[0] - x) <= across) & (np.abs(X[1] - y) <= deep))
