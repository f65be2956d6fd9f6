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
    """Displacements (n,) [mm], strain (4, n_points) Mandel, and internal variables."""

    u: Array
    strain: Array
    plastic: PlasticState


def of_layers(track: Track, layers: Layers) -> Fields:
    """Return the fields of a half-plane whose state is a function of depth alone."""
    rows = track.rows
    every = rows.every
    strain = np.zeros((4, track.part.weights.size))
    plastic = PlasticState.virgin(track.part.weights.size)
    strain[:, every] = layers.strain(track.elasticity).T[:, :, None]
    plastic.plastic_strain[:, every] = layers.plastic_strain.T[:, :, None]
    plastic.accumulated[every] = layers.accumulated[:, None]
    return Fields(_sunk(track, layers), strain, plastic)


def under_load(track: Track, found: Pass) -> Fields:
    """Return the fields while the load of a pass is there, which goes along +x."""
    rows, before = track.rows, of_layers(track, found.before)
    grown = found.after.plastic_strain - found.before.plastic_strain
    u = track.operator.expand(found.loading.u, rows.force_behind(grown))
    plastic = before.plastic
    plastic.plastic_strain[:, rows.points] = np.moveaxis(found.plastic_strain, 2, 0)
    plastic.accumulated[rows.points] = found.accumulated
    plastic.plastic_strain[:, rows.behind] = found.after.plastic_strain.T[:, :, None]
    plastic.accumulated[rows.behind] = found.after.accumulated[:, None]
    return Fields(before.u + u, before.strain + track.part.strain(u), plastic)


def _sunk(track: Track, layers: Layers) -> Array:
    """Return the displacements (n,) that layers give nodes, against those below all of them."""
    strain = layers.strain(track.elasticity)
    edges = np.append(0.0, np.cumsum(layers.thickness))
    u = np.zeros_like(track.part.X)
    for axis, rate in enumerate((SQRT2 * strain[:, 3], strain[:, 1])):
        below = np.append(0.0, np.cumsum((rate * layers.thickness)[::-1]))[::-1]
        u[axis] = np.interp(-track.part.X[1], edges, below)
    return np.asarray(u.T.ravel())
