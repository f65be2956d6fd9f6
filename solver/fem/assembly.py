"""Assembly of element matrices: the sparsity pattern is computed once, the values many times."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from solver.typing import Array, Ints


class Assembly:
    """The upper triangle of a symmetric matrix on the active unknowns of elements.

    Parameters
    ----------
    dofs : (n_elements, m) unknowns of each element
    active : unknowns that are rows of the matrix
    n : number of all unknowns
    block : (b,) unknowns that a dense matrix couples too; by default none

    Attributes
    ----------
    pattern : the matrix, values not set
    """

    def __init__(
        self,
        dofs: Ints,
        active: Ints,
        n: int,
        block: Ints | None = None,
    ) -> None:
        number = np.full(n, -1)
        number[active] = np.arange(len(active))
        pairs = [_pairs(number[dofs])]
        if block is not None:
            pairs.append(_pairs(number[block][None]))
        rows, columns = np.concatenate(pairs, axis=1)
        kept = (rows >= 0) & (columns >= rows)
        key = rows.astype(np.int64) * len(active) + columns
        unique, slot = np.unique(key[kept], return_inverse=True)
        m = len(active)
        indptr = np.searchsorted(unique, np.arange(m + 1, dtype=np.int64) * m)
        self.pattern = sparse.csr_array((np.zeros(len(unique)), unique % m, indptr), shape=(m, m))
        place = np.full(len(key), len(unique))
        place[kept] = slot
        at, self._block_place = np.split(place, [pairs[0].shape[1]])
        self._place = at.reshape(len(dofs), -1)

    def values(self, elements: Ints | slice, matrices: Array) -> Array:
        """Return the values on `pattern` of the sum of the matrices of some elements."""
        return self._summed(self._place[elements], matrices)

    def block_values(self, matrix: Array) -> Array:
        """Return the values on `pattern` of a dense matrix (b, b) on the block."""
        return self._summed(self._block_place, matrix)

    def _summed(self, place: Ints, matrices: Array) -> Array:
        size = self.pattern.nnz + 1
        data = np.bincount(place.ravel(), weights=matrices.ravel(), minlength=size)
        return np.asarray(data[:-1], dtype=float)


def _pairs(local: Ints) -> Ints:
    """Return row and column (2, n) of each entry of matrices on unknowns (n_matrices, m)."""
    n, m = local.shape
    rows = np.broadcast_to(local[:, :, None], (n, m, m))
    columns = np.broadcast_to(local[:, None, :], (n, m, m))
    return np.stack([rows.ravel(), columns.ravel()])


def whole_matrix(dofs: Ints, matrices: Array, n: int) -> sparse.csr_array:
    """Return the matrix (n, n) of all elements on all unknowns."""
    at = dofs.astype(np.int32)  # SciPy keeps the index type, also in submatrices
    rows = np.broadcast_to(at[:, :, None], matrices.shape)
    columns = np.broadcast_to(at[:, None, :], matrices.shape)
    return sparse.csr_array((matrices.ravel(), (rows.ravel(), columns.ravel())), shape=(n, n))
