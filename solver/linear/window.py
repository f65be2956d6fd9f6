"""A symmetric system that changes only in a window; the rest is eliminated once.

With w the unknowns of the window and o the others, every matrix is

    [K_oo  K_ow]
    [K_wo  K_ww]        K_oo and K_ow constant

so ``- K_wo K_oo^-1 K_ow``, a dense block on the boundary of the window, is computed once and
added to each ``K_ww``. A factorisation then costs as much as that of the window alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from solver.linear import solvers as linear
from solver.linear.schur import SchurComplement, with_block

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Numbers = NDArray[np.int64]
    Vector = NDArray[np.float64]


class Windowed:
    """A `LinearSolver` for matrices that are the same outside a window.

    Parameters
    ----------
    upper : upper triangle (n, n) of one such matrix, positive definite outside the window
    window : (n,) whether an unknown is in the window
    kept : (m,) increasing, unknowns of the window for which compliances will be needed
    """

    def __init__(
        self,
        upper: sparse.csr_array,
        window: NDArray[np.bool_],
        kept: Numbers,
        linear_solver: str = "auto",
    ) -> None:
        within = np.flatnonzero(window)
        matrix = sparse.csr_array(upper + sparse.triu(upper, 1, format="csr").T)
        self._outside = SchurComplement(matrix, within, np.flatnonzero(~window), linear_solver)
        row, column = upper.tocoo().coords
        inside = window[row] & window[column]
        place = np.searchsorted(within, np.arange(len(window)))
        self._entries = np.flatnonzero(inside)
        boundary, taken = self._outside.boundary, self._outside.taken
        inner, self._slot, dense = with_block(
            place[row[inside]], place[column[inside]], boundary, len(within)
        )
        self._constant = inner.data
        self._constant[dense] = -taken[np.triu_indices(len(boundary))]
        self._inner = linear.analyse(inner, linear_solver, place[kept])

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
        outside = self._outside.begin(b)
        begun = self._inner.begin(outside.condensed)
        return linear.Begun(begun.kept, lambda change: outside.finish(begun.finish(change)))

    def compliance(self, rows: Vector) -> Vector:
        """Return ``rows A^-1 rows'`` for ``rows`` (k, m) on the m unknowns kept."""
        return self._inner.compliance(rows)
