"""How contact forces turn and move with the surfaces that they act on.

At a point of the slave, the forces N and T of contact push with ``p = N n + T t`` on the master,
and with -p on the slave; n is the normal of the slave, or that of the master reversed. If it turns
by theta, p changes by ``(T n - N t) theta``; if the point that it meets moves by d eta along the
edge of the master, the shape functions of the master change. Both are linear in the displacements
of the surfaces. Forces of links turn with rigid bodies (`Links.turning`). Without these changes
Newton's method converges like a geometric series, the slower the larger the forces are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from solver.contact.geometry import Pairing, end_normals, end_turns
from solver.contact.interface import Interface
from solver.contact.problem import ContactRows
from solver.contact.state import ContactState
from solver.fem.nodes import Dofs
from solver.fem.part import Part
from solver.fem.rigid import RigidPart
from solver.fem.surface import Surface
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.typing import Array, Ints


@dataclass(frozen=True, slots=True)
class Turning:
    """Contact on the unknowns of all parts together, and how its forces change with them.

    Attributes
    ----------
    dofs : for each part, its unknowns that contact or links act on; k of all parts
    stiffness : (k, k) minus the derivative of the nodal forces [N/mm]
    rows, motions : (m, k) conditions by unknowns: as the forces act, and as the conditions change
    """

    dofs: tuple[Ints, ...]
    stiffness: Array
    rows: Array
    motions: Array


def turning_of(
    parts: Sequence[Part],
    u: Sequence[Array],
    rows: Sequence[ContactRows | None],
    pairs: Sequence[tuple[Interface, Pairing, ContactState, Ints, slice]],
    links: list[tuple[Ints, Array]],
) -> Turning:
    """Return how contact turns at displacements ``u``.

    Parameters
    ----------
    rows : for each part, the derivatives of all conditions as the forces act
    pairs : interface, pairing, forces, candidates, and the places of their gaps in the conditions
    links : how forces of links turn, see `Links.turning`
    """
    m, n = max(len(own.block) for own in rows if own), max([p.stop for *_, p in pairs], default=0)
    ends = np.cumsum([0, *(part.n for part in parts)])
    acting = [(ends[k] + own.dofs, own.block) for k, own in enumerate(rows) if own]
    closing, changes = [], [*links]
    for interface, pairing, contact, at, place in pairs:
        for side, (number, part, surface) in enumerate(interface.sides):
            gaps = np.zeros((n, surface.X.size))
            gaps[place] = pairing.closing[side][at]
            dofs, gaps = part.pull_back(surface, u[number], gaps, n)
            moves = gaps.any(axis=0)
            closing.append((ends[number] + dofs[moves], gaps[:, moves]))
        if contact.normal.any():
            changes.append(_on_parts(interface, u, ends, *turning(pairing, interface, contact)))
            changes += _swung(interface, pairing, contact, u, ends)
    every = (dofs for dofs, _ in (*acting, *closing, *changes))
    used = np.unique(np.concatenate(list(every)))
    H, K = np.zeros((m, len(used))), np.zeros((len(used),) * 2)
    for dofs, block in acting:
        H[:, np.searchsorted(used, dofs)] = block
    motions = H.copy()
    motions[:n] = 0.0
    for dofs, block in closing:
        motions[:n, np.searchsorted(used, dofs)] += block
    for dofs, block in changes:
        K[np.ix_(*(np.searchsorted(used, dofs),) * 2)] -= block
    own = np.split(used, np.searchsorted(used, ends[1:-1]))
    return Turning(tuple(of - end for of, end in zip(own, ends, strict=False)), K, H, motions)


def _on_parts(
    interface: Interface, u: Sequence[Array], ends: Ints, numbers: Ints, change: Array
) -> tuple[Ints, Array]:
    """Return unknowns of all parts, and a change (k, k) of forces by displacements on them.

    ``numbers`` (k,) count the displacements of the slave's surface, then of the master's.
    """
    first = interface.slave_surface.X.size
    cut = int(np.searchsorted(numbers, first))
    every, pulls = [], []
    for side, own in enumerate((numbers[:cut], numbers[cut:] - first)):
        number, part, surface = interface.sides[side]
        here = slice(0, cut) if side == 0 else slice(cut, None)
        dofs, pull = part.numbered(surface.dofs[own]), None
        if isinstance(part, RigidPart):
            dofs, pull = part.pull_back(surface, u[number], np.eye(surface.X.size)[own], 0)
        elif (dofs < 0).any():
            dofs, pull = dofs[dofs >= 0], np.eye(len(dofs))[:, dofs >= 0]
        every.append(ends[number] + dofs)
        pulls.append((here, pull))
    for _ in ("forces", "displacements"):
        change = np.vstack([
            change[here] if pull is None else pull.T @ change[here] for here, pull in pulls
        ]).T  # fmt: skip
    return np.concatenate(every), change


def _swung(
    interface: Interface, pairing: Pairing, contact: ContactState, u: Sequence[Array], ends: Ints
) -> list[tuple[Ints, Array]]:
    """Return the changes of moments on rigid bodies: arms of forces turn with them."""
    out = []
    for side, (number, part, surface) in enumerate(interface.sides):
        if isinstance(part, RigidPart):
            force = contact.normal @ pairing.normal[side]
            force += contact.tangential @ pairing.tangent[side]
            change = force @ part.frame.swinging(u[number], surface.X)
            out.append((ends[number : number + 1] + 2, np.array([[change]])))
    return out


def turning(pairing: Pairing, interface: Interface, contact: ContactState) -> tuple[Ints, Array]:
    """Return the derivative (k, k) of the nodal forces of contact by displacements [N/mm].

    The first result (k,) numbers the displacements of the slave's surface, then of the master's.
    """
    slave, master = interface.slave_surface, interface.master_surface
    at = pairing.points
    both = np.stack([contact.normal, contact.tangential])
    N, T = (at.shares * both[:, np.stack([at.edge, at.edge + 1], axis=1)]).sum(axis=2)
    acts = np.flatnonzero((N != 0) | (T != 0))
    N, T, (x, y), edge = N[acts], T[acts], at.normal[:, acts], at.edge[acts]
    k = slave.edges.shape[1]
    beside = slave.edges[(edge[:, None] + [-1, 0, 1]).clip(0, len(slave.edges) - 1)]
    other = master.edges[at.partner[acts]]
    nodes = np.hstack([beside.reshape(len(edge), 3 * k), len(slave.nodes) + other])
    # shape functions of the motion of the master's point over the slave's, and along its edge
    apart, along = np.zeros(nodes.shape), np.zeros(nodes.shape)
    apart[:, k : 2 * k] = -shape_functions(at.xi[acts], k)
    apart[:, 3 * k :] = shape_functions(at.eta[acts], other.shape[1])
    along[:, 3 * k :] = slopes = shape_derivatives(at.eta[acts], other.shape[1])
    turn = np.zeros((*nodes.shape, 2))
    turn[:, : 3 * k] = _turns(at.x[0], slave, edge, at.xi[acts], np.stack([x, y]))
    across = apart[:, :, None] * np.stack([-y, x], axis=1)[:, None]
    across -= at.distance[acts, None, None] * turn
    tx, ty = (at.x[1][:, other] * slopes).sum(axis=-1)
    across /= (y * tx - x * ty)[:, None, None]
    if interface.along_master:
        bend = np.diff(shape_derivatives(np.array([0.0, 1.0]), other.shape[1]), axis=0)[0]
        bx, by = at.x[1][:, other] @ bend
        turn[:] = across * (tx * by - ty * bx)[:, None, None]
        turn[:, 3 * k :] += slopes[:, :, None] * np.stack([-ty, tx], axis=1)[:, None]
        turn /= (tx**2 + ty**2)[:, None, None]
        x, y = at.push[:, acts]
    turned, push = (
        np.stack([T * x - N * y, T * y + N * x]),
        np.stack([N * x + T * y, N * y - T * x]),
    )
    left = [a[:, :, None] * b.T[:, None] for a, b in ((apart, turned), (along, push))]
    columns = Dofs(nodes.ravel(), 2).every.reshape(len(nodes), 2 * nodes.shape[1])
    numbers, place = np.unique(columns, return_inverse=True)
    place, size = place.reshape(columns.shape), len(numbers)
    each = sum(
        of.reshape(*columns.shape, 1) * by.reshape(len(columns), 1, columns.shape[1])
        for of, by in zip(left, (turn, across), strict=True)
    )
    where = place[:, :, None] * size + place[:, None]
    change = np.bincount(where.ravel(), each.ravel(), size**2).reshape(size, size)
    return numbers, np.asarray(change, dtype=float)


def _turns(x: Array, slave: Surface, edge: Ints, xi: Array, n: Array) -> Array:
    """Return the rotations (n_points, 3 k, 2) of the slave's normals n (2, n_points)."""
    weights = np.stack([(1 - xi) / 2, (1 + xi) / 2])
    ends = end_normals(x, slave)[:, :, edge]
    weights *= (n[:, None] * ends).sum(axis=0) / np.hypot(*(weights * ends).sum(axis=1))
    start, end = end_turns(x, slave)[:, edge].reshape(2, len(edge), 3 * slave.edges.shape[1], 2)
    return np.asarray(weights[0][:, None, None] * start + weights[1][:, None, None] * end)
