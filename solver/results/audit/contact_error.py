"""How far contact pressure is from that of a finer mesh: an estimate from the stress under it.

Pressure comes from contact forces, which the increments have found. The stress of the body has to
balance it, and tells it a second time: -n . sigma . n, where sigma is recovered from patches of
elements inside the body (`ErrorPoints`), which know no contact force. Both tend to the true
pressure as the mesh is refined, by different ways. What they differ by is of the size of the
error, and where few edges lie across a contact, neither can follow the other.

The surface is that of the slave, whose vertices contact forces belong to and which is not the
coarser one; of a rigid slave, which has no stress, that of its master. The difference is taken by
its amount, over the area before loading, to which the stress refers: it is a share of the contact
force. Its square would have no limit under refinement at a sharp corner.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.contact.pressure import contact_pressure
from solver.fem.error import ErrorPoints
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.results.audit.surfaces import deformed
from solver.tensors import to_tensor

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.contact.state import Converged, State
    from solver.contact.system import System
    from solver.fem.surface import Surface

    Array = NDArray[np.float64]

_XI, _WEIGHT = np.polynomial.legendre.leggauss(4)
_BEYOND = 1e-6
"""Part of a chord, by which a point may lie beyond its end and still count as beside it."""


def contact_error(system: System, converged: Converged) -> float:
    """Return the estimated error of contact pressure, as a share of the force of all pairs.

    Edges count that bear pressure. It is 0 where none does.
    """
    error, level = 0.0, 0.0
    recovered: dict[str, Array] = {}
    for k, pair in enumerate(system.model.contacts):
        at_vertices, _ = contact_pressure(system, converged.state, k)
        if not at_vertices.any():
            continue
        name, boundary = pair.slave if pair.slave[0] in system.names else pair.master
        if name not in recovered:
            points = ErrorPoints(system.full(name))
            recovered[name] = points.at_nodes(system.response(name, converged).stress)
        chain = system.chain(name, boundary)
        if name == pair.slave[0]:
            ends = np.stack([at_vertices[:-1], at_vertices[1:]], axis=1)
            pressure = ends @ np.stack([1 - _XI, 1 + _XI]) / 2
        else:
            pressure = _carried(system, k, converged.state, chain, at_vertices)
        here = _integrals(chain, pressure, to_tensor(recovered[name][:, chain.nodes]))
        error, level = error + here[0], level + here[1]
    return error / level if level else 0.0


def _carried(
    system: System, number: int, state: State, chain: Surface, at_vertices: Array
) -> Array:
    """Return the pressure of a rigid slave at points of its master (n_edges, n_points).

    Each point takes that of the nearest place of the chords that bear pressure, and none where it
    lies beyond their ends.
    """
    pair = system.model.contacts[number]
    slave, finite = system.chain(*pair.slave), state.contacts[number].finite
    x, moved = slave.X, chain.X  # small sliding pairs places before loading
    if finite:
        x = deformed(system, pair.slave[0], state)[0][:, slave.nodes]
        moved = deformed(system, pair.master[0], state)[0][:, chain.nodes]
    x = x[:, slave.vertices]
    bears = (at_vertices[:-1] != 0) | (at_vertices[1:] != 0)
    start, way = x[:, :-1][:, bears], np.diff(x)[:, bears]
    points = moved[:, chain.edges] @ shape_functions(_XI, chain.edges.shape[1]).T
    out = np.zeros(points.shape[1:])
    reach = np.hypot(*way).max()
    low, high = (of(start, start + way).T for of in (np.minimum, np.maximum))
    low, high = low.min(axis=0) - reach, high.max(axis=0) + reach
    near = ((points.T >= low) & (points.T <= high)).all(axis=-1).T
    to = points[:, near][:, :, None] - start[:, None]
    share = (to * way[:, None]).sum(axis=0) / (way**2).sum(axis=0)
    foot = np.clip(share, 0.0, 1.0)
    nearest = np.hypot(*(to - foot * way[:, None])).argmin(axis=1)
    at = np.arange(len(nearest)), nearest
    first, last = at_vertices[:-1][bears][nearest], at_vertices[1:][bears][nearest]
    value = first + foot[at] * (last - first)
    out[near] = np.where(np.abs(share[at] - foot[at]) < _BEYOND, value, 0.0)
    return out


def _integrals(chain: Surface, pressure: Array, stress: Array) -> tuple[float, float]:
    """Return the integrals of abs(p + n . sigma . n) and of p over a surface [N].

    Parameters
    ----------
    pressure : at the points of its edges (n_edges, n_points)
    stress : at its nodes, components xx, yy, zz, xy (4, n_nodes)
    """
    k = chain.edges.shape[1]
    at, shape = chain.X[:, chain.edges], shape_functions(_XI, k)
    tangent = at @ shape_derivatives(_XI, k).T  # (2, n_edges, n_points)
    length = np.hypot(*tangent)
    nx, ny = tangent[1] / length, -tangent[0] / length
    xx, yy, _, xy = stress[:, chain.edges] @ shape.T
    across = nx**2 * xx + ny**2 * yy + 2 * nx * ny * xy
    area = _WEIGHT * length * chain.depth(at @ shape.T) * (pressure != 0).any(axis=1, keepdims=True)
    return float((area * np.abs(pressure + across)).sum()), float((area * pressure).sum())
