"""An elastic body reduced to its contact surfaces and its rigid motion, exactly.

Its stiffness is the Schur complement S on the unknowns of these surfaces. Supports of kept nodes
remain supports, and rigid motions remain rigid motions (``S R = 0``): a body held by contact alone
needs no special treatment.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy import sparse

from solver.fem.deformation import PartResponse
from solver.fem.discretisation import Discretisation, choose_pins
from solver.fem.loads import Superposed
from solver.fem.nodes import Dofs
from solver.fem.part import Part
from solver.fem.surface import Surface
from solver.linear.schur import Eliminated, SchurComplement
from solver.memory import digest_of, remembered
from solver.typing import Array, Ints


class _CondensedBody:
    """The condensation of one body to some of its unknowns."""

    def __init__(self, part: Discretisation, kept: Ints, linear_solver: str) -> None:
        K = part.elastic_matrix()
        inside = np.setdiff1d(part.free, kept)
        self._schur = SchurComplement(K, kept, inside, linear_solver)
        self._loads = part.condensable.fields
        self.forces = self._schur.begin(self._loads).condensed
        at = self._schur.boundary
        stiffness = K[kept][:, kept].toarray()
        stiffness[np.ix_(at, at)] -= self._schur.taken
        self.stiffness = _without_motions(stiffness, part.rigid[kept])

    def close_to(
        self, other: _CondensedBody, change: sparse.csr_array, rigid: Array
    ) -> _CondensedBody:
        """Return the body with its stiffness as that of an almost equal body and a small change.

        With the displacements u of the other body for those of the kept nodes, the change of its
        condensed stiffness is ``u' change u``, up to the second order, for the ``change`` (n, n) of
        the whole stiffness. Two eliminations would differ by more, their rounding errors.
        """
        size = len(self.stiffness)
        moved = other.begin(np.zeros((change.shape[0], size))).finish(np.eye(size))
        close = copy(self)
        stiffness = other.stiffness + moved.T @ (change @ moved)
        close.stiffness = _without_motions(stiffness, rigid)
        return close

    def begin(self, force: Array) -> Eliminated:
        """Eliminate the inner unknowns of forces (n,)."""
        return self._schur.begin(force)

    def expand(self, u: Array, factors: Array) -> Array:
        """Return all displacements (n,) for the kept ones and the factors of the loads."""
        return self.begin(self._loads @ factors).finish(u)


def _without_motions(S: Array, rigid: Array) -> Array:
    """Return a symmetric stiffness projected so that rigid motions (n, n_rigid) cause no force.

    Rounding in the elimination causes a small force, in proportion to the largest entries of the
    whole stiffness. Nothing would balance it: only contact forces act on rigid motions.
    """
    S = 0.5 * (S + S.T)
    Q = np.linalg.qr(rigid)[0]
    S = S - Q @ (Q.T @ S)
    return np.asarray(S - (S @ Q) @ Q.T)


class Substructure(Part):
    """A part with the unknowns of its contact surfaces only.

    ``whole`` is the meshed body, ``elastic`` are the unknowns on which the condensed stiffness
    acts. The body is condensed when its stiffness is first needed; a check of the model, or a count
    of its unknowns, does not need it.
    """

    def __init__(self, whole: Discretisation, surfaces: list[Surface], linear_solver: str) -> None:
        self.whole = whole
        self.body = whole.body
        self._linear_solver = linear_solver
        self._nodes = nodes = np.unique(np.concatenate([surface.nodes for surface in surfaces]))
        self._kept = kept = Dofs(nodes, whole.dim).every
        self.elastic = slice(len(kept))
        self.n = len(kept)
        self.nodes = whole.X[:, nodes]
        self.rigid = whole.rigid[kept]
        self.free = np.flatnonzero(np.isin(kept, whole.free))
        self.active = choose_pins(self.rigid, self.free)

    @cached_property
    def _condensed(self) -> _CondensedBody:
        return _condense(self.whole, self._kept, self._linear_solver)

    def follow(self, other: Substructure) -> None:
        """Take the condensed stiffness from an almost equal part: see `_CondensedBody.close_to`."""
        change = self.whole.elastic_matrix() - other.whole.elastic_matrix()
        if abs(change).max() > 0:
            self._condensed = self._condensed.close_to(other._condensed, change, self.rigid)

    @cached_property
    def loads(self) -> Superposed:
        """Nodal forces of the body's loads, condensed to the kept nodes [N]."""
        return Superposed(self.whole.condensable.cases, self._condensed.forces)

    def surface(self, surface: Surface) -> Surface:
        """Return a surface of the whole body in this part's numbering."""
        nodes = np.searchsorted(self._nodes, surface.nodes)
        return replace(surface, nodes=nodes)

    def residual(self, time: float, u: Array, response: PartResponse) -> Array:
        """Return external minus internal forces (n,) [N]."""
        force = self.external(time)
        force[self.elastic] -= self._condensed.stiffness @ u[self.elastic]
        return force

    def elastic_matrix(self) -> sparse.csr_array:
        """Return the condensed stiffness on all unknowns (n, n), supports not applied."""
        rest = np.zeros((self.n - len(self._kept),) * 2)
        return sparse.csr_array(sparse.block_diag([self._condensed.stiffness, rest]))

    def elastic_along(self, step: Array) -> float:
        """Return ``step' K step`` with the elastic stiffness [N mm]."""
        return float(step[self.elastic] @ self._condensed.stiffness @ step[self.elastic])

    def on_whole(self, force: Array) -> Array:
        """Return the nodal forces (n,) of the whole body for those of this part [N]."""
        whole = np.zeros(self.whole.n)
        whole[self._kept] = force[self.elastic]
        return whole

    def begin(self, force: Array) -> Eliminated:
        """Return nodal forces of the whole body on the unknowns of this part.

        ``finish`` returns the displacements of the whole body for those of this part.
        """
        own, begun = np.zeros(self.n), self._condensed.begin(force)
        own[self.elastic] = begun.condensed
        return Eliminated(own, lambda u: begun.finish(u[self.elastic]))

    def expand(self, u: Array, time: float) -> Array:
        """Return the whole body's displacements [mm]; those of a wheel in its hub's frame."""
        factors = self.loads.factors(time)
        return self._condensed.expand(u[self.elastic], factors)


def _key(part: Discretisation, kept: Ints, linear_solver: str) -> str:
    """Return a key of the content: equal bodies share their condensation."""
    body = part.body
    elastic = body.law.stiffness(part.components)
    arrays = digest_of(body.mesh.doflocs, body.mesh.t, kept, elastic, part.condensable.fields)
    return arrays + repr((
        linear_solver, body.kinematics, body.element, body.full_integration, body.thickness,
        sorted((name, held, digest_of(body.facets(name))) for name, held in body.supports.items()),
    ))  # fmt: skip


def _condense(part: Discretisation, kept: Ints, linear_solver: str) -> _CondensedBody:
    key = _key(part, kept, linear_solver)
    return remembered(key, lambda: _CondensedBody(part, kept, linear_solver))
