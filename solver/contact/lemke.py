"""Lemke's complementary pivoting.

R.W. Cottle, J.-S. Pang, R.E. Stone, The Linear Complementarity Problem (1992), algorithm 4.4.5.
"""

from __future__ import annotations

import numpy as np

from solver.typing import Array, Bools


def lemke(M: Array, r: Array, max_pivots: int) -> tuple[Array, bool]:
    """Solve ``w = M z + r, w >= 0, z >= 0, w z = 0``.

    Returns
    -------
    z (n,), and whether it is a solution: false after a secondary ray or too many pivots.
    """
    n = len(r)
    z = np.zeros(n)
    if r.min() >= 0:
        return z, True
    # tableau of basic = T @ (w, z, z0, 1); variables 0..n-1 are w, n..2n-1 z, 2n is z0
    T = np.hstack([np.eye(n), -M, np.full((n, 1), -1.0), r[:, None]])
    change = np.empty_like(T)
    basis = np.arange(n)
    row = int(np.argmin(r))
    entering = 2 * n
    for _ in range(max_pivots):
        T[row] /= T[row, entering]
        factors = T[:, entering].copy()
        factors[row] = 0.0
        T -= np.multiply.outer(factors, T[row], out=change)
        leaving = basis[row]
        basis[row] = entering
        if leaving == 2 * n:
            found = (n <= basis) & (basis < 2 * n)
            z[basis[found] - n] = T[found, 2 * n + 1]
            return z, True
        entering = leaving + n if leaving < n else leaving - n
        row = _leaving(T[:, entering], T[:, 2 * n + 1], basis == 2 * n)
        if row < 0:
            return z, False
    return z, False


def _leaving(column: Array, values: Array, artificial: Bools) -> int:
    """Return the row of the least ratio, preferably that of z0 among equal ones; -1 if none."""
    rows = np.flatnonzero(column > 1e-11 * np.abs(column).max())
    ratios = np.maximum(values[rows], 0.0) / column[rows]
    best, found = np.inf, -1
    for i, ratio, z0 in zip(rows.tolist(), ratios.tolist(), artificial[rows].tolist(), strict=True):
        if ratio < best or (z0 and ratio <= best * (1 + 1e-12)):
            best, found = ratio, i
    return found
