"""Links measured on the bodies: what they should prevent, and the balance of their forces.

Their conditions are not used. The motion of the slave is compared at many points with that of the
nearest place of the master, and of the rigid body.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.contact.system import LEAST
from solver.fem.rigid import RigidPart
from solver.fem.surface import edges_of
from solver.mesh.edges import shape_functions

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.contact.state import Converged, State
    from solver.contact.system import System
    from solver.model.link import Link, Side

    Array = NDArray[np.float64]

_PIECES = 16
"""Number of pieces of an edge."""
_FACING = 0.05
"""Ratio of the distance from the master to the length of the slave; above it a place of the slave
faces no master."""


class _Sampled(NamedTuple):
    """Middles X (2, n) of the pieces of a boundary, their motion u (2, n) [mm] and area (n,)."""

    X: Array
    u: Array
    area: Array


def links_error(system: System, converged: Converged) -> float:
    """Return the worst ratio of a motion that links should prevent, or of force out of balance."""
    level = converged.state.force_scale or 1.0
    return max(
        (max(_misfit(system, k, converged), _unbalanced(system, k, converged) / level)
         for k, _ in enumerate(system.model.links)),
        default=0.0,
    )  # fmt: skip


def _places(system: System, side: Side, converged: Converged) -> _Sampled:
    name, boundary = side
    whole = system.full(name)
    edges = edges_of(whole, boundary)
    ends = np.linspace(-1.0, 1.0, _PIECES + 1)
    moved = system.displacement(name, converged.state).reshape(-1, 2).T

    def at(xi: Array, field: Array) -> Array:
        return np.asarray(field[:, edges] @ shape_functions(xi, edges.shape[1]).T)

    middle = (ends[1:] + ends[:-1]) / 2
    X = at(middle, whole.X)
    length = np.linalg.norm(np.diff(at(ends, whole.X), axis=2), axis=0)
    area = length * whole.measure(X)
    return _Sampled(X.reshape(2, -1), at(middle, moved).reshape(2, -1), area.ravel())


def linked(system: System, state: State, name: str) -> Array:
    """Return the resultant (2,) of the forces of all links on a body [N]."""
    return _resultant(system, state.links, name)[0]


def _forces(system: System, k: int, converged: Converged, name: str) -> tuple[Array, Array]:
    """Return the forces of a link on a body, resultant (2,) [N], and their moment [N mm]."""
    own = np.where(system.links.whose == k, converged.state.links, 0.0)
    return _resultant(system, own, name)


def _resultant(system: System, own: Array, name: str) -> tuple[Array, Array]:
    """Return resultant (2,) [N] and moment [N mm] on a body of forces of conditions (c,)."""
    links, number = system.links, system.part(name)
    part = system.parts[number]
    force = links.on_part(number, own, part.n)
    if isinstance(part, RigidPart):
        x, y = part.frame.centre
        turning = force[2] * part.frame.radius + x * force[1] - y * force[0]
        return force[:2], np.asarray(turning)
    nodal, X = part.on_whole(force).reshape(-1, 2).T, system.full(name).X
    return nodal.sum(axis=1), np.asarray((X[0] * nodal[1] - X[1] * nodal[0]).sum())


def _unbalanced(system: System, k: int, converged: Converged) -> float:
    """Return the sum of the forces of a link on slave and partners, moments over their size [N].

    With a master and a rigid body, the force on either is opposite to that on the slave. Forces of
    a tie act on either surface: their moment across a gap, as between coarse arcs, is left out.
    """
    link = system.model.links[k]
    size = float(np.abs(system.full(link.slave[0]).X).max())
    partners = [name for name in (link.master and link.master[0], link.rigid) if name]
    worst, arm = 0.0, 0.0
    if link.master is not None:
        slave, master = (_places(system, side, converged) for side in link.sides)
        far, _ = _facing(slave.X, master)
        arm = float(far.max(initial=0.0, where=far < _beside(slave.X)))
    left = arm / size * converged.state.force_scale
    force, moment = _forces(system, k, converged, link.slave[0])
    for name in partners:  # in a tie within one body, the force is that on both sides
        same = name == link.slave[0]
        other, its = (0.0, 0.0) if same else _forces(system, k, converged, name)
        turning = max(abs(float(moment + its)) / size - left, 0.0)
        worst = max(worst, float(np.abs(force + other).max()), turning)
    return worst


def _misfit(system: System, k: int, converged: Converged) -> float:
    """Return the motion that a link should prevent over the largest motion of what it joins."""
    link: Link = system.model.links[k]
    slave = _places(system, link.slave, converged)
    X, u, area = slave
    others = [np.zeros_like(u)]
    if link.master is not None:
        master = _places(system, link.master, converged)
        far, at_master = _facing(X, master)
        area = np.where(far < _beside(X), area, 0.0)
        others.append(at_master)
    if link.rigid is not None:
        number = system.part(link.rigid)
        x, y, angle = system.parts[number].motion_of(converged.state.u[number])  # type: ignore[attr-defined]
        arm = X - np.reshape(system.parts[number].body.centre, (2, 1))  # type: ignore[union-attr]
        others.append(np.array([x - angle * arm[1], y + angle * arm[0]]))
    size = max(float(np.abs(each).max()) for each in (u, *others))
    size = max(size, LEAST * _moved_by(system, link.slave[0], converged.state.force_scale))
    jump = (u - sum(others))[list(link.axes)]
    if not size:
        return 0.0
    if link.master is None and not link.distributed and np.isinf(link.stiffness):
        jump = jump - jump[:, :1] if link.rigid is None else jump
        return float(np.abs(jump).max()) / size
    mean = (jump * area).sum(axis=1)
    if np.isfinite(link.stiffness):
        mean = (
            mean + _forces(system, k, converged, link.slave[0])[0][list(link.axes)] / link.stiffness
        )
    return float(np.abs(mean).max()) / area.sum() / size


def _beside(X: Array) -> float:
    """Return the distance up to which places of a slave at X (2, n) face its master [mm]."""
    return _FACING * float(np.ptp(X, axis=1).max())


def _facing(X: Array, master: _Sampled) -> tuple[Array, Array]:
    """Return the distance (n,) of places (2, n) from a master, and its motion (2, n) there.

    The motion is linear between the two nearest of its places.
    """
    away = np.linalg.norm(X[:, :, None] - master.X[:, None, :], axis=0)
    one, other = np.argsort(away, axis=1)[:, :2].T
    along = master.X[:, other] - master.X[:, one]
    share = ((X - master.X[:, one]) * along).sum(axis=0) / (along**2).sum(axis=0)
    moved = master.u[:, one] + share * (master.u[:, other] - master.u[:, one])
    return np.linalg.norm(X - master.X[:, one] - share * along, axis=0), moved


def _moved_by(system: System, name: str, force: float) -> float:
    """Return the displacement that a force causes at the stiffest node of a body [mm]."""
    return force / float(system.full(name).elastic_matrix().diagonal().max())
