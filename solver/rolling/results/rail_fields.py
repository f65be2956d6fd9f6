"""Fields of a steady pass at nodes of the zone of a prism, in three dimensions.

The 8-node quadrilaterals of the section are extruded over the stations of the window to hexahedra
of 20 nodes: two distances of stations long, with corners and mid-sides at every other station, and
mid-sides along x at those in between.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from solver.results.mesh_fields import MeshFields, counterclockwise
from solver.rolling.passing import Pass
from solver.rolling.rail.state import PrismState
from solver.rolling.results.rail import PrismBody
from solver.tensors import not_below_zero, to_tensor, von_mises
from solver.typing import Array

_CORNERS = 4
_ELEMENT = "hexahedron20"


def zone_fields(body: PrismBody, found: Pass[PrismState], loaded: str, left: str) -> MeshFields:
    """Return stress and plastic strain around the load, and behind the pass.

    Under the load displacements are not known everywhere: NaN.

    Parameters
    ----------
    loaded, left : names of the two stages
    """
    track, name = body.track, f"{body.names[0]} around the load"
    modes, plane = track.modes, track.section.plane
    n_points = track.section.weights.shape[1]
    elements = modes.points[::n_points] // n_points
    cells = counterclockwise(plane.basis.element_dofs.T[elements], plane.X)
    nodes, flat = np.unique(cells, return_inverse=True)
    cells = flat.reshape(cells.shape)
    corners = np.unique(cells[:, :_CORNERS])
    place = np.searchsorted(corners, cells[:, :_CORNERS])
    window = len(modes.x)
    main, between = np.arange(0, window, 2), np.arange(1, window - 1, 2)
    count, first = len(nodes), len(main) * len(nodes)

    layers = []
    for k in range(len(between)):
        near, far = (np.split(cells + at * count, [_CORNERS], axis=1) for at in (k, k + 1))
        sides = first + k * len(corners) + place
        layers.append(np.hstack([near[0], far[0], near[1], far[1], sides]))

    share = body.recovery(name)[nodes][:, modes.points]  # of the elements in the zone alone
    share = share.multiply(1 / share.sum(axis=1)[:, None]).tocsr()

    def at_nodes(values: Array) -> Array:
        """Return values (..., n) at the nodes of those at the points (..., n_points, stations)."""
        flat = np.moveaxis(values, -2, 0)
        each = (share @ flat.reshape(len(flat), -1)).reshape(count, *flat.shape[1:])
        each = np.moveaxis(each, 0, -1)  # (..., stations, nodes)
        both = each[..., main, :], each[..., between, :][..., corners]
        return np.concatenate([own.reshape(*own.shape[:-2], -1) for own in both], axis=-1)

    initial = track.initial_strain[modes.points, None]

    def stage(elastic: Array, plastic: Array, accumulated: Array, u: Array) -> Mapping[str, Array]:
        strain = np.moveaxis(elastic + plastic - initial, -1, 0)
        stress = np.einsum("ab,pcb->apc", found.law.stiffness(6), elastic)
        return {
            "displacement": u,
            "stress": to_tensor(at_nodes(stress)),
            "mises": not_below_zero(at_nodes(von_mises(stress))),
            "plastic_strain": not_below_zero(at_nodes(accumulated)),
            "plastic_tensor": to_tensor(at_nodes(np.moveaxis(plastic, -1, 0))),
            "strain": to_tensor(at_nodes(strain)),
        }

    x = track.before * (modes.length / modes.stations) + modes.x
    z, y = plane.X[:, nodes]
    X = np.hstack([
        np.stack([each.ravel() for each in np.broadcast_arrays(at[:, None], own[1], own[0])])
        for at, own in ((x[main], (z, y)), (x[between], (z[corners], y[corners])))
    ])  # fmt: skip
    before, after = found.before, found.after
    moved = track.left_by(after.plastic_strain).reshape(-1, 3)[nodes].T
    still = np.hstack([np.tile(moved, len(main)), np.tile(moved[:, corners], len(between))])

    def along(values: Array) -> Array:
        return np.repeat(values[:, None], window, axis=1)

    under = before.strain[:, None] + found.strain - found.plastic_strain
    behind, remains = along(after.strain - after.plastic_strain), along(after.plastic_strain)
    nothing = np.full_like(still, np.nan)
    stages = {
        loaded: stage(under, found.plastic_strain, found.accumulated, nothing),
        left: stage(behind, remains, along(after.accumulated), still),
    }
    return MeshFields(X=X, bodies={name: (_ELEMENT, np.vstack(layers))}, stages=stages)
