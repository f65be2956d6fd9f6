"""The inverse stiffness of the parts of a model: factors, compliances, blended tangents."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from solver.linear import solvers as linear

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy import sparse

    from solver.materials.state import Response


class Operator(Protocol):
    """The inverse of a part's stiffness, its pins held."""

    def solve(self, force: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return displacements (n,) for nodal forces (n,)."""

    def compliance(self, dofs: NDArray[np.int64], rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return ``rows K^-1 rows'`` for rows (m, len(dofs)) on unknowns of contact surfaces."""


class Stiff(Protocol):
    """A part whose stiffness is assembled.

    The unknowns ``active`` of all ``n`` are solved for; ``copied`` (n,) gives for each unknown the
    one whose value it takes; ``pattern`` is the upper triangle on the active ones.
    """

    n: int
    active: NDArray[np.int64]
    copied: NDArray[np.int64]

    @property
    def pattern(self) -> sparse.csr_array:
        """Upper triangle of the stiffness on the active unknowns, values not set."""

    @property
    def elastic_data(self) -> NDArray[np.float64]:
        """Values of the elastic stiffness on ``pattern``."""

    def tangent_data(self, response: Response) -> NDArray[np.float64]:
        """Return the values of the tangent on ``pattern``."""


class Analysed:
    """The stiffness pattern of a part, and its unknowns on contact surfaces.

    Attributes
    ----------
    part : the body
    kept : (n,) position of each unknown among those kept, -1 for the others
    solver : of the active unknowns
    """

    def __init__(self, part: Stiff, contact: NDArray[np.int64], name: str) -> None:
        self.part = part
        kept = np.isin(part.active, contact)
        self.kept = np.full(part.n, -1)
        self.kept[part.active[kept]] = np.arange(kept.sum())
        self.solver = linear.analyse(part.pattern, name, np.flatnonzero(kept))


class Factored:
    """A factorised tangent."""

    def __init__(self, analysed: Analysed, data: NDArray[np.float64]) -> None:
        self._analysed = analysed
        analysed.solver.factorise(data)

    def solve(self, force: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `Operator`."""
        part = self._analysed.part
        u = np.zeros(part.n)
        u[part.active] = self._analysed.solver.solve(force[part.active])
        return u[part.copied]

    def compliance(self, dofs: NDArray[np.int64], rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `Operator`."""
        place = self._analysed.kept[dofs]
        if (place < 0).all():  # supports hold the surface
            return np.zeros((len(rows), len(rows)))
        block = np.zeros((len(rows), self._analysed.kept.max() + 1))
        block[:, place[place >= 0]] = rows[:, place >= 0]
        return self._analysed.solver.compliance(block)


class PartOperators(Protocol):
    """The operators of a part."""

    @property
    def elastic(self) -> Operator:
        """The elastic one."""

    def tangent(self, response: Response, blend: float) -> Operator:
        """Return that of ``(1 - blend) tangent + blend elastic stiffness``."""


class Operators:
    """The operators of one part; the elastic one is factorised once and kept.

    Parameters
    ----------
    contact : unknowns of its contact surfaces
    """

    def __init__(self, part: Stiff, contact: NDArray[np.int64], linear_solver: str) -> None:
        self._part = part
        self._contact = contact
        self._name = linear_solver

    @cached_property
    def elastic(self) -> Operator:
        """The elastic operator."""
        return Factored(Analysed(self._part, self._contact, self._name), self._part.elastic_data)

    @cached_property
    def _analysed(self) -> Analysed:
        return Analysed(self._part, self._contact, self._name)

    def tangent(self, response: Response, blend: float) -> Operator:
        """Return the operator of ``(1 - blend) tangent + blend elastic stiffness``."""
        if blend >= 1 or not response.yielding.any():
            return self.elastic
        data = self._part.tangent_data(response)
        if blend:
            data = (1 - blend) * data + blend * self._part.elastic_data
        return Factored(self._analysed, data)


class Dense:
    """The inverse of a small dense stiffness on the unknowns ``active`` of ``n``."""

    def __init__(self, stiffness: NDArray[np.float64], active: NDArray[np.int64], n: int) -> None:
        inverse = cho_solve(cho_factor(stiffness), np.eye(len(stiffness)))
        self._inverse = np.zeros((n, n))
        self._inverse[np.ix_(active, active)] = 0.5 * (inverse + inverse.T)

    def solve(self, force: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `Operator`."""
        return np.asarray(self._inverse @ force)

    def compliance(self, dofs: NDArray[np.int64], rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `Operator`."""
        return np.asarray(rows @ self._inverse[np.ix_(dofs, dofs)] @ rows.T)


class Fixed:
    """The operators of a part whose stiffness never changes."""

    def __init__(self, operator: Operator) -> None:
        self.elastic = operator

    def tangent(self, response: Response, blend: float) -> Operator:
        """Return the elastic operator."""
        del response, blend
        return self.elastic
