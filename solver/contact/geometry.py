"""Gap and slip of two surfaces, weighted by linear hats on the slave's vertices (mortar).

The master's vertices are projected on the slave and cut its edges into segments. The integrands are
smooth on a segment, so non-matching meshes transmit a uniform pressure exactly (up to the
curvature of the edges). Points are projected along the slave's normals in the current
configuration; these are continuous except at corners. Gap and slip are means over the reference
area, because weights that change with the strain would have to be differentiated too.

M.A. Puso, T.A. Laursen, Comput. Methods Appl. Mech. Engng 193 (2004) 601-629; A. Popp et al.,
Int. J. Numer. Meth. Engng 79 (2009) 1354-1391.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from solver.fem.surface import NO_TANGENT, Surface, at_vertices
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.typing import Array, Bools, Ints

_GAUSS_XI, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(4)
_NEWTON_STEPS = 6
_LAST_STEP = 1e-9
"""Step of Newton's method for a projection: it ends after a smaller one; the next is rounding."""
_BEYOND = 1.5
_OPPOSED = 0.25
"""Least cosine of the angle between a slave's normal and the reversed normal of an edge it faces:
75 degrees."""
_EDGE_TOLERANCE = 1e-8
_MIN_COVERED = 1e-3


@dataclass(frozen=True, slots=True)
class Points:
    """The integration points of a pairing.

    Attributes
    ----------
    x : positions (2, n_nodes) of the nodes of slave and master [mm]
    edge, partner : (n,) their edges of the slave and of the master
    xi, eta : (n,) their places on these edges
    normal : (2, n) normals of the slave
    push : (2, n) directions of the normal forces on the master
    distance : (n,) distance of the surfaces along them [mm]
    shares : (n, 2) weights in the means under the hats of the two vertices of the edge
    """

    x: tuple[Array, Array]
    edge: Ints
    partner: Ints
    xi: Array
    eta: Array
    normal: Array
    push: Array
    distance: Array
    shares: Array


class Cover(NamedTuple):
    """Where a slave faces its master: ``area`` and ``shared`` of a `Pairing`."""

    area: Array
    shared: Array

    def spread(self, force: Array) -> Array:
        """Return the integrals (n,) under the hats of the field of which ``force`` are forces [N].

        The field is piecewise linear where the slave faces the master, and zero elsewhere.
        """
        each = np.divide(force, self.area, out=np.zeros_like(force), where=self.area > 0)
        # hats sum to one: one of two neighbours gains in the integrals what the other loses
        gained = self.shared * np.diff(each)
        return np.asarray(force + np.append(gained, 0.0) - np.append(0.0, gained))


@dataclass(frozen=True, slots=True)
class Pairing:
    """Contact kinematics at given positions, one row per slave vertex.

    Attributes
    ----------
    area, deformed : (n,) integral of the hat where the slave faces the master, over the reference
        and over the current area [mm2]
    shared : (n - 1,) integral of the product of the two hats of each edge, where the slave faces
        the master [mm2]
    covered : (n,) share of the hat that faces the master
    length : (n,) mean length of the edges at the vertex [mm]
    gap : (n,) mean gap under the hat, negative where the bodies overlap [mm]; inf where
        no master faces the vertex
    normal, tangent : pairs ``(slave, master)`` of rows (n, 2 n_nodes) of gap and of slip (slave
        relative to master along the surface) on the surfaces' unknowns, as the forces act: along
        the slave's normals, or those of the master
    closing : the derivatives of the gap, rows as ``normal`` along the master's normals. The two
        differ where the hat of a curved body is wider than the contact: a round body that rotates
        changes its gaps
    points : the points that these are integrals over
    """

    area: Array
    deformed: Array
    shared: Array
    covered: Array
    length: Array
    gap: Array
    normal: tuple[Array, Array]
    tangent: tuple[Array, Array]
    closing: tuple[Array, Array]
    points: Points

    @property
    def cover(self) -> Cover:
        """Where the slave faces the master."""
        return Cover(self.area, self.shared)

    @property
    def shrunk(self) -> Array:
        """Reference area over the current one (n,); 1 where the slave faces no master."""
        none = np.ones_like(self.area)
        return np.divide(self.area, self.deformed, out=none, where=self.deformed > 0)

    @property
    def parted(self) -> Pairing:
        """The same pairing as if the surfaces faced each other nowhere."""
        none = np.zeros_like(self.area)
        return replace(
            self, area=none, deformed=none, shared=none[1:], covered=none, gap=none + np.inf
        )


