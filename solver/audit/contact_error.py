"""Estimate of the discretisation error of contact pressure, from the stress under the surface.

Pressure comes from the contact forces. The stress of the body gives a second value, -n . sigma . n,
with sigma recovered from patches of elements inside the body (`ErrorPoints`), without the contact
forces. Both converge to the true pressure as the mesh is refined, but differently: their difference
has the magnitude of the error. It is large if the contact has few edges.

It is evaluated on the slave, or on the master if the slave is rigid and has no stress. The figure
is the integral of the absolute difference over the area before loading, of a body of large strain
over the present one, divided by the contact force.
(The integral of the square is unbounded under refinement at a sharp corner.)
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.audit.surfaces import deformed
from solver.contact.pressure import contact_pressure
from solver.contact.state import Converged, State
from solver.contact.system import System
from solver.fem.error import ErrorPoints
from solver.fem.surface import Surface
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.tensors import to_tensor
from solver.typing import Array

_XI, _WEIGHT = np.polynomial.legendre.leggauss(4)
_ROUNDING = 1e-6
"""Pressure over the largest stress of the body: a smaller ratio is rounding."""
_BEYOND = 1e-6
"""Distance of a point beyond the end of a chord, over its length: up to it the point belongs to the
chord."""


def contact_error(system: System, converged: Converged) -> float:
    """Return the estimated error of contact pressure, over the contact force of all pairs.

    Only edges with pressure count; 0 if there are none, as after unloading.
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
            recovered[name] = points.at_nodes(system.state(name, converged).stress)
        if at_vertices.max() <= _ROUNDING * np.nan_to_num(np.abs(recovered[name])).max():
            continue
        chain = system.chain(name, boundary)
        if system.full(name).body.large:  # its stress is that on the deformed area
            at_vertices = at_vertices * system.pairing(converged.state, k).shrunk
            chain = replace(chain, X=deformed(system, name, converged.state)[0][:, chain.nodes])
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
    """Return the pressure of a rigid slave at points of its master (n_edges, n_points) [MPa].

    It is the pressure at the nearest place on the chords with pressure, or zero beyond their ends.
    """
    pair = system.model.contacts[number]
    slave, finite = system.chain(*pair.slave), state.contacts[number].finite
    x, moved = slave.X, chain.X  # small sliding pairs positions before loading
    if finite:
        x = deformed(system, pair.slave[0], state)[0][:, slave.nodes]
        moved = deformed(system, pair.master[0], state)[0][:, chain.nodes]
    x = x[:, slave.vertices]
    pressed = (at_vertices[:-1] != 0) | (at_vertices[1:] != 0)
    start, way = x[:, :-1][:, pressed], np.diff(x)[:, pressed]
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
    first, last = at_vertices[:-1][pressed][nearest], at_vertices[1:][pressed][nearest]
    value = first + foot[at] * (last - first)
    out[near] = np.where(np.abs(share[at] - foot[at]) < _BEYOND, value, 0.0)
    return out


def _integrals(chain: Surface, pressure: Array, stress: Array) -> tuple[float, float]:
    """Return the integrals of abs(p + n . sigma . n) and of p over a surface [N].

    Parameters
    ----------
    pressure : (n_edges, n_points) at points of its edges [MPa]
    stress : (4, n_nodes) components xx, yy, zz, xy at its nodes [MPa]
    """
    k = chain.edges.shape[1]
    at, shape = chain.X[:, chain.edges], shape_functions(_XI, k)
    tangent = at @ shape_derivatives(_XI, k).T  # (2, n_edges, n_points)
    length = np.hypot(*tangent)
    nx, ny = tangent[1] / length, -tangent[0] / length
    xx, yy, _, xy = stress[:, chain.edges] @ shape.T
    across = nx**2 * xx + ny**2 * yy + 2 * nx * ny * xy
    area = _WEIGHT * length * chain.depth(at @ shape.T) * (pressure != 0).any(axis=1, keepdims=True)
    area = np.where(np.isnan(across), 0.0, area)  # next to removed elements
    off = np.abs(pressure + np.nan_to_num(across))
    return float((area * off).sum()), float((area * pressure).sum())
