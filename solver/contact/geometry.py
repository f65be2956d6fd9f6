"""Gap and slip of two surfaces, weighted by linear hats on the slave's vertices (mortar).

Slave edges are cut where the master's vertices project on them, so every integrand is smooth
on its segment and a uniform pressure passes across non-matching meshes exactly (up to the
curvature of the edges). Points are projected along the slave's normals in the current
configuration; these are continuous except at corners. Gap and slip are means over the reference
area, because weights that change with the strain would have to be differentiated too.

M.A. Puso, T.A. Laursen, Comput. Methods Appl. Mech. Engng 193 (2004) 601-629; A. Popp et al.,
Int. J. Numer. Meth. Engng 79 (2009) 1354-1391.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.contact.normals import end_normals
from solver.fem.surface import at_vertices
from solver.mesh.edges import shape_derivatives, shape_functions

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.fem.surface import Surface

_GAUSS_XI, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(4)
_NEWTON_STEPS = 6
_LAST_STEP = 1e-9
"""Step of Newton's method below which the projection has converged: the next is rounding."""
_BEYOND = 1.5
_OPPOSED = 0.25
"""Least cosine of the angle between one normal and the opposite of the other, of facing edges."""
_EDGE_TOLERANCE = 1e-8
_MIN_COVERED = 1e-3


@dataclass(frozen=True, slots=True)
class Pairing:
    """Contact kinematics at given positions, one row per slave vertex.

    Attributes
    ----------
    area, deformed : (n,) integral of the hat over the part that faces the master, over the
        reference and over the current area [mm2]
    shared : (n - 1,) integral of the product of the two hats of each edge, over the part that
        faces the master [mm2]
    covered : (n,) share of the hat that faces the master
    length : (n,) mean length of the edges at the vertex [mm]
    gap : (n,) mean gap under the hat, negative where the bodies overlap [mm]; inf where
        no master faces the vertex
    normal, tangent : pairs ``(slave, master)`` of (n, 2 n_nodes) derivative rows of gap and
        of slip (slave relative to master along the surface) on the surfaces' unknowns
    """

    area: NDArray[np.float64]
    deformed: NDArray[np.float64]
    shared: NDArray[np.float64]
    covered: NDArray[np.float64]
    length: NDArray[np.float64]
    gap: NDArray[np.float64]
    normal: tuple[NDArray[np.float64], NDArray[np.float64]]
    tangent: tuple[NDArray[np.float64], NDArray[np.float64]]

    @property
    def parted(self) -> Pairing:
        """The pairing with surfaces that face each other nowhere."""
        none = np.zeros_like(self.area)
        areas = {"area": none, "deformed": none, "shared": none[1:]}
        return replace(self, **areas, covered=none, gap=none + np.inf)


