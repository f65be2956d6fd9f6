"""Links measured on the bodies: the motion that they should prevent, and the balance of forces.

The conditions of links are not used. At many points the motion of the slave is compared with that
of the nearest place of the master, and of the rigid body.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from solver.audit.plain import LEAST, LEAST_ENERGY
from solver.contact.state import Converged, State
from solver.contact.system import System
from solver.fem.nodes import vectors
from solver.fem.rigid import RigidMotion, RigidPart
from solver.fem.surface import edges_of
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.model.pairs import Link, Side
from solver.typing import Array

_PIECES = 16
"""Number of pieces of an edge; more if edges of the other side are shorter."""
_GAUSS = 6
"""Number of Gauss points of an edge, for normals and areas of nodes."""
_PAIRS = 1_000_000
"""Number of places times pieces of the other side in memory at a time: 64 MB."""
_FACING = 0.05
"""Distance of the slave from the master over its length: a place of the slave above this ratio
faces no master."""
_HALVINGS = 20
"""Number of halvings of a piece to find the end of the master opposite it."""
_BEYOND = 1e-6
"""Distance of a place beyond the end of a piece, over its length: up to it the place belongs to the
piece."""
_STILL = 1e-9
"""Motion of a boundary over the largest one of its body: a smaller one is rounding."""
_SMALL = 0.1
"""Largest rotation by links [rad]; as a linear displacement it stretches by half its square, 0.5 %.
"""


class _Sampled(NamedTuple):
    """Pieces of a boundary.

    Middles X (2, n), their motion u (2, n) [mm] and area (n,) [mm2]; ``ends`` (2, 2, n) are starts
    and ends, ``moved`` (2, 2, n) their motions.
    """

    X: Array
    u: Array
    area: Array
    ends: Array
    moved: Array


def links_error(system: System, converged: Converged) -> float:
    """Return the worst relative motion that links should prevent, or relative force imbalance."""
    level = converged.state.force_scale or 1.0
    return max(
        (max(_misfit(system, k, converged), _unbalanced(system, k, converged) / level)
         for k, _ in enumerate(system.model.links)),
        default=0.0,
    )  # fmt: skip


def _places(
    system: System, side: Side, converged: Converged, opposite: _Sampled | None = None
) -> _Sampled:
    """Return the pieces of a boundary, in the mean no longer than those of the ``opposite`` one."""
    name, boundary = side
    whole = system.full(name)
    edges, count = edges_of(whole, boundary), _PIECES
    if opposite is not None:
        long = np.linalg.norm(whole.X[:, edges[:, 1]] - whole.X[:, edges[:, 0]], axis=0) / count
        short = np.linalg.norm(opposite.ends[1] - opposite.ends[0], axis=0)
        count *= math.ceil(max(float(long.mean() / short.mean()), 1.0))
    ends = np.linspace(-1.0, 1.0, count + 1)
    moved = vectors(system.displacement(name, converged.state), 2)

    def at(xi: Array, field: Array) -> Array:
        return np.asarray(field[:, edges] @ shape_functions(xi, edges.shape[1]).T)

    def pieces(field: Array) -> Array:
        along = at(ends, field)
        return np.stack([each.reshape(2, -1) for each in (along[..., :-1], along[..., 1:])])

    middle, outline = (ends[1:] + ends[:-1]) / 2, pieces(whole.X)
    X, u = at(middle, whole.X), at(middle, moved)
    length = np.linalg.norm(outline[1] - outline[0], axis=0).reshape(X.shape[1:])
    area = (length * whole.measure(X)).ravel()
    return _Sampled(X.reshape(2, -1), u.reshape(2, -1), area, outline, pieces(moved))


def least_energy(system: System, force: float) -> float:
    """Return the rounding level of energy [N mm] if links hold bodies, else 0.

    Without it a condensed body of which links hold all unknowns would have the level zero.
    """
    held = {link.slave[0] for link in system.model.links}
    return LEAST_ENERGY * force * max((_moved_by(system, name, force) for name in held), default=0)


def turned(system: System, converged: Converged) -> tuple[str, ...]:
    """Return messages on rigid bodies that rotate boundaries too far for links."""
    found = []
    small = (link for link in system.model.links if not _turns(system, link))
    for name in dict.fromkeys(link.rigid for link in small if link.rigid):
        angle = abs(_motion(system, name, converged).rotation)
        if not angle <= _SMALL:
            found.append(
                f"{name} rotates its linked boundaries by {angle:.2g} rad: links assume small "
                f"rotations, and stretch them by {angle**2 / 2:.2g}; reduce the rotation"
            )
    return tuple(found)


def _rigid(system: System, name: str) -> RigidPart:
    part = system.parts[system.part(name)]
    assert isinstance(part, RigidPart)
    return part


def _motion(system: System, name: str, converged: Converged) -> RigidMotion:
    return _rigid(system, name).motion_of(converged.state.u[system.part(name)])


def _turns(system: System, link: Link) -> bool:
    """Whether a link turns with its rigid body, exactly."""
    return system.full(link.slave[0]).body.turned_by(link)


def _carried(system: System, link: Link, X: Array, converged: Converged) -> tuple[Array, Array]:
    """Return the motion (2, n) of places X with the rigid body of a link, and its axes (2, 2)."""
    assert link.rigid is not None
    x, y, angle = _motion(system, link.rigid, converged)
    arm = X - np.reshape(_rigid(system, link.rigid).body.centre, (2, 1))
    if not _turns(system, link):
        return np.array([x - angle * arm[1], y + angle * arm[0]]), np.eye(2)
    turn = np.exp(1j * angle)
    moved = (turn - 1) * (arm[0] + 1j * arm[1]) + (x + 1j * y)
    axes = np.array([[turn.real, turn.imag], [-turn.imag, turn.real]])
    return np.array([moved.real, moved.imag]), axes


def _forces(system: System, k: int, converged: Converged, name: str) -> tuple[Array, Array]:
    """Return the resultant (2,) [N] and the moment [N mm] of a link on a body."""
    own = np.where(system.links.whose == k, converged.state.links, 0.0)
    moves = _turns(system, system.model.links[k])
    return resultant(system, converged.state, own, name, moves=moves)


def resultant(
    system: System, state: State, own: Array, name: str, *, moves: bool = False
) -> tuple[Array, Array]:
    """Return the resultant (2,) [N] and the moment [N mm] on a body of link forces (c,) [N].

    Forces act at the places before loading, or at the present ones if the body ``moves``.
    """
    number, part = system.part(name), system.parts[system.part(name)]
    force = system.links.at(state.u).on_part(number, own, part.n)
    if isinstance(part, RigidPart):
        x, y = part.frame.centre + moves * state.u[number][:2]
        turning = force[2] * part.frame.radius + x * force[1] - y * force[0]
        return force[:2], np.asarray(turning)
    nodal, X = vectors(part.on_whole(force), 2), system.full(name).X
    if moves:
        X = X + vectors(system.displacement(name, state), 2)
    return nodal.sum(axis=1), np.asarray((X[0] * nodal[1] - X[1] * nodal[0]).sum())


def _unbalanced(system: System, k: int, converged: Converged) -> float:
    """Return the sum of the forces of a link on slave and partners, moments over their size [N].

    With a master and a rigid body, the force on either is opposite to that on the slave. Forces of
    a tie act on both surfaces: their moment across a gap, as between coarse arcs, is subtracted.
    """
    link = system.model.links[k]
    size = float(np.abs(system.full(link.slave[0]).X).max())
    partners = [name for name in (link.master and link.master[0], link.rigid) if name]
    worst, arm = 0.0, 0.0
    if link.master is not None:
        slave, master = (_places(system, side, converged) for side in link.sides)
        far, _ = _facing(slave.X, master)
        arm = float(far.max(initial=0.0, where=far < _reach(slave.X)))
    across_gap = arm / size * converged.state.force_scale
    force, moment = _forces(system, k, converged, link.slave[0])
    for name in partners:  # in a tie within one body the force is already the sum of both sides
        same = name == link.slave[0]
        other, its = (0.0, 0.0) if same else _forces(system, k, converged, name)
        turning = 0.0 if _is_ring(system, link) else abs(float(moment + its)) / size - across_gap
        worst = max(worst, float(np.abs(force + other).max()), turning)
    return worst


def _misfit(system: System, k: int, converged: Converged) -> float:
    """Return the motion that a link should prevent over the largest motion of its sides."""
    link: Link = system.model.links[k]
    others, master = [], link.master and _places(system, link.master, converged)
    slave = _places(system, link.slave, converged, master)
    if master is not None:
        slave = _opposite(slave, master)
        others.append(_facing(slave.X, master)[1])
    X, u, area, *_ = slave
    frame = np.eye(2)
    if link.rigid is not None:
        carried, frame = _carried(system, link, X, converged)
        others.append(carried)
    size = max(float(np.abs(each).max()) for each in (u, *others))
    size = max(size, LEAST * _moved_by(system, link.slave[0], converged.state.force_scale))
    size = max(
        size, _STILL * float(np.abs(system.displacement(link.slave[0], converged.state)).max())
    )
    if not size:
        return 0.0
    sprung = np.isfinite(link.stiffness)
    if link.local or (sprung and link.master is None):
        return _misfit_at_nodes(system, k, converged, size)
    axes = [1] if _is_ring(system, link) else list(link.axes)
    jump = (frame @ (u - sum(others, np.zeros_like(u))))[axes]
    if link.master is None and not link.distributed:
        jump = jump - jump[:, :1] if link.rigid is None else jump
        return float(np.abs(jump).max()) / size
    mean = (jump * area).sum(axis=1)
    if sprung:
        mean = mean + _forces(system, k, converged, link.slave[0])[0][axes] / link.stiffness
    return float(np.abs(mean).max()) / area.sum() / size


def _misfit_at_nodes(system: System, k: int, converged: Converged, size: float) -> float:
    """Return the motion that springs, or a link along normals, should prevent, over ``size``.

    It is measured node by node, as these links act: around a hole the forces of springs may have no
    resultant.
    """
    link = system.model.links[k]
    name, boundary = link.slave
    whole, edges = system.full(name), edges_of(system.full(name), boundary)
    nodes, local = np.unique(edges, return_inverse=True)
    local = local.reshape(edges.shape)
    X, u = whole.X[:, nodes], vectors(system.displacement(name, converged.state), 2)[:, nodes]
    xi, weights = np.polynomial.legendre.leggauss(_GAUSS)
    shapes = shape_functions(xi, edges.shape[1])
    along = X[:, local] @ shape_derivatives(xi, edges.shape[1]).T * weights
    depth = whole.measure(X[:, local] @ shapes.T)
    area, x, y = (
        np.bincount(local.ravel(), (each @ shapes).ravel())
        for each in (np.hypot(*along) * depth, *along)
    )
    ways = np.eye(2)[list(link.axes), :, None] + np.zeros_like(X)
    if link.local:
        ways = np.array([[y, -x] if link.components == "normal" else [x, y]]) / np.hypot(x, y)
    if link.rigid is not None:
        carried, frame = _carried(system, link, X, converged)
        u, ways = u - carried, np.einsum("ji,kjn->kin", frame, ways)
    jump = (ways * u).sum(axis=1)
    if np.isfinite(link.stiffness):
        own = np.where(system.links.whose == k, converged.state.links, 0.0)
        part = system.parts[system.part(name)]
        joins = system.links.at(converged.state.u)
        force = part.on_whole(joins.on_part(system.part(name), own, part.n))
        force = vectors(force, 2)[:, nodes] / link.stiffness
        off = area * (jump[:, None] * ways).sum(axis=0) + force
        return float(np.hypot(*off).sum()) / area.sum() / size
    return float(np.abs(jump if link.rigid else jump - jump[:, :1]).max()) / size


def _opposite(slave: _Sampled, master: _Sampled) -> _Sampled:
    """Return the parts of the slave's pieces that face the master."""
    most, (start, end) = _reach(slave.X), slave.ends
    begins, stops = (_facing(X, master)[0] < most for X in (start, end))
    cut = np.flatnonzero(begins != stops)
    kept = np.where(begins[cut], 0.0, 1.0)  # coordinate of the end that faces the master
    inside, outside = kept, 1 - kept
    for _ in range(_HALVINGS):
        middle = (inside + outside) / 2
        faces = _facing((1 - middle) * start[:, cut] + middle * end[:, cut], master)[0] < most
        inside, outside = np.where(faces, middle, inside), np.where(faces, outside, middle)
    share = (inside + kept) / 2
    X, u, area = slave.X.copy(), slave.u.copy(), np.where(begins | stops, slave.area, 0.0)
    for at, (first, last) in ((X, slave.ends), (u, slave.moved)):
        at[:, cut] = (1 - share) * first[:, cut] + share * last[:, cut]
    area[cut] *= np.abs(inside - kept)
    return slave._replace(X=X, u=u, area=area)


