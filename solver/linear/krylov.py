"""Linear systems given by matrix-vector products."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg.blas import daxpy, ddot

from solver.typing import Array

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
