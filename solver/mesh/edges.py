"""Shape functions of an edge."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def shape_functions(xi: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return edge shape functions (..., count) at ``xi`` in [-1, 1]: both ends, then the middle."""
    if count == 2:
        return np.stack([(1 - xi) / 2, (1 + xi) / 2], axis=-1)
    return np.stack([xi * (xi - 1) / 2, xi * (xi + 1) / 2, 1 - xi**2], axis=-1)


def shape_derivatives(xi: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return the derivatives of `shape_functions` with respect to ``xi``."""
    if count == 2:
        half = np.full_like(xi, 0.5)
        return np.stack([-half, half], axis=-1)
    return np.stack([xi - 0.5, xi + 0.5, -2 * xi], axis=-1)
