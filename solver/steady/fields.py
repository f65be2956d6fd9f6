"""Displacement, strain and internal variables of a whole half-plane, during a pass and after it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.materials.state import PlasticState
from solver.tensors import SQRT2

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.steady.layers import Layers
    from solver.steady.passing import Pass
    from solver.steady.rows import FlowRows
    from solver.steady.track import Track

    Array = NDArray[np.float64]


class TrackFields(NamedTuple):
    """Displacements (n,) [mm], strain (4, n_points) Mandel, and internal variables.

    ``surface`` has strain and internal variables at the surface, above `FlowRows.highest`.
    """

    u: Array
    strain: Array
    plastic: PlasticState
    surface: tuple[Array, PlasticState]


def of_layers(track: Track, layers: Layers) -> TrackFields:
    """Return the fields of a half-plane whose state is a function of depth alone."""
    rows, n = track.rows, track.part.weights.size

    def at(every: NDArray[np.int64], size: int, layers: Layers) -> tuple[Array, PlasticState]:
        strain, plastic = np.zeros((4, size)), PlasticState.virgin(size)
        strain[:, every] = layers.strain(track.elasticity).T[:, :, None]
        plastic.plastic_strain[:, every] = layers.plastic_strain.T[:, :, None]
        plastic.accumulated[every] = layers.accumulated[:, None]
        return strain, plastic

    above = at(rows.above, len(rows.highest), layers.top)
    return TrackFields(_sunk(track, layers), *at(rows.every, n, layers), above)


def under_load(track: Track, found: Pass) -> TrackFields:
    """Return the fields while the load of a pass is there, which goes along +x."""
    rows, before, after = track.rows, of_layers(track, found.before), found.after
    grown = after.plastic_strain - found.before.plastic_strain
    u = track.operator.expand(found.loading.u, rows.force_behind(grown))
    added = track.part.strain(u)
    uppermost = np.moveaxis(added[:, rows.every[: 2 * rows.uppermost]], 0, 2)
    strain, plastic = before.surface
    strain[:, rows.above] += np.moveaxis(rows.onto_surface(uppermost), 2, 0)
    _pass(rows, rows.every, before.plastic, (found.plastic_strain, found.accumulated), after)
    _pass(rows, rows.above, plastic, found.surface, after.top)
    return before._replace(u=before.u + u, strain=before.strain + added)


def _pass(
    rows: FlowRows,
    every: NDArray[np.int64],
    plastic: PlasticState,
    flow: tuple[Array, Array],
    after: Layers,
) -> None:
    """Put into ``plastic`` what rows have gathered in the window, and have behind it."""
    n = rows.shape[1]
    inside, behind = every[:, :n], every[:, n + rows.ahead.shape[1] :]
    plastic.plastic_strain[:, inside] = np.moveaxis(flow[0], 2, 0)
    plastic.accumulated[inside] = flow[1]
    plastic.plastic_strain[:, behind] = after.plastic_strain.T[:, :, None]
    plastic.accumulated[behind] = after.accumulated[:, None]


def _sunk(track: Track, layers: Layers) -> Array:
    """Return the displacements (n,) that layers give nodes, against those below all of them."""
    strain = layers.strain(track.elasticity)
    edges = np.append(0.0, np.cumsum(layers.thickness))
    u = np.zeros_like(track.part.X)
    for axis, rate in enumerate((SQRT2 * strain[:, 3], strain[:, 1])):
        below = np.append(0.0, np.cumsum((rate * layers.thickness)[::-1]))[::-1]
        u[axis] = np.interp(-track.part.X[1], edges, below)
    return np.asarray(u.T.ravel())
