"""The nodes of a body, the numbers of their unknowns, and its quadrature."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from skfem import CellBasis

from solver.mesh.elements import element_type
from solver.model.body import Body
from solver.typing import Array, Ints


class Nodes:
    """The nodes, the unknowns and the integration points of one body.

    Unknowns are numbered node by node (`Dofs`), points element by element.

    Attributes
    ----------
    basis : elements and quadrature in scikit-fem
    X : (dim, n_nodes) node positions [mm]
    dim : number of axes
    n : number of unknowns
    points : (dim, n_elements, n_points) positions of the points [mm]
    weights : (n_elements, n_points) volume of the points, with thickness or 2 pi r [mm3]
    """

    def __init__(self, body: Body) -> None:
        self.body = body
        kind = element_type(body.element)
        self.basis = CellBasis(
            body.mesh,
            kind.element,
            intorder=kind.full_order if body.full_integration else kind.order,
        )
        self.X = self.basis.doflocs
        self.dim, self.n = len(self.X), self.X.size
        self.points = np.asarray(self.basis.global_coordinates())
        self.weights = np.asarray(self.basis.dx * self.measure(self.points))

    @property
    def components(self) -> int:
        """Number of components of stress and strain: 4 in the plane, 6 in space."""
        return 2 * self.dim

    @property
    def positions(self) -> Array:
        """Positions of the points (dim, n_points) [mm]."""
        return self.points.reshape(self.dim, -1)

    def measure(self, x: Array) -> Array | float:
        """Return the depth across the plane at positions x [mm]: thickness or 2 pi r."""
        if self.body.kinematics == "axisymmetric":
            return np.asarray(2 * np.pi * x[0])
        return self.body.thickness

    def boundary_nodes(self, boundary: str) -> Ints:
        """Return the nodes on a named boundary."""
        return np.unique(self.basis.get_dofs(self.body.facets(boundary)).flatten())


Kind = TypeVar("Kind", bound=np.generic)


class Dofs(NamedTuple):
    """The unknowns of nodes (..., n) in a space of ``dim`` axes."""

    nodes: Ints
    dim: int

    def along(self, axis: int) -> Ints:
        """Return the unknown (..., n) of each node along an axis."""
        return self.dim * self.nodes + axis

    @property
    def every(self) -> Ints:
        """All unknowns (..., dim n), node by node."""
        each = np.stack([self.along(axis) for axis in range(self.dim)], axis=-1)
        return each.reshape(*self.nodes.shape[:-1], -1)


def vectors(values: NDArray[Kind], dim: int) -> NDArray[Kind]:
    """Return the vectors (dim, n) at nodes whose unknowns have values (dim n,)."""
    return values.reshape(-1, dim).T
