"""The Schur complement of a symmetric matrix: exact elimination of inner unknowns.

With k the kept and i the inner unknowns, ``K_ii u_i = f_i - K_ik u_k`` and

    S u_k = f_k - K_ki K_ii^-1 f_i,   S = K_kk - K_ki K_ii^-1 K_ik

S differs from K_kk in a dense block on the boundary b: the kept unknowns coupled to inner ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from solver.linear import solvers as linear
from solver.linear.pardiso import Pardiso
from solver.typing import Array, Ints

_COLUMNS = 64
"""Number of right-hand sides solved at once."""


@dataclass(frozen=True, slots=True)
class Eliminated:
    """A right-hand side with its inner unknowns eliminated.

    Attributes
    ----------
    condensed : (m,) or (m, k) right-hand side of S
    finish : (kept unknowns (m,) or (m, k)) -> all unknowns (n,) or (n, k)
    """

    condensed: Array
    finish: Callable[[Array], Array]


class _ByColumns:
    """Elimination by one solve for each of the last unknowns, with any linear solver.

    Parameters
    ----------
    upper : upper triangle (k + b, k + b)
    size : k
    """

    def __init__(self, upper: sparse.csr_array, size: int, linear_solver: str) -> None:
        self._upper, self._size = upper.copy(), size
        inner = sparse.csr_array(upper[:size, :size])
        self._solver = linear.analyse(inner, linear_solver) if size else None

    def eliminate(self, data: Array) -> Array:
        """Return the Schur complement (b, b) of the matrix with these values.

        Only its upper triangle is defined.
        """
        size = self._size
        self._upper.data = data
        self._couple = sparse.csr_array(self._upper[:size, size:])
        if self._solver is not None:
            self._solver.factorise(sparse.csr_array(self._upper[:size, :size]).data)
        schur = self._upper[size:, size:].toarray()
        schur += np.triu(schur, 1).T
        for first in range(0, schur.shape[1], _COLUMNS):
            some = slice(first, first + _COLUMNS)
            schur[:, some] -= self._couple.T @ self._solved(self._couple[:, some].toarray())
        return schur

    def forward(self, right: Array) -> Array:
        """Return a right-hand side (k + b, ...) after the elimination."""
        inner = self._solved(right[: self._size])
        return np.concatenate([inner, right[self._size :] - self._couple.T @ inner])

    def backward(self, half: Array, kept: Array) -> Array:
        """Return the solution (k + b, ...) after `forward`, given the last unknowns (b, ...)."""
        return np.concatenate([half[: self._size] - self._solved(self._couple @ kept), kept])

    def _solved(self, right: Array) -> Array:
        return right if self._solver is None or not right.any() else self._solver.solve(right)


class Elimination:
    """Elimination of the first k unknowns of symmetric matrices of one pattern.

    Parameters
    ----------
    upper : upper triangle (k + b, k + b) in CSR, columns increasing, diagonal present; positive
        definite on the first k unknowns
    size : k
    """

    def __init__(self, upper: sparse.csr_array, size: int, linear_solver: str = "auto") -> None:
        self._upper, self._size = upper.copy(), size
        ends = upper.shape[0]
        self._diagonal = upper.indptr[size:-1]  # the first entries of the last rows
        self._method: Pardiso | _ByColumns
        if linear.chosen(linear_solver) == "pardiso" and 0 < size < ends:
            self._method = Pardiso(upper, np.arange(size, ends))
        else:
            self._method = _ByColumns(upper, size, linear_solver)

    def taken(self, data: Array) -> Array:
        """Eliminate with these values, and return ``K_bi K_ii^-1 K_ib`` (b, b)."""
        # twice the diagonal of the last unknowns makes the matrix of a free body positive definite
        self._upper.data = data.copy()
        self._upper.data[self._diagonal] *= 2
        schur = np.triu(self._method.eliminate(self._upper.data))
        taken = self._upper[self._size :, self._size :].toarray() - schur
        return taken + np.triu(taken, 1).T

    def forward(self, right: Array) -> Array:
        """Return a right-hand side (k + b, ...) after the elimination by `taken`."""
        return self._method.forward(right)

    def backward(self, half: Array, kept: Array) -> Array:
        """Return the solution (k + b, ...) after `forward`, given the last unknowns (b, ...)."""
        return self._method.backward(half, kept)


class SchurComplement:
    """A matrix (n, n) reduced to the kept unknowns; those neither kept nor inside are zero.

    Parameters
    ----------
    matrix : symmetric (n, n), positive definite on the inner unknowns
    kept, inside : (m,), (k,) kept and inner unknowns, increasing

    Attributes
    ----------
    boundary : (b,) positions, among the kept unknowns, of those coupled to inner ones
    taken : (b, b) block K_ki K_ii^-1 K_ik on the boundary, subtracted from K_kk
    """

    def __init__(
        self, matrix: sparse.csr_array, kept: Ints, inside: Ints, linear_solver: str = "auto"
    ) -> None:
        self.kept, self.inside = kept, inside
        self.boundary = np.unique(sparse.csr_array(matrix[inside][:, kept]).indices)
        order = np.concatenate([inside, kept[self.boundary]])
        upper = sparse.csr_array(sparse.triu(matrix[order][:, order], format="csr"))
        upper.sort_indices()
        self._elimination = Elimination(upper, len(inside), linear_solver)
        self.taken = self._elimination.taken(upper.data)

    def begin(self, force: Array) -> Eliminated:
        """Eliminate the inner unknowns of a right-hand side (n,) or (n, k)."""
        condensed, inner = np.asarray(force[self.kept]), force[self.inside]
        rest = np.zeros((len(self.boundary), *inner.shape[1:]))
        right = np.asfortranarray(np.concatenate([inner, rest]))
        half = self._elimination.forward(right) if inner.any() else right
        condensed[self.boundary] += half[len(inner) :]

        def finish(kept: Array) -> Array:
            u = np.zeros_like(force)
            u[self.kept] = kept
            u[self.inside] = self._elimination.backward(half, kept[self.boundary])[: len(inner)]
            return u

        return Eliminated(condensed, finish)


def with_block(
    row: Ints, column: Ints, block: Ints, size: int
) -> tuple[sparse.csr_array, Ints, Ints]:
    """Return the pattern of a sparse matrix with a dense block on some unknowns, values zero.

    Parameters
    ----------
    row, column : (n,) entries of the upper triangle (size, size)
    block : (b,) increasing, unknowns of the block

    Returns
    -------
    The upper triangle; the positions in its values of the entries (n,); and those of the upper
    triangle of the block, in the order of `numpy.triu_indices`.
    """
    first, second = np.triu_indices(len(block))
    rows = np.concatenate([row, block[first]])
    keys, slot = np.unique(
        rows * size + np.concatenate([column, block[second]]), return_inverse=True
    )
    indptr = np.searchsorted(keys, np.arange(size + 1) * size)
    pattern = sparse.csr_array((np.zeros(len(keys)), keys % size, indptr), shape=(size, size))
    return pattern, slot[: len(row)], slot[len(row) :]
