"""Shape functions of an edge."""

from __future__ import annotations

import numpy as np

from solver.typing import Array


def shape_functions(xi: Array, count: int) -> Array:
    """Return edge shape functions (..., count) at ``xi`` in [-1, 1]: both ends, then the middle."""
    if count == 2:
        return _side_by_side(xi, (1 - xi) / 2, (1 + xi) / 2)
    return _side_by_side(xi, xi * (xi - 1) / 2, xi * (xi + 1) / 2, 1 - xi**2)


def shape_derivatives(xi: Array, count: int) -> Array:
    """Return the derivatives of `shape_functions` with respect to ``xi``."""
    if count == 2:
        return _side_by_side(xi, -0.5, 0.5)
    return _side_by_side(xi, xi - 0.5, xi + 0.5, -2 * xi)


def _side_by_side(xi: Array, *each: Array | float) -> Array:
    """Return the values at ``xi`` (...) along a new last axis; `numpy.stack` is slower."""
    out = np.empty((*xi.shape, len(each)))
    for k, values in enumerate(each):
        out[..., k] = values
    return out
