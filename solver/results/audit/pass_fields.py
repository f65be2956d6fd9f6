"""Fields of a half-plane from the layers before and behind a steady pass, for the audit."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from solver.results.audit.plain import PlainBody
from solver.results.audit.values import equivalent
from solver.results.steady import TrackBody
from solver.steady import Pass
from solver.steady.layers import Layers
from solver.tensors import SQRT2
from solver.typing import Array, Ints

_SAME_DEPTH = 1e-6
"""Ratio of a difference of depth to the depth of the first row; up to it points are in one row."""


class PassFields:
    """`BodyFields` of the half-plane behind a steady pass, or of its window under the load.

    The state behind a pass is a function of depth alone: Hooke's law with zero strains along x and
    z. Nodes of the surface have separate values.
    """

    def __init__(self, half_plane: TrackBody, found: Pass[Layers], *, loaded: bool) -> None:
        self.plain = PlainBody(half_plane.full(""))
        self._track, self._found, self._loaded = half_plane.track, found, loaded
        self._way = found.direction
        elasticity = self._track.elasticity
        self._nu, self._double_shear = elasticity.poisson_ratio, 2 * elasticity.shear_modulus

    def _stress(self, strain: Array, flow: Array) -> Array:
        """Return stress components (..., 4) for Mandel strains (..., 4), in the load's frame."""
        elastic = strain - flow
        trace = self._double_shear * self._nu / (1 - 2 * self._nu) * elastic[..., :3].sum(axis=-1)
        out = self._double_shear * elastic
        out[..., :3] += trace[..., None]
        out[..., 3] /= SQRT2
        return np.asarray(out)

    def _layered(self, flow: Array) -> Array:
        """Return the strain (n, 4) of unloaded layers with this plastic strain (n, 4)."""
        strain = np.zeros_like(flow)
        strain[:, 1] = flow[:, 1] + self._nu / (1 - self._nu) * (flow[:, 0] + flow[:, 2])
        strain[:, 3] = flow[:, 3]
        return strain

    @cached_property
    def _columns(self) -> tuple[Array, Array, Array]:
        """Positions x (n_columns,), stress (n_rows + 1, n_columns, 4) and plastic strain of rows.

        The first row is the surface. The state behind the pass has one column.
        """
        found = self._found
        if not self._loaded:
            layers = found.after.top, found.after
            flow = np.concatenate([each.plastic_strain for each in layers])
            total = np.concatenate([each.accumulated for each in layers])
            stress = self._stress(self._layered(flow), flow)
            return np.zeros(1), stress[:, None], total[:, None]
        before = self._layered(found.before.plastic_strain)[:, None]
        stress = self._stress(before + found.strain, found.plastic_strain)
        k = len(found.surface.accumulated)
        unknown = np.full((k, *stress.shape[1:]), np.nan)
        x = self._track.part.points.reshape(2, -1)[0, self._track.rows.points[0]]
        total = np.concatenate([unknown[..., 0], found.accumulated])
        return self._way * x, np.concatenate([unknown, stress]), total

    @cached_property
    def _points(self) -> tuple[Array, Array]:
        """Stress (4, n) and accumulated strain (n,) at the points; NaN outside of the window."""
        x, stress, total = self._columns
        X = self.plain.points
        k = len(total) - len(self._found.before.depth)
        depth = self._found.before.depth
        row, column = _nearest(depth, -X[1]), _nearest(x, X[0])
        near = _SAME_DEPTH * depth[0]
        here = np.abs(-X[1] - depth[row]) < near
        outside = np.nan
        if self._loaded:
            here &= np.abs(X[0] - x[column]) < near
        else:
            outside = 0.0  # below the rows nothing has yielded
        found = np.where(here[:, None], stress[row + k, column], outside).T
        found[3] *= self._way
        return found, np.where(here, total[row + k, column], outside)

    @cached_property
    def _top(self) -> Ints:
        y = self.plain.part.X[1]
        return np.flatnonzero(y > -_SAME_DEPTH * self._found.before.depth[0])

    def _with_surface(self, values: Array, surface: Array) -> Array:
        nodal = self.plain.recovered(values)
        nodal[..., self._top] = surface[..., None]
        return nodal

    @cached_property
    def _surface(self) -> tuple[Array, Array]:
        """Stress (4,) and plastic strain () at the surface; NaN under the load."""
        _, stress, total = self._columns
        return stress[0, 0] * [1.0, 1.0, 1.0, self._way], total[0, 0]

    @cached_property
    def stress(self) -> Array:
        """Stress at the nodes."""
        return self._with_surface(self._points[0], self._surface[0])

    @cached_property
    def mises(self) -> Array:
        """Von Mises stress at the nodes, recovered from the points."""
        points, surface = equivalent(self._points[0]), equivalent(self._surface[0])
        return np.maximum(self._with_surface(points, surface), 0.0)

    @cached_property
    def accumulated(self) -> Array:
        """Plastic strain at the nodes."""
        return self._with_surface(self._points[1], self._surface[1])

    @property
    def displacement(self) -> Array:
        """Not available: NaN."""
        return np.full((2, self.plain.part.X.shape[1]), np.nan)

    @property
    def strain(self) -> Array:
        """Not available: NaN."""
        return np.full((4, self.plain.part.X.shape[1]), np.nan)

    plastic_tensor = strain

    @property
    def at_points(self) -> tuple[Array, Array, Array]:
        """Positions, von Mises stress and plastic strain of points, then of the surface."""
        stress, total = self._points
        X = np.concatenate([self.plain.points, self.plain.part.X[:, self._top]], axis=1)
        count = len(self._top)
        mises = np.append(equivalent(stress), np.full(count, equivalent(self._surface[0])))
        return X, mises, np.append(total, np.full(count, self._surface[1]))


def _nearest(places: Array, at: Array) -> Ints:
    """Return the number of the nearest place (n,) for each position in ``at``."""
    different, first = np.unique(places, return_index=True)
    middles = (different[1:] + different[:-1]) / 2
    return np.asarray(first[np.searchsorted(middles, at)])
