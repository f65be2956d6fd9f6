"""The contact surface of a body: an ordered chain of edges."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from solver.errors import ModelError
from solver.fem.nodes import Dofs, Nodes
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.typing import Array, Ints

_CORNER = float(np.cos(np.radians(30.0)))
NO_TANGENT = 1e-9
"""Tangent over the length of an edge: a shorter one is rounding."""


@dataclass(frozen=True)  # without slots: cached properties need a __dict__
class Surface:
    """A chain of edges with the body on its left: the outward normal is ``(t_y, -t_x)``.

    Attributes
    ----------
    nodes : (n_nodes,) node numbers in the body
    edges : (n_edges, 2 or 3) positions in ``nodes``: start, end (, middle)
    X : (2, n_nodes) reference positions [mm]
    thickness : thickness across the plane [mm]; None for an axisymmetric body
    goes_on : whether the boundary of the body continues smoothly beyond the start and the end
    """

    nodes: Ints
    edges: Ints
    X: Array
    thickness: float | None
    goes_on: tuple[bool, bool] = (False, False)

    def depth(self, x: Array) -> Array:
        """Return the depth across the plane at positions x (2, ...): thickness or 2 pi r [mm]."""
        if self.thickness is None:
            return np.asarray(2 * np.pi * x[0])
        return np.full(x.shape[1:], self.thickness)

    @cached_property
    def vertices(self) -> Ints:
        """(n_edges + 1,) positions in ``nodes`` of the edge ends, along the chain."""
        return np.append(self.edges[:, 0], self.edges[-1, 1])

    @property
    def shortest_edge(self) -> float:
        """Length of the shortest edge between its ends [mm]."""
        return shortest(self.X, self.edges)

    @cached_property
    def lengths(self) -> Array:
        """Lengths (n_edges,) of the edges between their ends [mm]."""
        return np.asarray(np.linalg.norm(np.diff(self.X[:, self.vertices]), axis=0))

    @cached_property
    def tributary(self) -> Array:
        """Tributary length (n_edges + 1,) of each vertex: half of the edges at it [mm]."""
        return at_vertices(self.lengths / 2)

    @cached_property
    def spacing(self) -> Array:
        """Mean length (n_edges + 1,) of the one or two edges at each vertex [mm]."""
        return at_vertices(self.lengths) / at_vertices(np.ones(len(self.edges)))

    @cached_property
    def areas(self) -> Array:
        """Area (n_nodes,) of each node: the integral of its shape function [mm2]."""
        each = self._integrated(self.edges.shape[1])
        areas = np.bincount(self.edges.ravel(), each.ravel(), len(self.nodes))
        return np.asarray(areas, dtype=float)

    @cached_property
    def hats(self) -> Array:
        """Area (n_edges + 1,) of each vertex: the integral of its linear hat [mm2]."""
        start, end = self._integrated(2).T
        return np.append(start, 0.0) + np.append(0.0, end)

    def _integrated(self, functions: int) -> Array:
        """Return the integrals (n_edges, functions) of shape functions of this number [mm2]."""
        xi, weights = np.polynomial.legendre.leggauss(4)
        count = self.edges.shape[1]
        xe = self.X[:, self.edges]
        along = np.linalg.norm(xe @ shape_derivatives(xi, count).T, axis=0)
        weights = along * self.depth(xe @ shape_functions(xi, count).T) * weights
        return np.asarray(weights @ shape_functions(xi, functions))

    @cached_property
    def normals(self) -> Array:
        """Outward unit normals (2, n_nodes): means weighted with the shape function of the node."""
        xi, weights = np.polynomial.legendre.leggauss(4)
        count = self.edges.shape[1]
        along = self.X[:, self.edges] @ shape_derivatives(xi, count).T
        x, y = (each * weights @ shape_functions(xi, count) for each in along)
        sums = [np.bincount(self.edges.ravel(), each.ravel()) for each in (y, -x)]
        return np.asarray(sums / np.hypot(*sums))

    @cached_property
    def dofs(self) -> Ints:
        """(dim n_nodes,) unknowns of the body, node by node."""
        return Dofs(self.nodes, len(self.X)).every


def at_vertices(of_edges: Array) -> Array:
    """Return the sum over the one or two edges at each vertex of a chain."""
    return np.append(of_edges, 0.0) + np.append(0.0, of_edges)


def shortest(X: Array, edges: Ints) -> float:
    """Return the length of the shortest edge between its ends [mm], nodes at X (2, n_nodes)."""
    return float(np.linalg.norm(X[:, edges[:, 1]] - X[:, edges[:, 0]], axis=0).min())


def edges_of(part: Nodes, boundary: str) -> Ints:
    """Return the edges (n_edges, 2 or 3) of a boundary: start, end (, middle) node.

    Each has the body on its left. Facet bases of scikit-fem would invert the element mapping with
    an absolute tolerance, too coarse for elements of 1e-5 of the body's size.
    """
    mesh, basis = part.body.mesh, part.basis
    facets = part.body.facets(boundary)
    ends = basis.nodal_dofs[0][mesh.facets[:, facets]].T
    start, end = part.X[:, ends[:, 0]], part.X[:, ends[:, 1]]
    corners = mesh.t[:, mesh.f2t[0, facets]]
    on_edge = (corners[:, None, :] == mesh.facets[None, :, facets]).any(axis=1)
    position = part.X[:, basis.nodal_dofs[0][corners]]
    inside = np.where(on_edge, 0.0, position).sum(axis=1) / (~on_edge).sum(axis=0)
    along, inward = end - start, inside - (start + end) / 2
    reverse = along[0] * inward[1] - along[1] * inward[0] < 0
    ends[reverse] = ends[reverse, ::-1]
    if not basis.facet_dofs.size:
        return np.asarray(ends)
    return np.hstack([ends, basis.facet_dofs[0][facets][:, None]])


def gathered(part: Nodes, boundary: str) -> Surface:
    """Return the surface of a named boundary of any shape; its edges have no order."""
    edges = edges_of(part, boundary)
    nodes, local = np.unique(edges, return_inverse=True)
    return Surface(nodes, local.reshape(edges.shape), part.X[:, nodes], _thickness(part))


def _thickness(part: Nodes) -> float | None:
    return None if part.body.kinematics == "axisymmetric" else part.body.thickness


def extract(part: Nodes, boundary: str) -> Surface:
    """Return the surface of a named boundary, which must be one open chain."""
    edges = edges_of(part, boundary)
    following = {int(start): i for i, start in enumerate(edges[:, 0])}
    heads = set(edges[:, 0].tolist()) - set(edges[:, 1].tolist())
    order = []
    at = heads.pop() if len(heads) == 1 else -1
    while at in following:
        order.append(following.pop(at))
        at = int(edges[order[-1], 1])
    if len(order) != len(edges):
        allowed = (
            "a contact surface must be one open chain of edges: name each piece by itself; in a "
            "mesh file all its lines must be edges of cells"
        )
        raise ModelError("boundary", f"{part.body.name}.{boundary}", allowed)
    nodes, local = np.unique(edges[order], return_inverse=True)
    first, last = edges[order[0]], edges[order[-1]]
    beyond = (_goes_on(part, first, 0), _goes_on(part, last, 1))
    chain = local.reshape(edges.shape)
    return Surface(nodes, chain, part.X[:, nodes], _thickness(part), beyond)


def _goes_on(part: Nodes, edge: Ints, at: int) -> bool:
    """Return whether a boundary continues smoothly beyond the start (0) or end (1) of an edge.

    A change of direction by more than 30 degrees is a corner. Tangents are compared: chords change
    direction on a coarse mesh although the curve is smooth.
    """
    mesh, basis = part.body.mesh, part.basis
    outside = mesh.boundary_facets()
    pairs = basis.nodal_dofs[0][mesh.facets[:, outside]]
    middle = basis.facet_dofs[0][outside] if basis.facet_dofs.size else None
    end, before = edge[at], edge[1 - at]
    along = -_leaving(part.X, end, before, edge[2] if len(edge) > 2 else None)
    for k in (0, 1):
        for facet in np.flatnonzero((pairs[k] == end) & (pairs[1 - k] != before)):
            between = None if middle is None else middle[facet]
            onward = _leaving(part.X, end, pairs[1 - k, facet], between)
            turn = along @ onward / (np.linalg.norm(along) * np.linalg.norm(onward))
            if turn > _CORNER:
                return True
    return False


def _leaving(X: Array, end: int, other: int, middle: int | None) -> Array:
    """Return the tangent (2,) of an edge at its ``end``, pointing away from it.

    It is zero where the middle is a quarter of the edge away, at the tip of a crack: then it is the
    direction of the other end.
    """
    chord = np.asarray(X[:, other] - X[:, end])
    if middle is None:
        return chord
    along = np.asarray(4 * X[:, middle] - 3 * X[:, end] - X[:, other])
    return along if np.hypot(*along) > NO_TANGENT * np.hypot(*chord) else chord
