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
    from solver.steady.track import Track

    Array = NDArray[np.float64]


class Fields(NamedTuple):
    """Displacements (n,) [mm], strain (4, n_points) Mandel, and internal variables.

    ``surface`` has strain and internal variables at the surface, above `Rows.highest`.
    """

    u: Array
    strain: Array
    plastic: PlasticState
    surface: tuple[Array, PlasticState]


def of_layers(track: Track, layers: Layers) -> Fields:
    """Return the fields of a half-plane whose state is a function of depth alone."""
    rows, n = track.rows, track.part.weights.size

    def at(every: NDArray[np.int64], size: int, layers: Layers) -> tuple[Array, PlasticState]:
        strain, plastic = np.zeros((4, size)), PlasticState.virgin(size)
        strain[:, every] = layers.strain(track.elasticity).T[:, :, None]
        plastic.plastic_strain[:, every] = layers.plastic_strain.T[:, :, None]
        plastic.accumulated[every] = layers.accumulated[:, None]
        return strain, plastic

    above = at(rows.above, len(rows.highest), layers.top)
    return Fields(_sunk(track, layers), *at(rows.every, n, layers), above)


def under_load(track: Track, found: Pass) -> Fields:
    """Return the fields while the load of a pass is there, which goes along +x."""
    rows, before, after = track.rows, of_layers(track, found.before), of_layers(track, found.after)
    grown = found.after.plastic_strain - found.before.plastic_strain
    u = track.operator.expand(found.loading.u, rows.force_behind(grown))
    added = track.part.strain(u)
    above = added[:, rows.every[: 2 * rows.uppermost]]
    added_above = np.zeros_like(before.surface[0])
    added_above[:, rows.above] = np.moveaxis(rows.onto_surface(np.moveaxis(above, 0, 2)), 2, 0)

    def at(
        every: NDArray[np.int64],
        flow: tuple[Array, Array],
        before: PlasticState,
        after: PlasticState,
    ) -> PlasticState:
        inside, behind = np.split(every, [rows.shape[1]], axis=1)
        behind = behind[:, rows.ahead.shape[1] :]
        before.plastic_strain[:, inside] = np.moveaxis(flow[0], 2, 0)
        before.accumulated[inside] = flow[1]
        before.plastic_strain[:, behind] = after.plastic_strain[:, behind]
        before.accumulated[behind] = after.accumulated[behind]
        return before

    flow = found.plastic_strain, found.accumulated
    return Fields(
        before.u + u,
        before.strain + added,
        at(rows.every, flow, before.plastic, after.plastic),
        (
            before.surface[0] + added_above,
            at(rows.above, found.surface, before.surface[1], after.surface[1]),
        ),
    )


def _sunk(track: Track, layers: Layers) -> Array:
    """Return the displacements (n,) that layers give nodes, against those below all of them."""
    strain = layers.strain(track.elasticity)
    edges = np.append(0.0, np.cumsum(layers.thickness))
    u = np.zeros_like(track.part.X)
    for axis, rate in enumerate((SQRT2 * strain[:, 3], strain[:, 1])):
        below = np.append(0.0, np.cumsum((rate * layers.thickness)[::-1]))[::-1]
        u[axis] = np.interp(-track.part.X[1], edges, below)
    return np.asarray(u.T.ravel())
