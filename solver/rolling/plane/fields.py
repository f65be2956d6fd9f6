"""The state of a whole half-plane, during a pass and after it."""

from __future__ import annotations

import numpy as np

from solver.contact.state import BodyState
from solver.materials.law import Law
from solver.materials.state import PlasticState
from solver.rolling.body import LOADED, RELEASED
from solver.rolling.passing import Pass
from solver.rolling.plane.layers import Layers
from solver.rolling.plane.track import Track
from solver.tensors import SQRT2
from solver.typing import Array


def of_layers(track: Track, law: Law, layers: Layers) -> BodyState:
    """Return the state of a half-plane that is a function of depth alone.

    Its points are followed by the places at the surface above `FlowRows.highest`.
    """
    rows, n = track.rows, track.part.weights.size
    virgin = law.initial(n + len(rows.highest), 4)
    strain, packed = np.zeros_like(virgin.plastic_strain), virgin.packed
    for every, own in ((rows.every, layers), (n + rows.above, layers.top)):
        strain[:, every] = own.strain(track.elasticity).T[:, :, None]
        packed[:, every] = own.state.packed[:, :, None]
    return _state(track, RELEASED, _sunk(track, layers), strain, virgin.unpacked(packed))


def under_load(track: Track, found: Pass[Layers]) -> BodyState:
    """Return the state under the load of a pass, which moves along +x; for points `of_layers`."""
    rows, before, after = track.rows, of_layers(track, found.law, found.before), found.after
    n, columns, grown = track.part.weights.size, rows.shape[1], after.plastic_strain
    grown = grown - found.before.plastic_strain
    u = track.operator.expand(found.loading.u, rows.force_behind(grown))
    added, strain, packed = track.part.strain(u), before.strain.copy(), before.plastic.packed
    strain[:, :n] += added
    uppermost = np.moveaxis(added[:, rows.every[: 2 * rows.uppermost]], 0, 2)
    strain[:, n + rows.above] += np.moveaxis(rows.onto_surface(uppermost), 2, 0)
    # before the window as before the pass, in the window as it flows, behind it as after the pass
    each = (rows.every, found.states, after), (n + rows.above, found.surface, after.top)
    for every, flow, own in each:
        packed[:, every[:, :columns]] = flow.packed
        packed[:, every[:, columns + rows.ahead.shape[1] :]] = own.state.packed[:, :, None]
    return _state(track, LOADED, before.u + u, strain, before.plastic.unpacked(packed))


def _state(track: Track, time: float, u: Array, strain: Array, plastic: PlasticState) -> BodyState:
    stress = track.part.body.law.stiffness(4) @ (strain - plastic.plastic_strain)
    return BodyState(time, u, stress, strain, plastic)


def _sunk(track: Track, layers: Layers) -> Array:
    """Return the nodal displacements (n,) of a layered state, relative to depth [mm]."""
    strain = layers.strain(track.elasticity)
    edges = np.append(0.0, np.cumsum(layers.thickness))
    u = np.zeros_like(track.part.X)
    for axis, rate in enumerate((SQRT2 * strain[:, 3], strain[:, 1])):
        below = np.append(0.0, np.cumsum((rate * layers.thickness)[::-1]))[::-1]
        u[axis] = np.interp(-track.part.X[1], edges, below)
    return np.asarray(u.T.ravel())
