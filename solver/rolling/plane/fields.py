"""Displacement, strain and internal variables of a whole half-plane, during a pass and after it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from solver.materials.law import Law
from solver.materials.state import PlasticState
from solver.rolling.passing import Pass
from solver.rolling.plane.layers import Layers
from solver.rolling.plane.rows import FlowRows
from solver.rolling.plane.track import Track
from solver.tensors import SQRT2
from solver.typing import Array, Ints


class TrackFields(NamedTuple):
    """Displacements (n,) [mm], strain (4, n_points) Mandel, and internal variables.

    ``surface`` has strain and internal variables at the surface, above `FlowRows.highest`.
    """

    u: Array
    strain: Array
    plastic: PlasticState
    surface: tuple[Array, PlasticState]


def of_layers(track: Track, law: Law, layers: Layers) -> TrackFields:
    """Return the fields of a half-plane whose state is a function of depth alone."""
    rows, n = track.rows, track.part.weights.size

    def at(every: Ints, size: int, layers: Layers) -> tuple[Array, PlasticState]:
        strain, virgin = np.zeros((4, size)), law.initial(size, 4)
        strain[:, every] = layers.strain(track.elasticity).T[:, :, None]
        packed = virgin.packed
        packed[:, every] = layers.state.packed[:, :, None]
        return strain, virgin.unpacked(packed)

    above = at(rows.above, len(rows.highest), layers.top)
    return TrackFields(_sunk(track, layers), *at(rows.every, n, layers), above)


def under_load(track: Track, found: Pass[Layers]) -> TrackFields:
    """Return the fields under the load of a pass, which moves along +x."""
    rows, before, after = track.rows, of_layers(track, found.law, found.before), found.after
    grown = after.plastic_strain - found.before.plastic_strain
    u = track.operator.expand(found.loading.u, rows.force_behind(grown))
    added = track.part.strain(u)
    uppermost = np.moveaxis(added[:, rows.every[: 2 * rows.uppermost]], 0, 2)
    strain, above = before.surface
    strain[:, rows.above] += np.moveaxis(rows.onto_surface(uppermost), 2, 0)
    return TrackFields(
        before.u + u,
        before.strain + added,
        _passed(rows, rows.every, before.plastic, found.states, after),
        (strain, _passed(rows, rows.above, above, found.surface, after.top)),
    )


def _passed(
    rows: FlowRows,
    every: Ints,
    before: PlasticState,
    flow: PlasticState,
    after: Layers,
) -> PlasticState:
    """Return internal variables of all points: before, in and behind the window."""
    n = rows.shape[1]
    packed = before.packed
    packed[:, every[:, :n]] = flow.packed
    packed[:, every[:, n + rows.ahead.shape[1] :]] = after.state.packed[:, :, None]
    return before.unpacked(packed)


def _sunk(track: Track, layers: Layers) -> Array:
    """Return the nodal displacements (n,) of a layered state, relative to depth [mm]."""
    strain = layers.strain(track.elasticity)
    edges = np.append(0.0, np.cumsum(layers.thickness))
    u = np.zeros_like(track.part.X)
    for axis, rate in enumerate((SQRT2 * strain[:, 3], strain[:, 1])):
        below = np.append(0.0, np.cumsum((rate * layers.thickness)[::-1]))[::-1]
        u[axis] = np.interp(-track.part.X[1], edges, below)
    return np.asarray(u.T.ravel())
