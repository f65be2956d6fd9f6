"""The track of a steady pass as results see a body, in the frame of the load."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.sparse import csr_array, diags_array, hstack
from scipy.spatial import cKDTree

from solver.contact.state import BodyState
from solver.fem.fields import Sampler, recovery, sampler
from solver.fem.rigid import RigidMotion
from solver.results.acting import Acting, contact_patches
from solver.results.fields import StressCycle
from solver.rolling.passing import Pass
from solver.rolling.plane.layers import Layers
from solver.rolling.plane.track import Track, of_layers, under_load
from solver.rolling.plane.wheel import RollingContact
from solver.rolling.results.stage import PassStage, SteadyBody
from solver.tensors import to_mandel, to_tensor
from solver.typing import Array, Ints

_LEVEL = 1e-6
"""Points and nodes are on one line if their depths differ by less than this share of the depth of
the first row."""
_MIRRORED = np.array([[1.0], [1.0], [1.0], [-1.0]])


class TrackBody(SteadyBody):
    """The body of a track in a fixed frame; the track itself is computed for a load along +x.

    Its points are followed by places at the surface above the first row.

    Parameters
    ----------
    track : the track, with the load along +x
    way : 1 if the load moves along +x, -1 if it moves along -x and all is mirrored
    """

    def __init__(self, track: Track, way: int) -> None:
        self.track, self.way = track, way
        part = track.part if way == 1 else track.mirrored
        super().__init__(part, len(part.free))

    def sampler(self, name: str, X: Array) -> Sampler:
        """Return the interpolation of nodal fields at positions (2, n) [mm]."""
        return sampler(self.part, X)

    def recovery(self, name: str) -> csr_array:
        """Return the matrix (n_nodes, n) from values at points and at the surface to nodes.

        Nodes of the surface take the values at the surface: between the first two rows of points
        plastic strain, and thus stress, may change too much for extrapolation.
        """
        part, first = self.part, self._first
        points, y = part.points.reshape(2, -1), part.X[1]
        top = np.flatnonzero(y > y.max() - _LEVEL * abs(points[1].max()))
        nearest = cKDTree(points[0, first, None]).query(part.X[0, top, None], k=2)[1]
        below = np.ones(len(y))
        below[top] = 0.0
        halves = np.full(nearest.size, 0.5), (np.repeat(top, 2), nearest.ravel())
        at_surface = csr_array(halves, shape=(len(y), len(first)))
        return csr_array(hstack([diags_array(below) @ recovery(part), at_surface]))

    @cached_property
    def _first(self) -> Ints:
        """Indices of the points nearest to the surface."""
        y = self.part.points[1].ravel()
        return np.flatnonzero(y > y.max() * (1 + _LEVEL))

    def positions(self, name: str) -> Array:
        """Return positions (2, n) of the points, then at the surface above the first row [mm]."""
        points = self.part.points.reshape(2, -1)
        return np.concatenate([points, points[:, self._first] * [[1.0], [0.0]]], axis=1)

    def under_load(self, found: Pass[Layers]) -> PassStage:
        """Return the state under the load of a pass."""
        touching = found.loading if isinstance(found.loading, RollingContact) else None
        return PassStage(self._seen(under_load(self.track, found)), touching)

    def left_by(self, found: Pass[Layers]) -> PassStage:
        """Return the state after a pass."""
        return PassStage(self._seen(of_layers(self.track, found.law, found.after)))

    def cycle(self, loaded: PassStage) -> StressCycle:
        """Return what a pass does: points of equal depth have the path along their row."""
        state, (x, y) = loaded.state, self.positions(self.names[0])
        deep = abs(y).max()
        _, row = np.unique(np.round(y / deep, 9), return_inverse=True)
        order = np.lexsort((-self.way * x, row))  # material flows against the load
        plastic = to_tensor(state.plastic.plastic_strain)
        rows = np.split(order, np.flatnonzero(np.diff(row[order])) + 1)
        shape = len(rows), max(map(len, rows))
        every = np.array([np.pad(each, (0, shape[1] - len(each)), mode="edge") for each in rows])
        stress, strain, flow = (
            np.moveaxis(each[:, every], 0, 2)
            for each in (to_tensor(state.stress), to_tensor(state.strain), plastic)
        )
        grown = np.ptp(state.plastic.accumulated[every], axis=1)
        left = to_mandel(np.moveaxis(flow[:, -1] - flow[:, 0], 1, 0))
        net = np.sqrt(2 / 3 * (left**2).sum(axis=0))
        return StressCycle(stress, strain, grown, net, row)

    def _seen(self, state: BodyState) -> BodyState:
        """Return a state of the track in the fixed frame."""
        u, stress, plastic = state.u, state.stress, state.plastic
        if self.way == -1:
            points, nodes = self.track.mirror
            uppermost = np.searchsorted(self.track.rows.highest, points[self._first])
            points = np.concatenate([points, len(points) + uppermost])
            u = (u.reshape(-1, 2)[nodes] * [-1.0, 1.0]).ravel()
            stress = stress[:, points] * _MIRRORED
            plastic = plastic.at(points).mirrored
        return self.state_of(state.time, u, stress, plastic)


def of_wheel(way: int, at: PassStage) -> Acting:
    """Return pressure and shear of a wheel; ``way`` is 1 if it moves along +x, -1 if back."""
    touching: RollingContact | None = at.touching
    if touching is None:
        return Acting(along=lambda x: (np.zeros_like(x), np.zeros_like(x), np.full_like(x, np.nan)))
    s, order = way * touching.x, np.argsort(way * touching.x)

    def along(x: Array) -> tuple[Array, Array, Array]:
        def sampled(values: Array, beyond: float) -> Array:
            return np.asarray(np.interp(x, s[order], values[order], left=beyond, right=beyond))

        shear = sampled(-way * touching.shear, 0.0)
        return sampled(touching.pressure, 0.0), shear, sampled(touching.gap, np.nan)

    rising = np.argsort(touching.x)
    closed = touching.normal[rising] > 0
    patches = contact_patches(touching.x[rising], touching.gap[rising], closed)
    return Acting(
        along=along,
        half_width=(patches[-1][1] - patches[0][0]) / 2,
        peak=float(touching.pressure.max()),
        force=-way * float(touching.tangential.sum()),
        axle=RigidMotion(x=0.0, y=touching.height, rotation=0.0),
    )
