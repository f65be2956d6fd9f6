"""The Schur complement of a symmetric matrix: inner unknowns are eliminated once, exactly.

With k the kept and i the inner unknowns, ``K_ii u_i = f_i - K_ik u_k`` and

    S u_k = f_k - K_ki K_ii^-1 f_i,   S = K_kk - K_ki K_ii^-1 K_ik

S differs from K_kk in a dense block, on the kept unknowns that are coupled to inner ones.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from solver.linear import solvers as linear

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Numbers = NDArray[np.int64]

_COLUMNS = 64
"""Number of right-hand sides that are solved at once."""


class SchurComplement:
    """A matrix (n, n) reduced to the unknowns ``kept``; those neither kept nor inside are zero.

    Parameters
    ----------
    matrix : symmetric (n, n), positive definite on the inner unknowns
    kept, inside : (m,), (k,) kept and inner unknowns, increasing

    Attributes
    ----------
    boundary : (b,) positions among the kept unknowns that are coupled to inner ones
    taken : (b, b) the block K_ki K_ii^-1 K_ik, subtracted from K_kk there
    """

    def __init__(
        self, matrix: sparse.csr_array, kept: Numbers, inside: Numbers, linear_solver: str = "auto"
    ) -> None:
        self.kept, self.inside = kept, inside
        self._couple = sparse.csr_array(matrix[inside][:, kept])
        self._solver = None
        if len(inside):
            upper = sparse.csr_array(sparse.triu(matrix[inside][:, inside], format="csr"))
            upper.sort_indices()
            self._solver = linear.analyse(upper, linear_solver)
            self._solver.factorise(upper.data)
        self.boundary = np.unique(self._couple.indices)
        couple = self._couple[:, self.boundary]
        self.taken = np.zeros((len(self.boundary),) * 2)
        for first in range(0, len(self.boundary), _COLUMNS):
            some = slice(first, first + _COLUMNS)
            self.taken[:, some] = couple.T @ self._follow(couple[:, some].toarray())

    def condense(self, force: Array) -> Array:
        """Return the right-hand side of S, (m,) or (m, k), from that of all unknowns (n, ...)."""
        inner = force[self.inside]
        if not inner.any():
            return np.asarray(force[self.kept])
        return np.asarray(force[self.kept] - self._couple.T @ self._follow(inner))

    def expand(self, kept: Array, force: Array) -> Array:
        """Return all unknowns (n,) from the kept ones (m,) and the right-hand side (n,)."""
        u = np.zeros(len(force))
        u[self.kept] = kept
        u[self.inside] = self._follow(force[self.inside] - self._couple @ kept)
        return u

    def _follow(self, right: Array) -> Array:
        """Return the inner unknowns for their right-hand side, with the kept unknowns at zero."""
        return right if self._solver is None or not right.size else self._solver.solve(right)
