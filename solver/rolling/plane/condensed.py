"""The elastic half-plane reduced to the nodes of its window, exactly.

Outside the window plastic strain depends on depth alone. The condensed stiffness is sparse except
for a dense block on the boundary of the window, and has a third of the unknowns.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from solver.fem.discretisation import Discretisation
from solver.linear import solvers as linear
from solver.linear.schur import SchurComplement
from solver.typing import Array, Ints


class CondensedTrack:
    """The inverse of an elastic stiffness, for forces on the kept nodes and, slower, on all nodes.

    Parameters
    ----------
    part : the body
    nodes : nodes that are kept; no support holds them

    Attributes
    ----------
    kept : (m,) unknowns of these nodes, increasing
    """

    def __init__(self, part: Discretisation, nodes: Ints) -> None:
        self.kept = np.sort(np.concatenate([2 * nodes, 2 * nodes + 1]))
        K = part.elastic_matrix()
        self._outside = SchurComplement(K, self.kept, np.setdiff1d(part.free, self.kept))
        at = self._outside.boundary
        pairs = np.repeat(at, len(at)), np.tile(at, len(at))
        taken = sparse.csr_array((self._outside.taken.ravel(), pairs), shape=(len(self.kept),) * 2)
        upper = sparse.csr_array(sparse.triu(K[self.kept][:, self.kept] - taken, format="csr"))
        upper.sort_indices()
        self._window = linear.analyse(upper, coupled=True)
        self._window.factorise(upper.data)

    def place(self, unknowns: Ints) -> Ints:
        """Return the positions of unknowns of the body among the kept ones."""
        return np.searchsorted(self.kept, unknowns)

    def condense(self, force: Array) -> Array:
        """Return condensed forces (m, ...), equivalent to forces on all nodes (n, ...) [N]."""
        return self._outside.begin(force).condensed

    def solve(self, force: Array) -> Array:
        """Return displacements (m,) or (m, k) for condensed forces."""
        return self._window.solve(force)

    def expand(self, kept: Array, force: Array) -> Array:
        """Return all displacements (n,) from the kept ones (m,) and the forces (n,)."""
        return self._outside.begin(force).finish(kept)
