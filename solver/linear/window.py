"""A symmetric system that changes only in a window; the rest is eliminated once.

With w the unknowns of the window and o the others, every matrix is

    [K_oo  K_ow]
    [K_wo  K_ww]        K_oo and K_ow constant

so ``- K_wo K_oo^-1 K_ow``, a dense block on the boundary of the window, is computed once and
added to each ``K_ww``. A factorisation then costs as much as that of the window alone. A solve
eliminates the right-hand side forward into the window, and substitutes backward out of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from solver.linear import solvers as linear
from solver.linear.pardiso import Pardiso

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Numbers = NDArray[np.int64]
    Vector = NDArray[np.float64]


class Windowed:
    """A `LinearSolver` for matrices that are the same outside a window; needs PARDISO.

    Parameters
    ----------
    upper : upper triangle (n, n) of one such matrix, positive definite outside the window
    window : (n,) whether an unknown is in the window
    kept : (m,) increasing, unknowns of the window for which compliances will be needed
    """

    def __init__(self, upper: sparse.csr_array, window: NDArray[np.bool_], kept: Numbers) -> None:
        row, column = upper.tocoo().coords
        crossing = window[row] != window[column]
        met = np.unique(np.concatenate([row[crossing], column[crossing]]))
        boundary = met[window[met]]
        self._n = len(window)
        self._within = np.flatnonzero(window)
        self._around = np.union1d(np.flatnonzero(~window), boundary)
        self._on_boundary = np.searchsorted(self._around, boundary)
        self._in_window = np.searchsorted(self._within, boundary)

        around = sparse.csr_array(upper[self._around][:, self._around])
        around.sort_indices()
        self._outer = Pardiso(around, self._on_boundary)
        own = around[self._on_boundary][:, self._on_boundary].toarray()
        block = np.triu(self._outer.eliminate(around.data)) - own

        inside = window[row] & window[column]
        place = np.full(self._n, -1)
        place[self._within] = np.arange(len(self._within))
        first, second = np.triu_indices(len(boundary))
        rows = np.concatenate([place[row[inside]], self._in_window[first]])
        columns = np.concatenate([place[column[inside]], self._in_window[second]])
        size = len(self._within)
        keys, slot = np.unique(rows * size + columns, return_inverse=True)
        indptr = np.searchsorted(keys, np.arange(size + 1) * size)
        self._entries = np.flatnonzero(inside)
        self._slot, dense = np.split(slot, [len(self._entries)])
        self._constant = np.zeros(len(keys))
        self._constant[dense] = block[first, second]
        inner = sparse.csr_array((self._constant, keys % size, indptr), shape=(size, size))
        self._inner = linear.analyse(inner, "pardiso", place[kept])

    def factorise(self, data: Vector) -> None:
        """Factorise the upper triangle (n, n) with these values; raise `Singular` if that fails."""
        inner = self._constant.copy()
        inner[self._slot] += data[self._entries]
        self._inner.factorise(inner)

    def solve(self, b: Vector) -> Vector:
        """Return the solution for ``b`` (n,)."""
        begun = self.begin(b)
        return begun.finish(np.zeros_like(begun.kept))

    def begin(self, b: Vector) -> linear.Begun:
        """Begin the solution for ``b`` (n,): compute its kept unknowns only."""
        right = b[self._around]
        right[self._on_boundary] = 0.0
        half = self._outer.forward(right)
        within = b[self._within]
        within[self._in_window] += half[self._on_boundary]
        begun = self._inner.begin(within)

        def finish(change: Vector) -> Vector:
            u = begun.finish(change)
            x = np.zeros(self._n)
            x[self._around] = self._outer.backward(half, u[self._in_window])
            x[self._within] = u
            return x

        return linear.Begun(begun.kept, finish)

    def compliance(self, rows: Vector) -> Vector:
        """Return ``rows A^-1 rows'`` for ``rows`` (k, m) on the m unknowns kept."""
        return self._inner.compliance(rows)
