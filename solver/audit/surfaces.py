"""Contact measured on the bodies: gaps, slips, and the nodal forces of contact.

Surfaces are in their deformed positions, and gaps are distances along the slave's normals to the
nearest place of the partner; the derivative rows of the contact problem are not used. Means are
those under the hats of the slave's vertices, to which contact forces belong.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from solver.audit.plain import load_factor
from solver.contact.geometry import is_curved
from solver.contact.overlap import largest_overlap
from solver.contact.state import State
from solver.contact.system import System
from solver.fem.nodes import vectors
from solver.fem.rigid import RigidPart
from solver.fem.surface import Surface
from solver.fem.wheel import Wheel
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.model.pairs import ContactPair
from solver.typing import Array, Bools, Ints

_XI, _WEIGHT = np.polynomial.legendre.leggauss(4)
_NEWTON_STEPS = 5
_BLOCK = 1000
"""Number of points processed at once, each with every edge."""
_CORNER = float(np.radians(40.0))
"""Angle between the normals of two edges: they form a corner at a larger angle."""
_OPPOSED = 0.25
"""Cosine of the angle between surfaces that face each other, at least."""
_NO_TANGENT = 1e-9
"""Tangent over the length of an edge: a shorter one is rounding."""
_STRAIGHT = 1e-6
"""Change of the normals along a straight surface [rad], at most."""
_SHARE = 0.05
"""Force of a patch of contact over that of its pair: weaker patches are ignored."""
_BESIDE = 1e-9
"""Distance of a line from the end of an edge over its length: up to it the line intersects the
edge."""


def deformed(system: System, name: str, state: State) -> tuple[Array, Array]:
    """Return the positions of the nodes of a whole body (2, n) [mm], and its rotation (2, 2)."""
    part, u = system.parts[system.part(name)], state.u[system.part(name)]
    if isinstance(part, RigidPart):
        x, y, angle = part.motion_of(u)
        return _turned(part.nodes, part.frame.centre, angle, (x, y)), np.eye(2)
    whole = system.full(name)
    d = vectors(system.displacement(name, state), whole.dim)
    if not isinstance(part, Wheel):
        return whole.X + d, np.eye(2)
    at = part.motion_of(u)
    return _turned(whole.X + d, part.frame.centre, at.rotation, (at.x, at.y)), _rotation(
        at.rotation
    )


def _rotation(angle: float) -> Array:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def _turned(x: Array, centre: Array, angle: float, moved: tuple[float, float]) -> Array:
    """Return points (2, n) after a rotation about a centre and a displacement [mm]."""
    from_centre = _rotation(angle) @ (x - centre[:, None])
    return np.asarray(from_centre + (centre + np.array(moved))[:, None])


@dataclass(frozen=True)
class PairState:
    """One pair in one state.

    Attributes
    ----------
    area : (n,) integral of the hat of a slave vertex where the master faces it [mm2]
    gap : (n,) mean gap under the hat in the kinematics of the pair, NaN without a partner [mm]
    true_gap : (n,) mean gap of the deformed bodies, from which small sliding may differ [mm]
    slip : (n,) mean slip of the increment [mm]
    way : (n,) mean motion of the slave along the master since the beginning [mm]
    strength : (n,) mean shear yield stress of the weaker body under the hat, at the temperature of
        the state; inf between elastic bodies [MPa]
    edge : (n,) mean length of the edges at a vertex [mm]
    point_gap : (n_points,) gap of the deformed bodies at points of the slave, inf where no master
        faces it [mm]
    point_length : (n_points,) length of the slave that belongs to each point [mm]
    on_slave, on_master : nodal forces (n_nodes, 2) equivalent to the contact forces [N]
    """

    area: Array
    gap: Array
    true_gap: Array
    slip: Array
    way: Array
    strength: Array
    edge: Array
    point_gap: Array
    point_length: Array
    on_slave: Array
    on_master: Array


class Surfaces:
    """The two surfaces of a contact pair, on the whole bodies."""

    def __init__(self, system: System, number: int, *, finite: bool) -> None:
        self._system = system
        self.pair: ContactPair = system.model.contacts[number]
        self.finite = finite
        pair = self.pair
        self.slave, self.master = (
            system.chain(name, boundary) for name, boundary in (pair.slave, pair.master)
        )

        self.curved = is_curved(self.slave) or is_curved(self.master)
        self._along_master = system.interfaces[number].along_master
        bodies = [system.model.body(name) for name, _ in (pair.slave, pair.master)]
        self._overlap = largest_overlap(*bodies)
        narrow = [float(body.box.min()) for body in bodies]
        self._thickness = narrow[0] if np.isfinite(narrow[0]) else narrow[1]

    def _at(self, state: State) -> tuple[Array, Array]:
        (slave, _), (master, _) = self.pair.slave, self.pair.master
        xs, xm = (deformed(self._system, name, state)[0] for name in (slave, master))
        return _on(self.slave, xs), _on(self.master, xm)

    def coarseness(self, state: State, normal: Array) -> float:
        """Return the longest edge over the width of the contact, of the worst patch.

        ``normal`` (n,) are the normal forces [N]. Patches are curved and have more than the share
        `_SHARE` of the force; 0 without any. At the axis, or at a support on a plane of symmetry,
        the width includes the other half of a patch.
        """
        xs, xm = self._at(state)
        closed, halved = normal > 0, self._halved()
        closed[[0, -1]] |= closed[[1, -2]] & halved  # at the axis the hat is small, and its force
        closed[1:-1] |= closed[:-2] & closed[2:]  # one open vertex does not divide a contact
        bounds = np.flatnonzero(np.diff(np.pad(closed.astype(int), 1)))
        worst = 0.0
        for first, end in zip(bounds[::2], bounds[1::2], strict=True):
            patch = np.arange(first, end)
            if normal[patch].sum() < _SHARE * normal.sum():
                continue
            corners = xm[:, self.master.vertices]
            at = xs[:, self.slave.vertices[patch]]
            near = np.linalg.norm(corners[:, :, None] - at[:, None], axis=0).argmin(axis=0)
            sides = ((self.pair.slave, self.slave, patch), (self.pair.master, self.master, near))
            if not any(_bent(chain, vertices) for _, chain, vertices in sides):
                continue
            longest = max(  # edges of rigid surfaces are left out
                float(chain.spacing[vertices].max())
                for (name, _), chain, vertices in sides
                if name in self._system.names
            )
            mirrored = (halved & [first == 0, end == len(closed)]).any()
            width = float(self.slave.tributary[patch].sum()) * (2 if mirrored else 1)
            worst = max(worst, longest / width)
        return worst

    def _halved(self) -> Bools:
        """Return whether the slave ends at the axis or a plane of symmetry, for both ends (2,).

        At a plane of symmetry a support holds the end along the surface, but not across.
        """
        name, _ = self.pair.slave
        if name not in self._system.names:
            return np.zeros(2, dtype=bool)
        whole = self._system.full(name)
        held = np.ones(whole.n, dtype=bool)
        held[whole.free] = False
        ends = vectors(held, 2).T[self.slave.nodes[self.slave.vertices[[0, -1]]]]
        first, last = _at_ends(self.slave.X, self.slave)
        along = np.abs(np.stack([first[:, 0], last[:, -1]])).argmin(axis=1)
        return np.asarray(ends[[0, 1], along] & ~ends[[0, 1], 1 - along])

    def _weaker(
        self,
        time: float,
        mean: Callable[[Array, Array], Array],
        on_slave: Callable[[Array], Array],
        partner: _Partner,
    ) -> Array:
        """Return the mean shear yield stress (n,) of the weaker body under the hats [MPa].

        ``mean`` returns the means under the hats of values at points, ``on_slave`` the values at
        points of a nodal field of the slave.
        """
        weaker = np.full(len(self.slave.edges) + 1, np.inf)
        for (name, _), chain, at_points in (
            (self.pair.slave, self.slave, on_slave), (self.pair.master, self.master, partner.of),
        ):  # fmt: skip
            body = self._system.model.body(name)
            if body.material.elastic:
                continue
            ratio = np.ones((1, len(chain.nodes)))
            for load in body.every_load if name in self._system.names else ():  # not if rigid
                lost = load.softening(self._system.full(name).X[:, chain.nodes])
                if lost is not None:
                    ratio -= load_factor(load.amplitude, time) * lost[1]
            strength = body.material.shear_yield_stress
            weaker = np.fmin(weaker, strength * mean(at_points(ratio)[0], partner.faces))
        return weaker

    def measured(self, state: State, start: State, normal: Array, tangential: Array) -> PairState:
        """Return the pair in ``state``, after ``start``, with the given contact forces (n,) [N]."""
        slave, master = self.slave, self.master
        (xs, xm), (xs0, xm0) = self._at(state), self._at(start)
        small = not self.finite
        edges, xi, length = _points(
            slave, slave.X if small else xs, master, master.X if small else xm
        )
        N = shape_functions(xi, slave.edges.shape[1])
        nodes = slave.edges[edges]

        def on_slave(x: Array) -> Array:
            return np.asarray((x[:, nodes] * N).sum(axis=-1))

        n = _normals(xs, slave, edges, xi)
        true = partner = _Partner(xm, master, on_slave(xs), n, self._thickness / 2)
        if small:  # positions and normals are those before loading
            n = _normals(slave.X, slave, edges, xi)
            partner = _Partner(master.X, master, on_slave(slave.X), n, self._overlap)
        if self.pair.presence is not None and not load_factor(self.pair.presence, state.time):
            true.faces, partner.faces = 0 * true.faces, 0 * partner.faces  # an absent pair
        push = partner.inward(xm) if self.finite and self._along_master else n
        t = np.stack([-push[1], push[0]])
        apart = partner.of(xm) - on_slave(xs)
        moved = on_slave(xs - xs0) - partner.of(xm - xm0)
        since = on_slave(xs - slave.X) - partner.of(xm - master.X)

        along = slave.X[:, nodes] * shape_derivatives(xi, slave.edges.shape[1])
        length = length * np.linalg.norm(along.sum(axis=-1), axis=0)
        weight = length * slave.depth(on_slave(slave.X))
        hats = np.stack([(1 - xi) / 2, (1 + xi) / 2]) * weight
        ends = np.stack([edges, edges + 1])
        count = len(slave.edges) + 1

        def total(values: Array) -> Array:
            return np.bincount(ends.ravel(), (hats * values).ravel(), count).astype(float)

        def mean(values: Array, where: Array) -> Array:
            of = total(where)
            return np.divide(total(where * values), of, out=np.full(count, np.nan), where=of > 0)

        area = total(partner.faces)
        safe = np.where(area > 0, area, 1.0)
        pressure, shear = ((hats * (f / safe)[ends]).sum(axis=0) for f in (normal, tangential))
        force = partner.faces * (-pressure * push + shear * t)
        true_gap = true.distance(on_slave(xs))
        factor = load_factor(self.pair.amplitude, state.time)
        offset = self.pair.gap - factor * self.pair.interference
        return PairState(
            area=area,
            gap=mean((apart * n).sum(axis=0), partner.faces) + offset,
            true_gap=mean(true_gap, true.faces) + offset,
            slip=mean((moved * t).sum(axis=0), partner.faces),
            way=mean((since * t).sum(axis=0), partner.faces),
            strength=self._weaker(state.time, mean, on_slave, partner),
            edge=slave.spacing,
            point_gap=np.where(true.faces > 0, true_gap + offset, np.inf),
            point_length=length,
            on_slave=_spread(force, nodes, N, len(slave.nodes)),
            on_master=_spread(-force, partner.nodes, partner.shape, len(master.nodes)),
        )


def _points(slave: Surface, xs: Array, master: Surface, xm: Array) -> tuple[Ints, Array, Array]:
    """Return edge, coordinate on it and weight of the integration points (n,) on the slave.

    Edges are cut opposite the master's vertices, where the integrand has kinks, along the master's
    normals; where surfaces touch, these are also those of the slave.
    """
    last = len(master.edges) - 1
    corners = np.append(np.arange(len(master.edges)), last)
    ends = np.append(np.full(len(master.edges), -1.0), 1.0)
    outward = _normals(xm, master, corners, ends)
    opposite = _Partner(xs, slave, xm[:, master.vertices], outward, np.inf)
    cut = opposite.faces > 0
    whole = np.arange(len(slave.edges))
    owner = np.concatenate([whole, whole, opposite.edge[cut]])
    place = np.concatenate([np.full(len(whole), -1.0), np.ones(len(whole)), opposite.eta[cut]])
    order = np.lexsort((place, owner))
    owner, place = owner[order], place[order]
    within = owner[1:] == owner[:-1]
    middle = (place[1:] + place[:-1])[within] / 2
    half = (place[1:] - place[:-1])[within] / 2
    xi = (middle[:, None] + half[:, None] * _XI).ravel()
    return np.repeat(owner[1:][within], len(_XI)), xi, (half[:, None] * _WEIGHT).ravel()


def _on(surface: Surface, x: Array) -> Array:
    return np.asarray(x[:, surface.nodes])


def _spread(force: Array, nodes: Ints, shape: Array, count: int) -> Array:
    """Return nodal forces (count, 2) from point forces (2, n) by shape functions (n, k)."""
    return np.stack(
        [np.bincount(nodes.ravel(), (f[:, None] * shape).ravel(), count) for f in force], axis=1
    )


def _bent(surface: Surface, vertices: Ints) -> bool:
    """Whether the undeformed surface is curved next to vertices; a corner is not curved."""
    first, last = _at_ends(surface.X, surface)
    within = np.pad(np.linalg.norm(last - first, axis=0), 1)
    turn = np.linalg.norm(first[:, 1:] - last[:, :-1], axis=0)
    turn = np.pad(np.where(turn < 2 * np.sin(_CORNER / 2), turn, 0.0), 1)
    bend = np.max([within[:-1], within[1:], turn], axis=0)
    return bool((bend[vertices] > _STRAIGHT).any())


def _normals(x: Array, surface: Surface, edges: Ints, xi: Array) -> Array:
    """Return unit normals (2, n), interpolated between the ends of the edges.

    Neighbouring edges share their mean normal, except at corners of the undeformed surface.
    """
    first, last = _at_ends(x, surface)
    into, out_of = _at_ends(surface.X, surface)
    turn = np.arccos(np.clip((out_of[:, :-1] * into[:, 1:]).sum(axis=0), -1.0, 1.0))
    mean = last[:, :-1] + first[:, 1:]
    shared = np.where(turn < _CORNER, mean / np.linalg.norm(mean, axis=0), np.nan)
    first[:, 1:] = np.where(np.isnan(shared), first[:, 1:], shared)
    last[:, :-1] = np.where(np.isnan(shared), last[:, :-1], shared)
    n = (1 - xi) / 2 * first[:, edges] + (1 + xi) / 2 * last[:, edges]
    return np.asarray(n / np.linalg.norm(n, axis=0))


def _at_ends(x: Array, surface: Surface) -> tuple[Array, Array]:
    """Return the normals (2, n_edges) of each edge at its start and at its end.

    At the tip of a crack the tangent of the undeformed edge is zero: that between its ends counts.
    """
    each = []
    for xi in (-1.0, 1.0):
        slope = shape_derivatives(np.array(xi), surface.edges.shape[1])
        at_rest = np.linalg.norm(surface.X[:, surface.edges] @ slope, axis=0)
        chord = x[:, surface.edges[:, 1]] - x[:, surface.edges[:, 0]]
        t = np.where(at_rest > _NO_TANGENT * surface.lengths, x[:, surface.edges] @ slope, chord)
        each.append(np.stack([t[1], -t[0]]) / np.linalg.norm(t, axis=0))
    return each[0], each[1]


class _Partner:
    """Intersections of lines through points (2, n) along ``way`` with the outside of a surface.

    It is the nearest one on the line that is at most ``reach`` [mm] behind the point. ``faces``
    (n,) is 1 if there is one, else 0.
    """

    def __init__(self, x: Array, surface: Surface, points: Array, way: Array, reach: float) -> None:
        self.way = way
        corners = x[:, surface.vertices]
        some = [slice(k, k + _BLOCK) for k in range(0, points.shape[1], _BLOCK)]
        met = [_met(corners, points[:, at], way[:, at], reach) for at in some]
        self.edge, start, self.faces = (np.concatenate(part) for part in zip(*met, strict=True))
        # a line that intersects the chord of one edge may intersect the curve of the next
        eta = _foot(x[:, surface.edges[self.edge]], points, way, start)
        onward = np.where(eta > 1.0, 1, np.where(eta < -1.0, -1, 0))
        own = np.clip(self.edge + onward, 0, len(surface.edges) - 1)
        eta = np.where(own != self.edge, -onward.astype(float), eta)
        self.edge, self.nodes = own, surface.edges[own]
        self.eta = np.clip(_foot(x[:, self.nodes], points, way, eta), -1.0, 1.0)
        self.shape = shape_functions(self.eta, self.nodes.shape[1])
        self.point = self.of(x)

    def of(self, field: Array) -> Array:
        """Return the values (2, n) of a nodal field of the surface at the intersections."""
        return np.asarray((field[:, self.nodes] * self.shape).sum(axis=-1))

    def distance(self, points: Array) -> Array:
        """Return the signed distance (n,) from the points to the intersections [mm]."""
        return np.asarray(((self.point - points) * self.way).sum(axis=0))

    def inward(self, x: Array) -> Array:
        """Return the unit normals (2, n) of the surface at the intersections, into its body."""
        slope = shape_derivatives(self.eta, self.nodes.shape[1])
        t = (x[:, self.nodes] * slope).sum(axis=-1)
        return np.stack([-t[1], t[0]]) / np.linalg.norm(t, axis=0)


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[0] * b[1] - a[1] * b[0])


def _met(corners: Array, points: Array, way: Array, reach: float) -> tuple[Ints, Array, Array]:
    """Return the nearest chord (n,) that each line enters, the coordinate on it, and 1 or 0."""
    side = _cross(way[:, :, None], corners[:, None, :] - points[:, :, None])
    chord = np.diff(corners)
    beside = _BESIDE * np.linalg.norm(chord, axis=0)
    first, last = side[:, :-1], side[:, 1:]
    met = np.minimum(first, last) <= beside
    met &= np.maximum(first, last) >= -beside
    met &= _cross(chord[:, None, :], way[:, :, None]) > _OPPOSED * np.linalg.norm(chord, axis=0)
    share = first / np.where(first == last, 1.0, first - last)
    where = corners[:, None, :-1] + share * chord[:, None, :] - points[:, :, None]
    ahead = (where * way[:, :, None]).sum(axis=0)
    distance = np.where(met & (ahead > -reach), np.abs(ahead), np.inf)
    edge = distance.argmin(axis=1)
    at = np.arange(len(edge)), edge
    return edge, np.clip(2 * share[at] - 1, -1.0, 1.0), np.isfinite(distance[at]).astype(float)


def _foot(xe: Array, points: Array, way: Array, eta: Array) -> Array:
    """Return the coordinates of intersections of lines with edges (2, n, k), by Newton's method.

    ``eta`` (n,) are the starting values; edges extend beyond their ends.
    """
    count = xe.shape[-1]
    for _ in range(_NEWTON_STEPS):
        away = (xe * shape_functions(eta, count)).sum(axis=-1) - points
        slope = _cross(way, (xe * shape_derivatives(eta, count)).sum(axis=-1))
        eta = np.clip(eta - _cross(way, away) / np.where(slope == 0, 1.0, slope), -2.0, 2.0)
    return eta