def _powers(x: Array, surface: Surface) -> Array:
    """Return the positions on edges by powers of xi, constant first: (2, 2 or 3, n_edges).

    ``x`` (2, n_nodes) are the nodes of the surface.
    """
    start, end, *middle = np.moveaxis(x[:, surface.edges], -1, 0)
    mean, half = (start + end) / 2, (end - start) / 2
    return np.stack([*(middle or [mean]), half, *(mean - each for each in middle)], axis=1)


def _from(points: Array, powers: Array) -> Array:
    """Return the powers (2, 2 or 3, n) of positions relative to points (2, n)."""
    out = powers.copy()
    out[:, 0] -= points
    return out


def _value(powers: Array, xi: Array) -> Array:
    """Return polynomials at xi (n,), given their coefficients (..., degree + 1, n)."""
    out = powers[..., -1, :]
    for k in range(powers.shape[-2] - 2, -1, -1):
        out = out * xi + powers[..., k, :]
    return np.asarray(out)


def _slopes(powers: Array) -> Array:
    """Return the coefficients of the derivatives of polynomials."""
    return powers[..., 1:, :] * np.arange(1, powers.shape[-2])[:, None]


def _root(powers: Array) -> Array:
    """Return a root (n,) of each polynomial by Newton's method from 0, kept within [-3, 3]."""
    xi, slopes = np.zeros(powers.shape[-1]), _slopes(powers)
    for _ in range(_NEWTON_STEPS):
        slope = _value(slopes, xi)
        step = _value(powers, xi) / np.where(slope == 0, 1.0, slope)
        xi = np.clip(xi - step, -3.0, 3.0)
        if np.abs(step).max(initial=0.0) < _LAST_STEP:
            break
    return xi


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[0] * b[1] - a[1] * b[0])


def _beside(points: Array, normals: Array, others: Array) -> Array:
    """Return the signed distances (n, m) of ``others`` (2, m) from the normals at points (2, n)."""
    return np.stack([-normals[1], normals[0]], axis=-1) @ others - _cross(normals, points)[:, None]


def _near(start: Array, end: Array) -> tuple[Ints, ...]:
    """Return the pairs of line and edge that may cross, given signed distances of edge ends.

    The line may cross the chord up to `_BEYOND` half-lengths from its middle: edges are curved.
    """
    return np.nonzero(np.abs(start + end) <= _BEYOND * np.abs(start - end))


def _project_on_slave(
    x: Array,
    normals: Array,
    slave: Surface,
    powers: Array,
    points: Array,
) -> tuple[Ints, Array]:
    """Return edges, and xi on them, where the slave's normal passes through one of the points."""
    ends = x[:, slave.edges[:, :2].T]
    edge, point = _near(*(_beside(ends[:, k], normals[:, k], points) for k in (0, 1)))
    offset = _from(points[:, point], powers[..., edge])
    n0, n1 = normals[:, 0, edge], normals[:, 1, edge]
    beside = np.zeros((offset.shape[1] + 1, len(edge)))  # powers of xi: the normal is linear in xi
    beside[:-1] += _cross((n0 + n1)[:, None] / 2, offset)
    beside[1:] += _cross((n1 - n0)[:, None] / 2, offset)
    return edge, _root(beside)


def _project_on_master(powers: Array, points: Array, normals: Array) -> tuple[Array, Array]:
    """Return eta (n,) of points (2, n), each on its edge, and their distances along ``normals``.

    ``powers`` (2, 2 or 3, n) are those of the master's edges.
    """
    offset = _from(points, powers)
    eta = _root(_cross(normals[:, None], offset))
    return eta, (normals * _value(offset, eta)).sum(axis=0)


