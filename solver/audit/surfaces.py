"""Contact seen from the bodies alone: true gaps, slips, and the forces the bodies feel.

Surfaces are taken where the bodies are after deformation, large or small, and measured point by
point against the nearest place of the partner; no derivative row of the contact problem is used.
Means are those under the hats of the slave's vertices, which contact forces belong to.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from solver.surface import extract, shape_derivatives, shape_functions
from solver.wheel import Wheel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model import ContactPair
    from solver.state import State
    from solver.surface import Surface
    from solver.system import System

    Array = NDArray[np.float64]

_XI, _WEIGHT = np.polynomial.legendre.leggauss(6)
_SAMPLES = np.linspace(-1.0, 1.0, 9)
_NEWTON_STEPS = 4
_OFF_END = 1e-6
_EDGES = 3
"""Edges a place may be away from the sample nearest to its point."""


def deformed(system: System, name: str, state: State) -> tuple[Array, Array]:
    """Return where the nodes of a whole body are (2, n) [mm], and how it has turned (2, 2)."""
    whole, part = system.full(name), system.parts[system.part(name)]
    d = system.displacement(name, state).reshape(-1, 2).T
    if not isinstance(part, Wheel):
        return whole.X + d, np.eye(2)
    u = state.u[system.part(name)]
    angle, centre = u[part.rim + 2] / part.radius, part.centre[:, None]
    Q = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    hub = u[part.rim : part.rim + 2, None]
    return centre + hub + Q @ (whole.X - centre + d), Q


@dataclass(frozen=True)
class Touching:
    """One pair at one state.

    Attributes
    ----------
    area : (n,) integral of the hat of a slave vertex where the master faces it [mm2]
    gap : (n,) mean of the true gap under the hat, NaN where nothing faces it [mm]
    slip : (n,) mean slip of the increment [mm]
    edge : (n,) mean length of the edges at a vertex [mm]
    on_slave, on_master : nodal forces (n_nodes, 2) that the contact forces amount to [N]
    """

    area: Array
    gap: Array
    slip: Array
    edge: Array
    on_slave: Array
    on_master: Array


class Surfaces:
    """The two surfaces of a contact pair, on the whole bodies."""

    def __init__(self, system: System, pair: ContactPair) -> None:
        self._system = system
        self.pair = pair
        self.slave, self.master = (
            extract(system.full(name), boundary) for name, boundary in (pair.slave, pair.master)
        )

    def _at(self, state: State) -> tuple[Array, Array]:
        (slave, _), (master, _) = self.pair.slave, self.pair.master
        xs, xm = (deformed(self._system, name, state)[0] for name in (slave, master))
        return _on(self.slave, xs), _on(self.master, xm)

    def touching(self, state: State, start: State, normal: Array, tangential: Array) -> Touching:
        """Return the pair at ``state``, reached from ``start``, under given contact forces (n,)."""
        (xs, xm), (xs0, xm0) = self._at(state), self._at(start)
        slave, master = self.slave, self.master
        edges = np.repeat(np.arange(len(slave.edges)), len(_XI))
        xi = np.tile(_XI, len(slave.edges))
        N = shape_functions(xi, slave.edges.shape[1])
        nodes = slave.edges[edges]
        point = (xs[:, nodes] * N).sum(axis=-1)
        n = _normals(xs, slave, edges, xi)
        place = _Partner(xm, master, point)
        gap = ((place.point - point) * n).sum(axis=0)
        faces = place.inside & ((place.normal * n).sum(axis=0) < 0)

        along = slave.X[:, nodes] * shape_derivatives(xi, slave.edges.shape[1])
        depth = (slave.measure[nodes] * N).sum(axis=-1)
        weight = np.tile(_WEIGHT, len(slave.edges)) * depth * faces
        weight *= np.linalg.norm(along.sum(axis=-1), axis=0)
        hats = np.stack([(1 - xi) / 2, (1 + xi) / 2]) * weight
        ends = np.stack([edges, edges + 1])
        count = len(slave.edges) + 1

        def mean(values: Array) -> Array:
            total = np.bincount(ends.ravel(), (hats * values).ravel(), count)
            return np.asarray(np.divide(total, area, out=np.full(count, np.nan), where=area > 0))

        area = np.asarray(np.bincount(ends.ravel(), hats.ravel(), count), dtype=float)
        frame, partner = n, place
        if self.pair.sliding == "small":  # forces act where the bodies faced each other at rest
            frame = _normals(slave.X, slave, edges, xi)
            partner = _Partner(master.X, master, (slave.X[:, nodes] * N).sum(axis=-1), frame)
        t = np.stack([-frame[1], frame[0]])
        moved = ((xs - xs0)[:, nodes] * N).sum(axis=-1) - partner.carried(xm - xm0)
        safe = np.where(area > 0, area, 1.0)
        pressure, shear = ((hats * (f / safe)[ends]).sum(axis=0) for f in (normal, tangential))
        force = -pressure * frame + shear * t
        return Touching(
            area=area,
            gap=mean(gap),
            slip=mean((moved * t).sum(axis=0)),
            edge=_edge_lengths(slave),
            on_slave=_spread(force, nodes, N, len(slave.nodes)),
            on_master=_spread(-force, partner.nodes, partner.shape, len(master.nodes)),
        )


def _on(surface: Surface, x: Array) -> Array:
    return np.asarray(x[:, surface.nodes])


def _spread(force: Array, nodes: NDArray[np.int64], shape: Array, count: int) -> Array:
    """Return nodal forces (count, 2) of point forces (2, n) by shape functions (n, k)."""
    return np.stack(
        [np.bincount(nodes.ravel(), (f[:, None] * shape).ravel(), count) for f in force], axis=1
    )


def _edge_lengths(surface: Surface) -> Array:
    length = np.linalg.norm(np.diff(surface.X[:, surface.vertices]), axis=0)
    return np.asarray((np.append(length, length[-1]) + np.append(length[0], length)) / 2)


def _normals(x: Array, surface: Surface, edges: NDArray[np.int64], xi: Array) -> Array:
    """Return unit normals (2, n): those of the vertices, one-sided at the ends, interpolated."""
    tangents = [
        (x[:, surface.edges] * shape_derivatives(np.array(end), surface.edges.shape[1])).sum(
            axis=-1
        )
        for end in (-1.0, 1.0)
    ]
    first, last = (np.stack([t[1], -t[0]]) / np.linalg.norm(t, axis=0) for t in tangents)
    at = np.hstack([first, last[:, -1:]])
    at[:, 1:-1] += last[:, :-1]
    at /= np.linalg.norm(at, axis=0)
    n = (1 - xi) / 2 * at[:, edges] + (1 + xi) / 2 * at[:, edges + 1]
    return np.asarray(n / np.linalg.norm(n, axis=0))


class _Partner:
    """The places of a surface nearest to points (2, n), or on lines through them along ``way``."""

    def __init__(self, x: Array, surface: Surface, points: Array, way: Array | None = None) -> None:
        count = surface.edges.shape[1]
        samples = x[:, surface.edges] @ shape_functions(_SAMPLES, count).T
        _, nearest = cKDTree(samples.reshape(2, -1).T).query(points.T)
        edge, at = np.divmod(nearest, len(_SAMPLES))
        last, eta = len(surface.edges) - 1, _SAMPLES[at]
        for _ in range(_EDGES):
            eta = _foot(x[:, surface.edges[edge]], points, eta, way)
            # the place may be on the edge before or behind
            onward = np.where(eta > 1.0, 1, np.where(eta < -1.0, -1, 0))
            own = np.clip(edge + onward, 0, last)
            eta = np.where(own != edge, -onward.astype(float), eta)
            edge = own
        self.nodes = surface.edges[edge]
        eta = _foot(x[:, self.nodes], points, eta, way)
        past = ((edge == 0) & (eta < -1 - _OFF_END)) | ((edge == last) & (eta > 1 + _OFF_END))
        self.inside = ~past
        self.shape = shape_functions(np.clip(eta, -1.0, 1.0), count)
        self.point = (x[:, self.nodes] * self.shape).sum(axis=-1)
        along = (x[:, self.nodes] * shape_derivatives(eta, count)).sum(axis=-1)
        self.normal = np.stack([along[1], -along[0]]) / np.linalg.norm(along, axis=0)

    def carried(self, moved: Array) -> Array:
        """Return the displacement (2, n) of the places for those of the surface's nodes."""
        return np.asarray((moved[:, self.nodes] * self.shape).sum(axis=-1))


def _foot(xe: Array, points: Array, eta: Array, way: Array | None) -> Array:
    """Return where on edges (2, n, k), continued beyond their ends, the places are (n,)."""
    count = xe.shape[-1]
    for _ in range(_NEWTON_STEPS):
        away = (xe * shape_functions(eta, count)).sum(axis=-1) - points
        along = (xe * shape_derivatives(eta, count)).sum(axis=-1)
        if way is None:
            bend = 0.0 if count == 2 else xe[..., 0] + xe[..., 1] - 2 * xe[..., 2]
            square = (along * along).sum(axis=0)
            slope = square + (away * bend).sum(axis=0)
            slope = np.where(slope > square / 2, slope, square)
            miss = (away * along).sum(axis=0)
        else:
            miss = way[0] * away[1] - way[1] * away[0]
            slope = way[0] * along[1] - way[1] * along[0]
            slope = np.where(slope == 0, 1.0, slope)
        eta = np.clip(eta - miss / slope, -2.0, 2.0)
    return eta