def _combine(x: NDArray[np.float64], N: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sum over an edge's nodes, the last axis of both."""
    return np.asarray(np.einsum("...k,...k->...", x, N))


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(a[0] * b[1] - a[1] * b[0])


def _near(start: NDArray[np.float64], end: NDArray[np.float64]) -> tuple[NDArray[np.int64], ...]:
    """Return the edges that a line may cross, given its signed distances from their ends.

    The line is tested against the chord, extended for the curvature of the edge: it may cross the
    chord up to `_BEYOND` half-lengths from the middle.
    """
    return np.nonzero(np.abs(start + end) <= _BEYOND * np.abs(start - end))


def _project_on_slave(
    x: NDArray[np.float64],
    normals: NDArray[np.float64],
    slave: Surface,
    points: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return edges, and xi on them, where the slave's normal passes through a point."""
    count = slave.edges.shape[1]
    ends = x[:, slave.edges[:, :2].T]
    edge, point = _near(*_cross(normals[..., None], ends[..., None] - points[:, None, None]))
    xe, points = x[:, slave.edges[edge]], points[:, point]
    n0, n1 = normals[:, 0, edge], normals[:, 1, edge]
    xi = np.zeros(len(edge))
    for _ in range(_NEWTON_STEPS):
        offset = _combine(xe, shape_functions(xi, count)) - points
        slope = _combine(xe, shape_derivatives(xi, count))
        n = (1 - xi) / 2 * n0 + (1 + xi) / 2 * n1
        value = _cross(n, offset)
        derivative = _cross((n1 - n0) / 2, offset) + _cross(n, slope)
        step = value / np.where(derivative == 0, 1.0, derivative)
        xi = np.clip(xi - step, -3.0, 3.0)
        if np.abs(step).max(initial=0.0) < _LAST_STEP:
            break
    return edge, xi


def _project_on_master(
    x: NDArray[np.float64],
    edges: NDArray[np.int64],
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return eta (n,) and the distance along ``normals`` of points (2, n) on master edges."""
    count = edges.shape[-1]
    xe = x[:, edges]
    eta = np.zeros(len(edges))
    for _ in range(_NEWTON_STEPS):
        offset = _combine(xe, shape_functions(eta, count)) - points
        slope = _cross(normals, _combine(xe, shape_derivatives(eta, count)))
        step = _cross(normals, offset) / np.where(slope == 0, 1.0, slope)
        eta = np.clip(eta - step, -3.0, 3.0)
        if np.abs(step).max(initial=0.0) < _LAST_STEP:
            break
    offset = _combine(xe, shape_functions(eta, count)) - points
    return eta, (normals * offset).sum(axis=0)


def _nearest(
    x: NDArray[np.float64],
    master: Surface,
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    reach: float,
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the master edge that faces each point and is nearest, and whether there is one.

    An edge faces a point if the normals are opposite within 75 degrees, at any distance in front
    of the slave, and up to ``reach`` [mm] behind it, where the bodies overlap.
    """
    passing = _cross(normals[:, :, None], x[:, None, master.vertices] - points[:, :, None])
    point, edge = _near(passing[:, :-1], passing[:, 1:])
    chord = x[:, master.edges[edge, 1]] - x[:, master.edges[edge, 0]]
    opposed = _cross(chord, normals[:, point]) > _OPPOSED * np.linalg.norm(chord, axis=0)
    point, edge = point[opposed], edge[opposed]
    eta, along = _project_on_master(x, master.edges[edge], points[:, point], normals[:, point])
    distance = np.full((points.shape[1], len(master.edges)), np.inf)
    met = np.abs(eta) <= 1 + 1e-6
    distance[point, edge] = np.where(met & (along > -reach), np.abs(along), np.inf)
    partner = distance.argmin(axis=1)
    return partner, np.isfinite(distance[np.arange(len(partner)), partner])


def _segments(
    edge: NDArray[np.int64], xi: NDArray[np.float64], n_edges: int
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Return edge, start and end of the pieces that breakpoints ``xi`` on ``edge`` cut."""
    inner = np.abs(xi) < 1 - _EDGE_TOLERANCE
    owner = np.concatenate([edge[inner], np.arange(n_edges), np.arange(n_edges)])
    place = np.concatenate([xi[inner], np.full(n_edges, -1.0), np.full(n_edges, 1.0)])
    order = np.lexsort((place, owner))
    owner, place = owner[order], place[order]
    inside = (owner[1:] == owner[:-1]) & (place[1:] - place[:-1] > _EDGE_TOLERANCE)
    return owner[:-1][inside], place[:-1][inside], place[1:][inside]


def pair(
    slave: Surface,
    slave_u: NDArray[np.float64],
    master: Surface,
    master_u: NDArray[np.float64],
    reach: float = np.inf,
    *,
    tied: bool = False,
) -> Pairing:
    """Pair two surfaces displaced by ``slave_u`` and ``master_u`` (2, n_nodes) [mm].

    A master that lies more than ``reach`` [mm] behind the slave does not face it. Of a ``tied``
    pair the rows are those of the displacement of the master relative to the slave along x and y,
    in place of normal and tangent.
    """
    xs, xm = slave.X + slave_u, master.X + master_u
    normals = end_normals(xs, slave)
    cut, xi = _project_on_slave(xs, normals, slave, xm[:, master.vertices])
    edge, start, end = _segments(cut, xi, len(slave.edges))

    def on_slave(
        e: NDArray[np.int64], at: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        position = (xs[:, slave.edges[e]] * shape_functions(at, slave.edges.shape[1])).sum(axis=-1)
        n = (1 - at) / 2 * normals[:, 0, e] + (1 + at) / 2 * normals[:, 1, e]
        return position, n / np.linalg.norm(n, axis=0)

    middle, n = on_slave(edge, (start + end) / 2)
    partner, facing = _nearest(xm, master, middle, n, reach)
    edge, partner, start, end = edge[facing], partner[facing], start[facing], end[facing]

    at = ((start + end)[:, None] + (end - start)[:, None] * _GAUSS_XI) / 2
    edge, partner = (np.repeat(a, len(_GAUSS_XI)) for a in (edge, partner))
    weight = ((end - start)[:, None] / 2 * _GAUSS_WEIGHTS).ravel()
    at = at.ravel()
    point, n = on_slave(edge, at)
    eta, distance = _project_on_master(xm, master.edges[partner], point, n)
    ways = tuple(np.eye(2)[..., None] + 0 * n) if tied else (n, np.stack([n[1], -n[0]]))
    return _integrate(slave, xs, master, edge, partner, at, eta, ways, distance, weight)


def _integrate(
    slave: Surface,
    xs: NDArray[np.float64],
    master: Surface,
    edge: NDArray[np.int64],
    partner: NDArray[np.int64],
    xi: NDArray[np.float64],
    eta: NDArray[np.float64],
    ways: tuple[NDArray[np.float64], ...],
    distance: NDArray[np.float64],
    weight: NDArray[np.float64],
) -> Pairing:
    """Sum the integration points into rows, one per slave vertex, along two ways (2, n) each."""
    rows, vertex = len(slave.edges) + 1, np.stack([edge, edge + 1])
    bare = np.stack([(1 - xi) / 2, (1 + xi) / 2]) * weight
    hats, deformed_hats = (bare * _area_per_xi(slave, x, edge, xi) for x in (slave.X, xs))

    def summed(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.bincount(vertex.ravel(), values.ravel(), rows), dtype=float)

    area, deformed, gap, facing = map(summed, (hats, deformed_hats, hats * distance, bare))
    sides = []
    for surface, own, at, sign in ((slave, edge, xi, -1.0), (master, partner, eta, 1.0)):
        N = shape_functions(at, surface.edges.shape[1])
        size = len(surface.nodes)
        place = (vertex[..., None] * size + surface.edges[own]).ravel()
        value = sign * hats[..., None] * N
        block = np.empty((2, rows, size, 2))
        for kind, direction in enumerate(ways):
            for axis, along in enumerate(direction):
                each = np.bincount(place, (value * along[:, None]).ravel(), rows * size)
                block[kind, :, :, axis] = each.reshape(rows, size)
        sides.append(block)

    covered = area > _MIN_COVERED * slave.hats
    scale = np.where(covered, 1 / np.where(covered, area, 1.0), 0.0)
    flat = [(side * scale[:, None, None]).reshape(2, rows, -1) for side in sides]
    return Pairing(
        area=np.where(covered, area, 0.0),
        deformed=np.where(covered, deformed, 0.0),
        shared=np.bincount(edge, hats[0] * (1 + xi) / 2, rows - 1),
        covered=facing / at_vertices(np.ones(len(slave.edges))),
        length=slave.spacing,
        gap=np.where(covered, gap * scale, np.inf),
        normal=(flat[0][0], flat[1][0]),
        tangent=(flat[0][1], flat[1][1]),
    )


def _area_per_xi(
    surface: Surface, x: NDArray[np.float64], edge: NDArray[np.int64], xi: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the derivative of area along edges, whose nodes are at x (2, n_nodes) [mm2]."""
    xe, k = x[:, surface.edges[edge]], surface.edges.shape[1]
    along = np.linalg.norm(_combine(xe, shape_derivatives(xi, k)), axis=0)
    return np.asarray(along * surface.depth(_combine(xe, shape_functions(xi, k))))