def _nearest(
    x: Array,
    master: Surface,
    powers: Array,
    points: Array,
    normals: Array,
    reach: float,
) -> tuple[Ints, Bools]:
    """Return the nearest master edge that faces each point, and whether there is one.

    An edge faces a point if the normals are opposite within 75 degrees. It may be at any distance
    in front of the slave, and up to ``reach`` [mm] behind it, where the bodies overlap.
    """
    passing = _beside(points, normals, x[:, master.vertices])
    point, edge = _near(passing[:, :-1], passing[:, 1:])
    chord = x[:, master.edges[edge, 1]] - x[:, master.edges[edge, 0]]
    opposed = _cross(chord, normals[:, point]) > _OPPOSED * np.linalg.norm(chord, axis=0)
    point, edge = point[opposed], edge[opposed]
    eta, along = _project_on_master(powers[..., edge], points[:, point], normals[:, point])
    distance = np.full((points.shape[1], len(master.edges)), np.inf)
    met = np.abs(eta) <= 1 + 1e-6
    distance[point, edge] = np.where(met & (along > -reach), np.abs(along), np.inf)
    partner = distance.argmin(axis=1)
    return partner, np.isfinite(distance[np.arange(len(partner)), partner])


def _segments(edge: Ints, xi: Array, n_edges: int) -> tuple[Ints, Array, Array]:
    """Return edge, start and end of the segments between breakpoints ``xi`` on ``edge``."""
    inner = np.abs(xi) < 1 - _EDGE_TOLERANCE
    owner = np.concatenate([edge[inner], np.arange(n_edges), np.arange(n_edges)])
    place = np.concatenate([xi[inner], np.full(n_edges, -1.0), np.full(n_edges, 1.0)])
    order = np.lexsort((place, owner))
    owner, place = owner[order], place[order]
    inside = (owner[1:] == owner[:-1]) & (place[1:] - place[:-1] > _EDGE_TOLERANCE)
    return owner[:-1][inside], place[:-1][inside], place[1:][inside]


def pair(
    slave: Surface,
    slave_u: Array,
    master: Surface,
    master_u: Array,
    reach: float = np.inf,
    *,
    tied: bool = False,
    along_master: bool = False,
) -> Pairing:
    """Pair two surfaces displaced by ``slave_u`` and ``master_u`` (2, n_nodes) [mm].

    A master more than ``reach`` [mm] behind the slave does not face it. If ``tied``, ``normal`` and
    ``tangent`` have the displacement of the master relative to the slave along x and y. If
    ``along_master``, forces act along the master's normals, else along the slave's.
    """
    xs, xm = slave.X + slave_u, master.X + master_u
    own, its = _powers(xs, slave), _powers(xm, master)
    normals = end_normals(xs, slave)
    cut, xi = _project_on_slave(xs, normals, slave, own, xm[:, master.vertices])
    edge, start, end = _segments(cut, xi, len(slave.edges))

    def on_slave(e: Ints, at: Array) -> tuple[Array, Array]:
        n = (1 - at) / 2 * normals[:, 0, e] + (1 + at) / 2 * normals[:, 1, e]
        return _value(own[..., e], at), n / np.sqrt(n[0] ** 2 + n[1] ** 2)

    middle, n = on_slave(edge, (start + end) / 2)
    partner, facing = _nearest(xm, master, its, middle, n, reach)
    edge, partner, start, end = edge[facing], partner[facing], start[facing], end[facing]

    at = (((start + end)[:, None] + (end - start)[:, None] * _GAUSS_XI) / 2).ravel()
    weight = ((end - start)[:, None] / 2 * _GAUSS_WEIGHTS).ravel()
    each, its = np.repeat(edge, len(_GAUSS_XI)), its[..., np.repeat(partner, len(_GAUSS_XI))]
    point, n = on_slave(each, at)
    eta, distance = _project_on_master(its, point, n)
    if tied:
        ways = np.eye(2)[..., None] + 0 * n
    else:
        x, y = _value(_slopes(its), eta)
        facing_master = np.stack([-y, x]) / (n[1] * x - n[0] * y)
        push = facing_master / np.hypot(*facing_master) if along_master else n
        ways = np.stack([push, [push[1], -push[0]], facing_master])
    areas = [
        weight * _area_per_xi(slave, powers[..., each], at)
        for powers in (_powers(slave.X, slave), own)
    ]
    return _integrate(
        slave, master, (xs, xm), edge, partner, at, eta, n, ways, distance, weight, areas
    )


