"""Inverse stiffness of the parts: factors, compliances, blended tangents."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from solver.fem.deformation import PartResponse
from solver.fem.discretisation import Discretisation
from solver.fem.part import Part
from solver.fem.surface import Surface
from solver.linear import solvers as linear
from solver.linear.solvers import Begun
from solver.typing import Array, Ints


class Operator(Protocol):
    """The inverse of a part's stiffness, with its pins held."""

    def begin(self, force: Array) -> Begun:
        """Return the displacements for nodal forces (n,), whose contact forces may still change.

        ``kept`` and the argument of ``finish`` are (n,); only entries on contact surfaces count.
        """

    def compliance(self, dofs: Ints, rows: Array) -> Array:
        """Return ``rows K^-1 rows'`` for rows (m, len(dofs)) on unknowns of contact surfaces."""


class Analysed:
    """The analysed stiffness pattern of a part, with its unknowns on contact surfaces.

    Attributes
    ----------
    part : the body
    contact : active unknowns on its contact surfaces, the kept ones
    kept : (n,) position of each unknown among the kept ones, -1 for the others
    solver : linear solver of the active unknowns
    """

    def __init__(self, part: Discretisation, contact: Ints, name: str) -> None:
        self.part = part
        kept = np.isin(part.active, contact)
        self.contact = part.active[kept]
        self.kept = np.full(part.n, -1)
        self.kept[self.contact] = np.arange(len(self.contact))
        self.solver = linear.analyse(part.pattern, name, np.flatnonzero(kept))


class Factored:
    """A factorised tangent."""

    def __init__(self, analysed: Analysed, data: Array) -> None:
        self._analysed = analysed
        analysed.solver.factorise(data)

    def begin(self, force: Array) -> Begun:
        """See `Operator`."""
        part, contact = self._analysed.part, self._analysed.contact
        begun = self._analysed.solver.begin(force[part.active])
        motion = np.zeros(part.n)
        motion[contact] = begun.kept

        def finish(change: Array) -> Array:
            u = np.zeros(part.n)
            u[part.active] = begun.finish(change[contact])
            return u

        return Begun(motion, finish)

    def compliance(self, dofs: Ints, rows: Array) -> Array:
        """See `Operator`."""
        place = self._analysed.kept[dofs]
        if (place < 0).all():  # supports hold the surface
            return np.zeros((len(rows), len(rows)))
        block = np.zeros((len(rows), self._analysed.kept.max() + 1))
        block[:, place[place >= 0]] = rows[:, place >= 0]
        return self._analysed.solver.compliance(block)


class Operators:
    """The operators of a part whose stiffness never changes."""

    def __init__(self, elastic: Operator | None) -> None:
        self._elastic = elastic

    @cached_property
    def elastic(self) -> Operator:
        """The operator of the elastic stiffness."""
        assert self._elastic is not None
        return self._elastic

    def tangent(self, response: PartResponse, blend: float) -> Operator:
        """Return the operator of ``(1 - blend) tangent + blend elastic stiffness``."""
        return self.elastic


class Assembled(Operators):
    """The operators of a meshed part; the elastic one is factorised once and kept.

    Parameters
    ----------
    contact : unknowns of its contact surfaces
    elastic : its elastic operator, if known
    """

    def __init__(
        self,
        part: Discretisation,
        contact: Ints,
        linear_solver: str,
        elastic: Operator | None = None,
    ) -> None:
        super().__init__(elastic)
        self._part, self._contact, self._name = part, contact, linear_solver

    @cached_property
    def elastic(self) -> Operator:
        """The operator of the elastic stiffness."""
        return self._elastic or Factored(
            Analysed(self._part, self._contact, self._name), self._part.elastic_data
        )

    @cached_property
    def _analysed(self) -> Analysed:
        return Analysed(self._part, self._contact, self._name)

    def tangent(self, response: PartResponse, blend: float) -> Operator:
        """Return the operator of ``(1 - blend) tangent + blend elastic stiffness``."""
        if response.linear.all() or (blend >= 1 and response.deformation.linear.all()):
            return self.elastic
        return Factored(self._analysed, self._part.tangent_data(response, blend))


class Dense:
    """The inverse of a small dense stiffness on the unknowns ``active`` of ``n``."""

    def __init__(self, stiffness: Array, active: Ints, n: int) -> None:
        inverse = cho_solve(cho_factor(stiffness), np.eye(len(stiffness)))
        self._inverse = np.zeros((n, n))
        self._inverse[np.ix_(active, active)] = 0.5 * (inverse + inverse.T)

    def begin(self, force: Array) -> Begun:
        """See `Operator`."""
        u = self._inverse @ force
        return Begun(u, lambda change: u + self._inverse @ change)

    def compliance(self, dofs: Ints, rows: Array) -> Array:
        """See `Operator`."""
        return np.asarray(rows @ self._inverse[np.ix_(dofs, dofs)] @ rows.T)


class Restricted:
    """The operator of a body on the unknowns ``kept`` (m,) only, where all forces act.

    Parameters
    ----------
    whole : operator of the body with all ``n`` unknowns
    """

    def __init__(self, whole: Operator, kept: Ints, n: int) -> None:
        self._whole, self._kept, self._n = whole, kept, n

    def _all(self, force: Array) -> Array:
        every = np.zeros(self._n)
        every[self._kept] = force
        return every

    def begin(self, force: Array) -> Begun:
        """See `Operator`."""
        begun = self._whole.begin(self._all(force))
        return Begun(
            begun.kept[self._kept], lambda change: begun.finish(self._all(change))[self._kept]
        )

    def compliance(self, dofs: Ints, rows: Array) -> Array:
        """See `Operator`."""
        return self._whole.compliance(self._kept[dofs], rows)


def operators_of(part: Part, surfaces: Sequence[Surface], linear_solver: str) -> Operators:
    """Return the inverse stiffnesses of a part, for its contact surfaces."""
    if isinstance(part, Discretisation):
        contact = [surface.dofs for surface in surfaces]
        return Assembled(part, np.concatenate([np.zeros(0, int), *contact]), linear_solver)
    stiffness = part.elastic_matrix()[part.active][:, part.active].toarray()
    return Operators(Dense(stiffness, part.active, part.n))
