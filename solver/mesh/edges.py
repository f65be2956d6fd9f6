"""Shape functions of an edge."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def shape_functions(xi: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return edge shape functions (..., count) at ``xi`` in [-1, 1]: both ends, then the middle."""
    if count == 2:
        return _side_by_side(xi, (1 - xi) / 2, (1 + xi) / 2)
    return _side_by_side(xi, xi * (xi - 1) / 2, xi * (xi + 1) / 2, 1 - xi**2)


def shape_derivatives(xi: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return the derivatives of `shape_functions` with respect to ``xi``."""
    if count == 2:
        return _side_by_side(xi, -0.5, 0.5)
    return _side_by_side(xi, xi - 0.5, xi + 0.5, -2 * xi)


def _side_by_side(
    xi: NDArray[np.float64], *each: NDArray[np.float64] | float
) -> NDArray[np.float64]:
    """Return the values at each of ``xi`` (..., n) in a last axis; `numpy.stack` is slower."""
    out = np.empty((*xi.shape, len(each)))
    for k, values in enumerate(each):
        out[..., k] = values
    return out
