"""Dense linear systems, factorised in single precision and refined to double.

N.J. Higham, Accuracy and Stability of Numerical Algorithms (2nd edition, 2002), section 12.1.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack

from solver.typing import Array

_REFINED = 1e-12
"""Norm of the residual over that of the right-hand side, at most."""
_STEPS = 4
"""Most solutions in single precision; then the matrix is factorised in double."""


class RefinedLU:
    """LU factors of a matrix (n, n) in single precision, half as expensive as in double.

    If single precision is too coarse for the matrix, it is factorised again in double.

    Parameters
    ----------
    matrix : (n, n), not changed

    Raises
    ------
    ZeroDivisionError
        if the matrix is singular
    """

    def __init__(self, matrix: Array) -> None:
        self._matrix = matrix
        self._factorise(np.float32)

    def _factorise(self, kind: type[np.floating]) -> None:
        # LAPACK stores by columns: the transpose needs no further copy
        own = self._matrix.astype(kind, order="C").T
        self._single = kind is np.float32
        factorise = lapack.sgetrf if self._single else lapack.dgetrf
        self._factors, self._pivots, singular = factorise(own, overwrite_a=True)
        if singular:
            raise ZeroDivisionError("the matrix is singular")

    def _once(self, right: Array) -> Array:
        solve = lapack.sgetrs if self._single else lapack.dgetrs
        return np.asarray(solve(self._factors, self._pivots, right, trans=1)[0], dtype=float)

    def solve(self, right: Array) -> Array:
        """Return the solution (n,) for a right-hand side (n,).

        Raises
        ------
        ZeroDivisionError
            if the matrix is singular
        """
        found, residual = np.zeros_like(right), right
        size = float(np.linalg.norm(right))
        for _ in range(_STEPS if self._single else 0):
            found = found + self._once(residual)
            residual = right - self._matrix @ found
            if np.linalg.norm(residual) <= _REFINED * size:
                return found
        if self._single:
            self._factorise(np.float64)
        return self._once(right)
