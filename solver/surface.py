"""The contact surface of a body: an ordered chain of edges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from skfem import FacetBasis

from solver.errors import ModelError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.discretisation import Discretisation


def shape_functions(xi: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return edge shape functions (..., count) at ``xi`` in [-1, 1]: both ends, then the middle."""
    if count == 2:
        return np.stack([(1 - xi) / 2, (1 + xi) / 2], axis=-1)
    return np.stack([xi * (xi - 1) / 2, xi * (xi + 1) / 2, 1 - xi**2], axis=-1)


def shape_derivatives(xi: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return the derivatives of `shape_functions` with respect to ``xi``."""
    if count == 2:
        half = np.full_like(xi, 0.5)
        return np.stack([-half, half], axis=-1)
    return np.stack([xi - 0.5, xi + 0.5, -2 * xi], axis=-1)


@dataclass(frozen=True, slots=True)
class Surface:
    """A chain of edges with the body on its left: the outward normal is ``(t_y, -t_x)``.

    Attributes
    ----------
    nodes : (n_nodes,) node numbers in the body
    edges : (n_edges, 2 or 3) positions in ``nodes``: start, end (, middle)
    X : (2, n_nodes) reference positions [mm]
    measure : (n_nodes,) thickness, or 2 pi r, at the nodes [mm]
    """

    nodes: NDArray[np.int64]
    edges: NDArray[np.int64]
    X: NDArray[np.float64]
    measure: NDArray[np.float64]

    @property
    def vertices(self) -> NDArray[np.int64]:
        """(n_edges + 1,) positions in ``nodes`` of the edge ends, along the chain."""
        return np.append(self.edges[:, 0], self.edges[-1, 1])

    @property
    def dofs(self) -> NDArray[np.int64]:
        """(2 n_nodes,) unknowns of the body, node by node."""
        return np.stack([2 * self.nodes, 2 * self.nodes + 1], axis=1).ravel()


def extract(part: Discretisation, boundary: str) -> Surface:
    """Return the surface of a named boundary, which must be one open chain."""
    body = part.body
    facets = body.facets(boundary)
    basis = FacetBasis(body.mesh, part.basis.elem, facets=facets, intorder=1)
    ends = part.basis.nodal_dofs[0][body.mesh.facets[:, facets]].T
    tangent = np.stack([-basis.normals[1, :, 0], basis.normals[0, :, 0]])
    reverse = ((part.X[:, ends[:, 1]] - part.X[:, ends[:, 0]]) * tangent).sum(axis=0) < 0
    ends[reverse] = ends[reverse, ::-1]

    following = {int(start): i for i, start in enumerate(ends[:, 0])}
    heads = set(ends[:, 0].tolist()) - set(ends[:, 1].tolist())
    order = []
    at = heads.pop() if len(heads) == 1 else -1
    while at in following:
        order.append(following.pop(at))
        at = int(ends[order[-1], 1])
    if len(order) != len(facets):
        raise ModelError("boundary", boundary, "a contact surface must be one open chain of edges")
    columns = [ends[order]]
    if part.basis.facet_dofs.size:
        columns.append(part.basis.facet_dofs[0][facets[order]][:, None])
    edges = np.hstack(columns)
    nodes, local = np.unique(edges, return_inverse=True)
    X = part.X[:, nodes]
    measure = (
        2 * np.pi * X[0] if body.state == "axisymmetric" else np.full(len(nodes), body.thickness)
    )
    return Surface(nodes, local.reshape(edges.shape), X, measure)
