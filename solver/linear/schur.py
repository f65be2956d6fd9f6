"""The Schur complement of a symmetric matrix: some unknowns eliminated once, exactly.

With k the unknowns kept and i those inside, ``K_ii u_i = f_i - K_ik u_k`` and

    S u_k = f_k - K_ki K_ii^-1 f_i,   S = K_kk - K_ki K_ii^-1 K_ik

S differs from K_kk in a dense block, on the kept unknowns that meet those inside.
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
"""Right-hand sides solved at once."""


class SchurComplement:
    """A matrix (n, n) reduced to the unknowns ``kept``; those neither kept nor inside are zero.

    Parameters
    ----------
    matrix : symmetric, positive definite inside
    kept, inside : (m,), (k,) unknowns, increasing

    Attributes
    ----------
    boundary : (b,) places among those kept that meet unknowns inside
    taken : (b, b) what the elimination takes from K_kk there
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
        """Return the right-hand side of S, (m,) or (m, k), for one of all unknowns."""
        inner = force[self.inside]
        if not inner.any():
            return np.asarray(force[self.kept])
        return np.asarray(force[self.kept] - self._couple.T @ self._follow(inner))

    def expand(self, kept: Array, force: Array) -> Array:
        """Return all unknowns from those kept (m,) and the right-hand side of all (n,)."""
        u = np.zeros(len(force))
        u[self.kept] = kept
        u[self.inside] = self._follow(force[self.inside] - self._couple @ kept)
        return u

    def _follow(self, right: Array) -> Array:
        """Return the unknowns inside for their right-hand side, those kept held at zero."""
        return right if self._solver is None or not right.size else self._solver.solve(right)
