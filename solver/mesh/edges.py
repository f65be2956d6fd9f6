"""Shape functions of an edge."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def shape_functions(xi: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return edge shape functions (..., count) at ``xi`` in [-1, 1]: both ends, then the middle."""
    ends = ((1 - xi) / 2, (1 + xi) / 2) if count == 2 else (xi * (xi - 1) / 2, xi * (xi + 1) / 2)
    return _last(xi, count, *ends, 1 - xi**2)


def shape_derivatives(xi: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return the derivatives of `shape_functions` with respect to ``xi``."""
    if count == 2:
        return _last(xi, count, -0.5, 0.5)
    return _last(xi, count, xi - 0.5, xi + 0.5, -2 * xi)


def _last(
    xi: NDArray[np.float64], count: int, *each: NDArray[np.float64] | float
) -> NDArray[np.float64]:
    """Return the first ``count`` values (..., count), side by side in the last axis."""
    out = np.empty((*xi.shape, count))
    for k in range(count):
        out[..., k] = each[k]
    return out
