"""Linear systems by iteration: dense factors in single precision refined to double, and GMRES.

N.J. Higham, Accuracy and Stability of Numerical Algorithms (2nd edition, 2002), section 12.1.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import lapack
from scipy.linalg.blas import daxpy, ddot

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


_BREAKDOWN = 1e-14
"""Breakdown tolerance: norm of a Krylov vector after orthogonalisation over its norm before."""


def gmres(
    product: Callable[[Array], Array], b: Array, tolerance: float, most: int
) -> tuple[Array, bool]:
    """Return a solution x (n,) of A x = b, and whether its residual is within the tolerance.

    It begins with x = 0, does not restart, and stops at a product that is not finite.
    `scipy.sparse.linalg.gmres` needs one more product, to check the residual: a fifth of the work
    for a solution to one digit.

    Parameters
    ----------
    product : x (n,) -> A x (n,)
    tolerance : largest norm of the residual over that of b
    most : largest number of products

    References
    ----------
    Y. Saad, Iterative Methods for Sparse Linear Systems (2nd edition, 2003), algorithm 6.9.
    """
    size = float(np.linalg.norm(b))
    if size == 0.0:
        return np.zeros_like(b), True
    basis, H = [b / size], np.zeros((most + 1, most))
    y, small = np.zeros(0), False
    for k in range(most):
        w = np.array(product(basis[k]), dtype=float)
        before = float(np.linalg.norm(w))
        if not np.isfinite(before):
            break
        for i, v in enumerate(basis):
            H[i, k] = ddot(v, w)
            daxpy(v, w, a=-H[i, k])
        H[k + 1, k] = np.linalg.norm(w)
        right = np.append(size, np.zeros(k + 1))
        y = np.linalg.lstsq(H[: k + 2, : k + 1], right)[0]
        residual = float(np.linalg.norm(H[: k + 2, : k + 1] @ y - right))
        small = residual <= tolerance * size
        if small or not H[k + 1, k] > _BREAKDOWN * before:
            break
        basis.append(w / H[k + 1, k])
    x = np.zeros_like(b)
    for factor, v in zip(y, basis, strict=False):
        daxpy(v, x, a=factor)
    return x, small