def _integrate(
    slave: Surface,
    master: Surface,
    x: tuple[Array, Array],
    edge: Ints,
    partner: Ints,
    xi: Array,
    eta: Array,
    normal: Array,
    ways: Array,
    distance: Array,
    weight: Array,
    areas: Sequence[Array],
) -> Pairing:
    """Sum segments of edges into rows, one per slave vertex, along ways (2 or 3, 2, n_points).

    ``edge`` and ``partner`` are those of segments; the other arrays are at integration points.
    ``weight`` is the weight in xi, ``areas`` are the weights in the reference and current area.
    """
    points = len(edge), len(_GAUSS_XI)
    xi, eta, distance, weight, area, deformed = (
        of.reshape(points) for of in (xi, eta, distance, weight, *areas)
    )
    ways = ways.reshape(*ways.shape[:2], *points)
    rows, vertex = len(slave.edges) + 1, np.stack([edge, edge + 1])
    hats = np.stack([(1 - xi) / 2, (1 + xi) / 2])  # of a segment's two vertices, at its points

    def summed(values: Array) -> Array:
        pieces = (hats * values).sum(axis=-1)
        return np.asarray(np.bincount(vertex.ravel(), pieces.ravel(), rows), dtype=float)

    whole, current, gap, facing = map(summed, (area, deformed, area * distance, weight))
    covered = whole > _MIN_COVERED * slave.hats
    scale = np.where(covered, 1 / np.where(covered, whole, 1.0), 0.0)
    means = hats * area * scale[vertex][..., None]
    along = np.einsum("vpg,wapg->pwvag", means, ways)
    first = (np.arange(len(ways))[:, None] * rows + vertex.T[:, None])[..., None, None]
    sides = []
    for surface, own, at, sign in ((slave, edge, xi, -1.0), (master, partner, eta, 1.0)):
        N, size = sign * shape_functions(at, surface.edges.shape[1]), 2 * len(surface.nodes)
        unknowns = 2 * surface.edges[own][:, None] + np.arange(2)[:, None]
        place = first * size + unknowns[:, None, None]  # segment, way, vertex, axis, node
        value = along.reshape(len(edge), 4 * len(ways), len(_GAUSS_XI)) @ N
        each = np.bincount(place.ravel(), value.ravel(), len(ways) * rows * size)
        sides.append(each.reshape(len(ways), rows, size))
    both = (hats[0] * hats[1] * area).sum(axis=-1)
    return Pairing(
        area=np.where(covered, whole, 0.0),
        deformed=np.where(covered, current, 0.0),
        shared=np.asarray(np.bincount(edge, both, rows - 1), dtype=float),
        covered=facing / at_vertices(np.ones(len(slave.edges))),
        length=slave.spacing,
        gap=np.where(covered, gap * scale, np.inf),
        normal=(sides[0][0], sides[1][0]),
        tangent=(sides[0][1], sides[1][1]),
        closing=(sides[0][-1], sides[1][-1]),
        points=Points(
            x=x,
            edge=np.repeat(edge, points[1]),
            partner=np.repeat(partner, points[1]),
            xi=xi.ravel(),
            eta=eta.ravel(),
            normal=normal,
            push=ways[0].reshape(2, -1),
            distance=distance.ravel(),
            shares=means.transpose(1, 2, 0).reshape(-1, 2),
        ),
    )