def _is_ring(system: System, link: Link) -> bool:
    """Whether a link holds the mean motion of a ring, which is its motion along the axis."""
    return link.distributed and system.full(link.slave[0]).body.kinematics == "axisymmetric"


def _reach(X: Array) -> float:
    """Return the distance up to which places of a slave at X (2, n) face its master [mm]."""
    return _FACING * float(np.ptp(X, axis=1).max())


def _facing(X: Array, master: _Sampled) -> tuple[Array, Array]:
    """Return the distance (n,) of places (2, n) from a master, and its motion (2, n) there.

    The distance is infinite beyond an end of the master.
    """
    count = max(_PAIRS // master.X.shape[1], 1)
    each = [_facing_few(X[:, k : k + count], master) for k in range(0, max(X.shape[1], 1), count)]
    away, moved = zip(*each, strict=True)
    return np.concatenate(away), np.hstack(moved)


def _facing_few(X: Array, master: _Sampled) -> tuple[Array, Array]:
    """Return the result of `_facing`, from the distances of all places from all pieces."""
    begin, end = master.ends
    along = end - begin
    share = (X.T @ along - (begin * along).sum(axis=0)) / (along**2).sum(axis=0)
    inside = share.clip(0.0, 1.0)
    away = np.linalg.norm(X[:, :, None] - begin[:, None] - inside * along[:, None], axis=0)
    row, nearest = np.arange(X.shape[1]), away.argmin(axis=1)
    share, inside = share[row, nearest], inside[row, nearest]
    shapes = (1 - inside) * (1 - 2 * inside), 4 * inside * (1 - inside), inside * (2 * inside - 1)
    each = (master.moved[0], master.u, master.moved[1])
    moved = sum(u[:, nearest] * shape for u, shape in zip(each, shapes, strict=True))
    return np.where(np.abs(share - inside) < _BEYOND, away[row, nearest], np.inf), np.asarray(moved)


def _moved_by(system: System, name: str, force: float) -> float:
    """Return the displacement that a force causes at the stiffest node of a body [mm]."""
    return force / float(system.full(name).elastic_matrix().diagonal().max())
