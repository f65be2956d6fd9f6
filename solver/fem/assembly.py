"""Assembly of element matrices: the sparsity pattern once, the values each time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Assembly:
    """The upper triangle of a symmetric matrix on the active unknowns of elements.

    Parameters
    ----------
    dofs : (n_elements, m) unknowns of each element
    active : unknowns that are rows of the matrix, out of all ``n``

    Attributes
    ----------
    pattern : the matrix, values not set
    """

    def __init__(self, dofs: NDArray[np.int64], active: NDArray[np.int64], n: int) -> None:
        number = np.full(n, -1)
        number[active] = np.arange(len(active))
        local = number[dofs]
        rows = np.broadcast_to(local[:, :, None], (*local.shape, local.shape[1])).ravel()
        columns = np.broadcast_to(local[:, None, :], (*local.shape, local.shape[1])).ravel()
        kept = (rows >= 0) & (columns >= rows)
        key = rows.astype(np.int64) * len(active) + columns
        unique, slot = np.unique(key[kept], return_inverse=True)
        m = len(active)
        indptr = np.searchsorted(unique, np.arange(m + 1, dtype=np.int64) * m)
        self.pattern = sparse.csr_array((np.zeros(len(unique)), unique % m, indptr), shape=(m, m))
        place = np.full(len(key), len(unique))
        place[kept] = slot
        self._place = place.reshape(len(local), -1)

    def values(
        self, elements: NDArray[np.int64] | slice, matrices: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the values on `pattern` of the sum of some elements' matrices."""
        size = self.pattern.nnz + 1
        place = self._place[elements].ravel()
        data = np.bincount(place, weights=matrices.ravel(), minlength=size)
        return np.asarray(data[:-1], dtype=float)


def whole_matrix(
    dofs: NDArray[np.int64], matrices: NDArray[np.float64], n: int
) -> sparse.csr_array:
    """Return the matrix (n, n) of all elements on all unknowns."""
    rows = np.broadcast_to(dofs[:, :, None], matrices.shape)
    columns = np.broadcast_to(dofs[:, None, :], matrices.shape)
    return sparse.csr_array((matrices.ravel(), (rows.ravel(), columns.ravel())), shape=(n, n))