def _area_per_xi(surface: Surface, powers: Array, xi: Array) -> Array:
    """Return the area per xi (n,) along edges with these powers (2, 2 or 3, n) [mm2]."""
    along = _value(_slopes(powers), xi)
    return np.asarray(np.hypot(*along) * surface.depth(_value(powers, xi)))


_KINK = 5.0
"""Angle between two edges [degrees]: with a larger one their surface is not smooth."""
_CORNER = float(np.cos(np.radians(40.0)))
"""Cosine of the angle between the normals of two edges: they form a corner at a larger angle."""
_STRAIGHT = 1e-6
"""Change of the normal along a straight surface by rounding [rad], at most; the sagitta of an
element is then 1e-7 of its length."""


def _edge_normal(x: Array, surface: Surface, xi: float) -> Array:
    """Return outward unit normals (2, n_edges) at ``xi`` on every edge.

    Where the middle node of an edge is a quarter of it from an end, the tangent there is zero
    before loading: then it is the direction between the ends.
    """
    d = shape_derivatives(np.array(xi), surface.edges.shape[1])
    t = x[:, surface.edges] @ d
    gone = np.hypot(*(surface.X[:, surface.edges] @ d)) <= NO_TANGENT * surface.lengths
    t[:, gone] = np.diff(x[:, surface.edges[gone, :2]])[..., 0]
    n = np.stack([t[1], -t[0]])
    return np.asarray(n / np.linalg.norm(n, axis=0))


def end_normals(x: Array, surface: Surface) -> Array:
    """Return unit normals (2, 2, n_edges) at the starts and the ends of the edges.

    Two edges share the mean of their normals at the vertex between them. At a corner of the
    undeformed body, and at the ends of the chain, each edge keeps its own normal.
    """
    start, end = _edge_normal(x, surface, -1.0), _edge_normal(x, surface, 1.0)
    smooth = _meets(surface) > _CORNER
    mean = end[:, :-1] + start[:, 1:]
    mean /= np.linalg.norm(mean, axis=0)
    start[:, 1:] = np.where(smooth, mean, start[:, 1:])
    end[:, :-1] = np.where(smooth, mean, end[:, :-1])
    return np.stack([start, end], axis=1)


def _meets(surface: Surface) -> Array:
    """Return the cosines of the angles (n_edges - 1,) between edges of the undeformed surface."""
    before = _edge_normal(surface.X, surface, 1.0)[:, :-1]
    after = _edge_normal(surface.X, surface, -1.0)[:, 1:]
    return np.asarray((before * after).sum(axis=0))


def end_turns(x: Array, surface: Surface) -> Array:
    """Return the rotations of `end_normals`, counter-clockwise, by displacements [1/mm].

    Shape (2, n_edges, 3, k, 2): at starts and ends, by the k nodes of the edge before, of the edge
    itself, and of the edge after it.
    """
    edges, half = surface.edges, (_meets(surface) > _CORNER)[:, None, None] / 2

    def turns(xi: float) -> Array:
        d = shape_derivatives(np.array(xi), edges.shape[1])
        t = x[:, edges] @ d
        each = np.stack([-t[1], t[0]], axis=1) / (t**2).sum(axis=0)[:, None]
        return np.asarray(each[:, None] * d[:, None])

    start, end = turns(-1.0), turns(1.0)
    out = np.zeros((2, len(edges), 3, edges.shape[1], 2))
    out[:, :, 1] = start, end
    out[0, 1:, 0], out[1, :-1, 2] = half * end[:-1], half * start[1:]
    out[0, 1:, 1] -= half * start[1:]
    out[1, :-1, 1] -= half * end[:-1]
    return out


def is_smooth(surface: Surface) -> bool:
    """Whether its edges meet without kinks, so that their own normals may be those of forces."""
    return bool((_meets(surface) > np.cos(np.radians(_KINK))).all())


def is_curved(surface: Surface) -> bool:
    """Whether the normal changes along a surface before any load."""
    n = np.hstack([_edge_normal(surface.X, surface, xi) for xi in (-1.0, 1.0)])
    return bool(np.ptp(n, axis=1).max() > _STRAIGHT)
