"""The elastic half-plane reduced to the nodes of its window, exactly.

Outside the window plastic strain is that of layers; the unknowns i there follow those kept k:
``K_kk u_k + K_ki u_i = f_k``, ``u_i = K_ii^-1 (f_i - K_ik u_k)``. The stiffness that is left is
sparse, apart from a dense block on the boundary of the window, and has a third of the unknowns.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from solver.linear import solvers as linear

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.fem.discretisation import Discretisation

    Array = NDArray[np.float64]


class Condensed:
    """The inverse of an elastic stiffness, for forces on some nodes and, slower, for all.

    Parameters
    ----------
    part : the body
    nodes : those kept; no support holds them

    Attributes
    ----------
    kept : (m,) unknowns of these nodes, increasing
    """

    def __init__(self, part: Discretisation, nodes: NDArray[np.int64]) -> None:
        self.kept = np.sort(np.concatenate([2 * nodes, 2 * nodes + 1]))
        self._inner = np.setdiff1d(part.free, self.kept)
        K = part.elastic_matrix()
        self._couple = sparse.csr_array(K[self._inner][:, self.kept])
        self._inside = _factor(K[self._inner][:, self._inner])
        boundary = np.unique(self._couple.indices)
        follows = self._couple.T @ self._inside.solve(self._couple[:, boundary].toarray())
        block = sparse.csr_array(follows[boundary])
        at = sparse.csr_array(
            (np.ones(len(boundary)), (boundary, np.arange(len(boundary)))),
            shape=(len(self.kept), len(boundary)),
        )
        self._window = _factor(K[self.kept][:, self.kept] - at @ block @ at.T)
        self._n = part.n

    def place(self, unknowns: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return where unknowns of the body are among those kept."""
        return np.searchsorted(self.kept, unknowns)

    def condense(self, force: Array) -> Array:
        """Return the forces (m,) or (m, k) on what is kept, equivalent to all (n,) or (n, k)."""
        inner = force[self._inner]
        if not inner.any():
            return np.asarray(force[self.kept])
        return np.asarray(force[self.kept] - self._couple.T @ self._inside.solve(inner))

    def solve(self, force: Array) -> Array:
        """Return displacements (m,) or (m, k) for condensed forces."""
        return self._window.solve(force)

    def expand(self, kept: Array, force: Array) -> Array:
        """Return all displacements (n,) from those kept (m,) and the forces on all nodes (n,)."""
        u = np.zeros(self._n)
        u[self.kept] = kept
        u[self._inner] = self._inside.solve(force[self._inner] - self._couple @ kept)
        return u


def _factor(matrix: sparse.csr_array) -> linear.LinearSolver:
    upper = sparse.csr_array(sparse.triu(matrix, format="csr"))
    upper.sort_indices()
    solver = linear.analyse(upper)
    solver.factorise(upper.data)
    return solver
