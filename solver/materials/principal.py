"""Principal values and directions of Mandel tensors, and unit tensors of these directions."""

from __future__ import annotations

import numpy as np

from solver.tensors import SQRT2
from solver.typing import Array

_PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
"""Row and column of each Mandel component; in two dimensions the first four."""
PAIRS = ((0, 1), (0, 2), (1, 2))
"""Pairs of principal directions."""


def principal(mandel: Array) -> tuple[Array, Array]:
    """Return the principal values (3, n), the largest first, and their directions.

    In the directions (3, 3, n) the first axis is the component of the unit vector, the second its
    number. Values of a tensor that is not finite are NaN.

    Parameters
    ----------
    mandel : (n_components, n)
    """
    full = np.zeros((mandel.shape[1], 3, 3))
    for value, (i, j) in zip(mandel, _PLACES, strict=False):
        full[:, i, j] = full[:, j, i] = value if i == j else value / SQRT2
    unknown = ~np.isfinite(full).all(axis=(1, 2))
    full[unknown] = 0.0
    values, directions = np.linalg.eigh(full)
    values[unknown] = np.nan
    return values.T[::-1], directions.transpose(1, 2, 0)[:, ::-1]


def dyad(directions: Array, i: int, j: int, n_components: int) -> Array:
    """Return the unit tensor (n_components, n), Mandel, of two principal directions.

    It is e_i e_i, or (e_i e_j + e_j e_i) / sqrt(2); these tensors are an orthonormal basis.
    """
    a, b = directions[:, i], directions[:, j]
    rows = [
        a[k] * b[k] if k == m else (a[k] * b[m] + a[m] * b[k]) / SQRT2
        for k, m in _PLACES[:n_components]
    ]
    return np.stack(rows) * (1.0 if i == j else SQRT2)
