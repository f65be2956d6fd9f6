"""Checks of a mesh: elements must not be folded or overlap, and the mesh must be one piece.

The Jacobian of an element must keep one sign, and neighbours must lie on opposite sides of their
common edge. The mesh must be connected through edges, without cracks and hinges. Lengths are
compared with nearby edges and with the rounding of coordinates, so that unit, grading and origin do
not matter. A mesh in space is not checked for overlaps, cracks and hinges.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from skfem import Mesh
from skfem.quadrature import get_quadrature

from solver.errors import ModelError
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.mesh.elements import ElementType
from solver.typing import Array, Ints

Faces = tuple[Ints, Ints]
"""The facets of both faces of a crack."""
_FOLDED = 1e-6
"""Least over greatest Jacobian: an element with a smaller ratio is folded. Also the sine of the
angle between shortest and longest side: an element with a smaller one is flat."""
_CLOSED = 1e-3
"""Distance of two nodes over the shortest edge: they are coincident below this ratio. Duplicate
nodes are far closer. A narrower notch would close under load without contact in the model."""
_DIRECTION = np.array([0.8, 0.6])
_ROUNDING = 8 * np.finfo(float).eps
"""Relative rounding error of coordinates after a few operations."""


def check_mesh(mesh: Mesh, name: str, kind: ElementType, cracks: Sequence[Faces] = ()) -> None:
    """Raise `ModelError` if the mesh of body ``name`` is folded, overlaps, or is not one piece.

    Errors give the numbers of elements and nodes in the mesh. At a tip of the
    ``cracks`` the Jacobian may be zero, and nodes of a face may lie on the other one.
    """
    where = f'of body "{name}"'
    _check_nodes(mesh, where, kind)
    tips = [np.intersect1d(*(mesh.facets[:, face] for face in faces)) for faces in cracks]
    sense = _check_elements(mesh, where, kind, np.concatenate([*tips, np.zeros(0, dtype=int)]))
    if kind.dim == 3:
        _check_connected(mesh, where)
        return
    _check_neighbours(mesh, where, sense)
    _check_cracks(mesh, where, cracks)
    _check_connected(mesh, where)
    _check_hinges(mesh, where)


def _refuse(what: str, where: str, allowed: str) -> NoReturn:
    raise ModelError("mesh", f"{what} {where}", allowed)


def _at(mesh: Mesh, node: int) -> str:
    return f"({', '.join(f'{x:.6g}' for x in mesh.p[:, node])})"


def _check_nodes(mesh: Mesh, where: str, kind: ElementType) -> None:
    if len(mesh.p) != kind.dim:
        words = "two, x and y" if kind.dim == 2 else "three, x, y and z"
        _refuse("node 0", where, f"has {len(mesh.p)} coordinates; nodes must have {words}")
    used, n = mesh.dofs.element_dofs, mesh.p.shape[1]
    for element in np.flatnonzero(((used < 0) | (used >= n)).any(axis=0))[:1]:
        nodes = ", ".join(map(str, used[:, element]))
        _refuse(f"element {element}", where, f"has nodes {nodes}; they must be in 0 to {n - 1}")
    for node in np.flatnonzero(~np.isfinite(mesh.p).all(axis=0))[:1]:
        _refuse(f"node {node}", where, f"is at {_at(mesh, node)}; coordinates must be finite")
    for node in np.flatnonzero(np.bincount(used.ravel(), minlength=n) == 0)[:1]:
        _refuse(f"node {node}", where, f"at {_at(mesh, node)} belongs to no element: leave it out")


def _jacobians(mesh: Mesh, kind: ElementType) -> Array:
    """Return signed Jacobians (n_elements, n_points), at nodes and integration points.

    The Jacobian of a straight element in the plane is linear: its extremes are at the corners.
    """
    element, nodes = mesh.elem(), mesh.dofs.element_dofs
    points = [element.doflocs.T]
    if len(nodes) > len(mesh.t) or kind.dim == 3:
        points += [get_quadrature(element, order)[0] for order in {kind.order, kind.full_order}]
    slopes = [element.lbasis(np.hstack(points), i)[1] for i in range(len(nodes))]
    X = mesh.p[:, nodes] - mesh.p[:, None, nodes[0]]  # exact, also far from the origin
    J = np.einsum("ine,njq->ijeq", X, np.array(slopes), optimize=True)
    if len(J) == 3:
        return np.asarray(np.linalg.det(np.moveaxis(J, (0, 1), (-2, -1))))
    return np.asarray(J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0])


def _check_elements(mesh: Mesh, where: str, kind: ElementType, tips: Ints) -> Array:
    """Return the orientation of every element: 1 counterclockwise, -1 clockwise."""
    jacobian = _jacobians(mesh, kind)
    rows, columns = np.nonzero(np.isin(mesh.t, tips))
    jacobian[columns, rows] = jacobian.mean(axis=1)[columns]  # its corners come first
    low, high = jacobian.min(axis=1), jacobian.max(axis=1)
    sense = np.where(high >= -low, 1.0, -1.0)
    greatest = np.maximum(high, -low)
    corners = mesh.p[:, mesh.t]
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=0)
    height = _FOLDED * sides.min(axis=0) + _ROUNDING * np.abs(corners).max(axis=(0, 1))
    for element in np.flatnonzero(greatest <= height * sides.max(axis=0) ** (kind.dim - 1))[:1]:
        within = "on one line" if kind.dim == 2 else "in one plane"
        _refuse(f"element {element}", where, f"is flat: its corners must not lie {within}")
    for element in np.flatnonzero(np.minimum(sense * low, sense * high) <= _FOLDED * greatest)[:1]:
        allowed = (
            f"is folded: its Jacobian goes from {low[element]:.3g} to {high[element]:.3g} and must "
            "keep one sign; number its corners around the element, keep its angles below 180 "
            "degrees and the nodes within its sides near their middle"
        )
        _refuse(f"element {element}", where, allowed)
    return sense


def _check_neighbours(mesh: Mesh, where: str, sense: Array) -> None:
    """Refuse elements that overlap at an edge.

    Counterclockwise numbering puts an element on the left of its edges: two neighbours on opposite
    sides of their common edge have opposite directions on it.
    """
    walked = np.where(mesh.t < np.roll(mesh.t, -1, axis=0), sense, -sense)
    count = np.bincount(mesh.t2f.ravel())
    both = np.bincount(mesh.t2f.ravel(), weights=walked.ravel())
    for facet in np.flatnonzero((count > 2) | ((count == 2) & (both != 0)))[:1]:
        elements = np.flatnonzero((mesh.t2f == facet).any(axis=0))
        a, b = mesh.facets[:, facet]
        allowed = (
            f"overlap at the edge they share, between nodes {a} and {b}: an edge must have at most "
            "one element on either side"
        )
        _refuse("elements " + " and ".join(map(str, elements)), where, allowed)


def _check_cracks(mesh: Mesh, where: str, cracks: Sequence[Faces]) -> None:
    """Refuse boundary nodes that lie on another node, or on an edge between its ends.

    Those of a face of a declared crack may lie on its other face.
    """
    start, end = mesh.p[:, mesh.facets[0]], mesh.p[:, mesh.facets[1]]
    length = np.hypot(*(end - start))
    shortest = np.full(mesh.p.shape[1], length.max())
    for ends in mesh.facets:  # one by one: when it broadcasts, numpy 2.4 gives a false warning
        np.minimum.at(shortest, ends, length)
    nodes = np.unique(mesh.facets[:, mesh.boundary_facets()])
    apart = "; surfaces meant to touch need two bodies and a contact pair"
    X = mesh.p[:, nodes]
    one, other = nodes[np.stack(_within(X, X, _close(mesh, nodes, shortest[nodes])))]
    distance = np.hypot(*(mesh.p[:, one] - mesh.p[:, other]))
    close = _close(mesh, one, np.minimum(shortest[one], shortest[other]))
    same = (one != other) & (distance <= close)
    one, other = one[same], other[same]
    faced = np.zeros(len(one), dtype=bool)
    for a, b in _both_ways(cracks):
        faced = faced | np.isin(one, mesh.facets[:, a]) & np.isin(other, mesh.facets[:, b])
    for i in np.flatnonzero(~faced)[:1]:
        allowed = f"lie on one another at {_at(mesh, one[i])}: merge them{apart}"
        _refuse(f"nodes {one[i]} and {other[i]}", where, allowed)
    hanging = _hanging(mesh, nodes, shortest)
    node, facet = hanging.T
    ends, n = mesh.facets[:, facet], mesh.nvertices
    faced = np.asarray(np.isin(node * n + ends, one * n + other).any(axis=0))  # at an end of it
    for a, b in _both_ways(cracks):
        faced |= np.isin(node, mesh.facets[:, a]) & np.isin(facet, b)
    for node, facet in hanging[~faced][:1]:
        a, b = mesh.facets[:, facet]
        allowed = f"lies on the edge from node {a} to node {b}: divide the element there{apart}"
        _refuse(f"node {node}", where, allowed)


def _both_ways(cracks: Sequence[Faces]) -> list[Faces]:
    return [pair for a, b in cracks for pair in ((a, b), (b, a))]


def _close(mesh: Mesh, nodes: Ints, edges: Array) -> Array:
    """Return the distance (n,) below which nodes with these edge lengths are coincident."""
    return np.asarray(_CLOSED * edges + _ROUNDING * np.abs(mesh.p[:, nodes]).max(axis=0))


def _within(centres: Array, places: Array, radii: Array) -> tuple[Ints, Ints]:
    """Return pairs of a centre (2, n) and a place (2, m) within its radius (n,), by centres.

    Places are sorted along a direction that sides of bodies seldom have. To import `scipy.spatial`
    would take as long as the rest of the check.
    """
    at, along = _DIRECTION @ centres, _DIRECTION @ places
    order = np.argsort(along, kind="stable")
    first = np.searchsorted(along[order], at - radii)
    count = np.searchsorted(along[order], at + radii, side="right") - first
    centre = np.repeat(np.arange(len(at)), count)
    place = order[np.arange(len(centre)) + np.repeat(first - (np.cumsum(count) - count), count)]
    near = np.hypot(*(centres[:, centre] - places[:, place])) <= radii[centre]
    return centre[near], place[near]


def _hanging(mesh: Mesh, nodes: Ints, shortest: Array) -> Ints:
    """Return (n, 2): boundary nodes between the ends of a boundary facet, and this facet."""
    facets = mesh.boundary_facets()
    X = mesh.p[:, mesh.facets[:, facets]]
    centre, half = X.mean(axis=1), np.hypot(*(X[:, 1] - X[:, 0])) / 2
    curved = len(mesh.dofs.facet_dofs) > 0
    middle = mesh.p[:, mesh.dofs.facet_dofs[0, facets]] if curved else centre
    edge, near = _within(centre, mesh.p[:, nodes], half + np.hypot(*(middle - centre)))
    node = nodes[near]
    inner = (mesh.facets[:, facets[edge]] != node).all(axis=0)
    edge, node = edge[inner], node[inner]
    X = np.concatenate([X, middle[:, None]], axis=1)[:, :, edge]
    xi = np.zeros(len(edge))
    for _ in range(8):  # Gauss-Newton for the nearest point; one step on a straight edge
        t = (X * shape_derivatives(xi, 3).T).sum(axis=1)
        miss = mesh.p[:, node] - (X * shape_functions(xi, 3).T).sum(axis=1)
        size = np.maximum((t**2).sum(axis=0), np.finfo(float).tiny)  # zero at a tip
        xi = np.clip(xi + (miss * t).sum(axis=0) / size, -1, 1)
    lies = np.hypot(*miss) <= _close(mesh, node, np.minimum(shortest[node], 2 * half[edge]))
    return np.stack([node, facets[edge]], axis=1)[lies & (np.abs(xi) < 1)]


def _check_connected(mesh: Mesh, where: str) -> None:
    """Refuse a mesh of several parts."""
    pairs, n = mesh.f2t[:, mesh.f2t[1] >= 0], mesh.nelements
    joined = coo_array((np.ones(pairs.shape[1]), tuple(pairs)), shape=(n, n))
    parts, part = connected_components(joined, directed=False)
    if parts > 1:
        sizes = np.bincount(part)
        size = sizes.min()
        allowed = (
            f"belongs to a part of {size} elements that shares no edge with the other {n - size}; "
            "a body must be one piece: merge the nodes of its parts, or make them several bodies"
        )
        _refuse(f"element {np.argmax(part == sizes.argmin())}", where, allowed)


def _check_hinges(mesh: Mesh, where: str) -> None:
    """Refuse parts that share only a node."""
    edges = np.bincount(mesh.facets[:, mesh.boundary_facets()].ravel())
    for node in np.flatnonzero(edges > 2)[:1]:
        allowed = (
            f"at {_at(mesh, node)} is a hinge: it alone connects two parts of the body; they "
            "must share an edge, or be separate bodies"
        )
        _refuse(f"node {node}", where, allowed)
