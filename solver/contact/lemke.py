"""Lemke's complementary pivoting, compiled.

R.W. Cottle, J.-S. Pang, R.E. Stone, The Linear Complementarity Problem (1992), algorithm 4.4.5.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def lemke(
    M: NDArray[np.float64], r: NDArray[np.float64], max_pivots: int
) -> tuple[NDArray[np.float64], bool]:  # pragma: no cover - compiled
    """Solve ``w = M z + r, w >= 0, z >= 0, w z = 0``.

    Returns
    -------
    z (n,), and whether it is a solution: False for a secondary ray or too many pivots.
    """
    n = len(r)
    z = np.zeros(n)
    if r.min() >= 0:
        return z, True
    # tableau of basic = T @ (w, z, z0, 1); variables 0..n-1 are w, n..2n-1 z, 2n is z0
    T = np.zeros((n, 2 * n + 2))
    for i in range(n):
        T[i, i] = 1.0
    T[:, n : 2 * n] = -M
    T[:, 2 * n] = -1.0
    T[:, 2 * n + 1] = r
    basis = np.arange(n)
    row = int(np.argmin(r))
    entering = 2 * n
    for _ in range(max_pivots):
        pivot = T[row, entering]
        T[row] /= pivot
        for i in range(n):
            if i != row and T[i, entering] != 0.0:
                T[i] -= T[i, entering] * T[row]
        leaving = basis[row]
        basis[row] = entering
        if leaving == 2 * n:
            for i in range(n):
                if n <= basis[i] < 2 * n:
                    z[basis[i] - n] = T[i, 2 * n + 1]
            return z, True
        entering = leaving + n if leaving < n else leaving - n
        scale = np.abs(T[:, entering]).max()
        best = np.inf
        row = -1
        for i in range(n):
            if T[i, entering] > 1e-11 * scale:
                ratio = max(T[i, 2 * n + 1], 0.0) / T[i, entering]
                tie = ratio <= best * (1 + 1e-12) and basis[i] == 2 * n
                if ratio < best or tie:
                    best = ratio
                    row = i
        if row < 0:
            return z, False
    return z, False
