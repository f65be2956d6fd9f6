"""The nodes of a body, its quadrature, and the periodic copies of nodes."""

from __future__ import annotations

import numpy as np
from skfem import CellBasis

from solver.errors import ModelError
from solver.fem.dofs import Dofs
from solver.mesh.elements import element_type
from solver.mesh.rounding import ROUNDED
from solver.model.body import Body
from solver.typing import Array, Ints


class Nodes:
    """The nodes, the unknowns and the integration points of one body.

    Unknowns are numbered node by node (`Dofs`), points element by element. Nodes on the far side of
    a periodic body repeat those on the near side: their unknowns are copies.

    Attributes
    ----------
    basis : elements and quadrature in scikit-fem
    X : (dim, n_nodes) node positions [mm]
    dim : number of axes
    n : number of unknowns
    same : (n_nodes,) for each node, the node whose unknowns it uses: itself, unless it is a copy
    copied : (n,) for each unknown, the unknown whose value it takes
    period : period of a periodic body, else 0 [mm]
    points : (dim, n_elements, n_points) positions of the points [mm]
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
        self.same, self.period = self._copies()
        self.copied = Dofs(self.same, self.dim).every
        self.points = np.asarray(self.basis.global_coordinates())

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

    def _copies(self) -> tuple[Ints, float]:
        """Return the node whose unknowns each node uses, and the period."""
        same = np.arange(self.X.shape[1])
        if self.body.periodic is None:
            return same, 0.0
        near, far = (self.boundary_nodes(name) for name in self.body.periodic)
        near, far = (nodes[np.argsort(self.X[1, nodes])] for nodes in (near, far))
        apart = self.X[:, far] - self.X[:, near] if len(far) == len(near) else np.ones((2, 1))
        period = float(apart[0].mean())
        if not (np.abs(apart - [[period], [0.0]]) < ROUNDED * abs(period)).all() or period <= 0:
            allowed = "the second must be a copy of the first, one period along +x"
            raise ModelError("periodic", self.body.periodic, allowed)
        travelling = self.body.travelling
        if travelling is not None and 2 * travelling.half_width > period:
            allowed = f"half_width must be at most half the period, {period / 2:g} mm"
            raise ModelError("travelling", travelling.half_width, allowed)
        same[far] = near
        return same, period
