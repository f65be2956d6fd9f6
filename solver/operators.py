"""How the parts of a model answer to forces: factors, compliances, blending of tangents."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from solver import linear

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.constitutive import Response
    from solver.discretisation import Discretisation


class Operator(Protocol):
    """The inverse of a part's stiffness, its pins held."""

    def solve(self, force: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return displacements (n,) for nodal forces (n,)."""

    def compliance(self, dofs: NDArray[np.int64], rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return ``rows K^-1 rows'`` for rows (m, len(dofs)) on the unknowns ``dofs``."""


class Factored:
    """A factorised tangent."""

    def __init__(self, part: Discretisation, solver: linear.LinearSolver) -> None:
        self._part = part
        self._solver = solver

    def solve(self, force: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `Operator`."""
        u = np.zeros(self._part.n)
        u[self._part.active] = self._solver.solve(force[self._part.active])
        return u

    def compliance(self, dofs: NDArray[np.int64], rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `Operator`."""
        columns = np.zeros((self._part.n, len(rows)))
        columns[dofs] = rows.T
        return self._solver.compliance(columns[self._part.active])


class Elastic(Factored):
    """The elastic stiffness: factorised once, and condensed once to each surface."""

    def __init__(self, part: Discretisation, solver: linear.LinearSolver) -> None:
        super().__init__(part, solver)
        solver.factorise(part.elastic_data)
        self._surfaces: dict[bytes, NDArray[np.float64]] = {}

    def compliance(self, dofs: NDArray[np.int64], rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `Operator`."""
        key = dofs.tobytes()
        if key not in self._surfaces:
            self._surfaces[key] = super().compliance(dofs, np.eye(len(dofs)))
        return np.asarray(rows @ self._surfaces[key] @ rows.T)


class Operators:
    """The operators of one part; elastic ones are made once and kept."""

    def __init__(self, part: Discretisation, linear_solver: str) -> None:
        self._part = part
        self._name = linear_solver

    @cached_property
    def elastic(self) -> Elastic:
        """The elastic operator."""
        return Elastic(self._part, linear.analyse(self._part.pattern, self._name))

    @cached_property
    def _solver(self) -> linear.LinearSolver:
        return linear.analyse(self._part.pattern, self._name)

    def tangent(self, response: Response, blend: float) -> Operator:
        """Return the operator of ``(1 - blend) tangent + blend elastic stiffness``."""
        if blend >= 1 or not response.yielding.any():
            return self.elastic
        data = self._part.tangent_data(response)
        if blend:
            data = (1 - blend) * data + blend * self._part.elastic_data
        self._solver.factorise(data)
        return Factored(self._part, self._solver)


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
        """Return the one operator."""
        del response, blend
        return self.elastic
