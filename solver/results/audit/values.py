"""Fields of a body at its nodes and at places, independent of the operators of the results.

`StateFields` computes them from displacements, internal variables and declared loads, `PassFields`
from the layers before and behind a steady pass. `Located` finds the elements that contain places.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from solver.materials.state import PlasticState
from solver.mesh.rounding import ROUNDED
from solver.results.audit.plain import PlainBody
from solver.results.audit.recomputed import BodyFields
from solver.results.steady import TrackBody
from solver.steady import Pass
from solver.steady.layers import Layers
from solver.tensors import SQRT2
from solver.typing import Array, Ints

_SLACK = 0.05
"""Ratio to the side of an element's bounding box by which curved edges may extend beyond it."""
_STEPS, _EXACT = 8, 1e-12
_INSIDE, _OUTSIDE = 1e-8, 1e-6
"""Distances in reference coordinates beyond an element: up to the first a place is inside, above
the second it is outside. Between them both answers are accepted."""
_SAME_DEPTH = 1e-6
"""Ratio of a difference of depth to the depth of the first row; up to it points are in one row."""


def equivalent(stress: Array) -> Array:
    """Return the von Mises stress (...) of components xx, yy, zz, xy (4, ...)."""
    xx, yy, zz, xy = stress
    square = ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * xy**2
    return np.asarray(np.sqrt(square))


def flowed(fields: BodyFields) -> Array:
    """Return the accumulated plastic strain at nodes (n_nodes,), at least zero."""
    return np.maximum(fields.accumulated, 0.0)


def at_nodes(fields: BodyFields, name: str) -> Array:
    """Return the field of this name in `BODY_FIELDS` at the nodes."""
    found: Array = flowed(fields) if name == "plastic_strain" else getattr(fields, name)
    return found


class StateFields:
    """`BodyFields` of a body from its displacements (n,), its internal variables and its loads."""

    def __init__(
        self, plain: PlainBody, u: Array, plastic: PlasticState | None, time: float
    ) -> None:
        self.plain, self._u, self._plastic, self._time = plain, u, plastic, time

    @cached_property
    def _points(self) -> tuple[Array, Array]:
        """Stress (4, n), tensor components, and accumulated strain (n,) at the points."""
        stress = self.plain.stress(self._u, self._plastic, self._time)
        stress[3] /= SQRT2
        none = self._plastic is None
        flow = np.zeros(stress.shape[1]) if none else self._plastic.accumulated  # type: ignore[union-attr]
        known = self.plain.known
        return known(stress, self._time), known(flow, self._time)

    @cached_property
    def stress(self) -> Array:
        """Stress at the nodes."""
        return self.plain.recovered(self._points[0], self._time)

    @cached_property
    def mises(self) -> Array:
        """Von Mises stress at the nodes, recovered from the points."""
        found = self.plain.recovered(equivalent(self._points[0]), self._time)
        return np.maximum(found, 0.0)

    @cached_property
    def accumulated(self) -> Array:
        """Plastic strain at the nodes."""
        return self.plain.recovered(self._points[1], self._time)

    def _tensor(self, mandel: Array) -> Array:
        """Return a Mandel tensor (4, n_points) at the nodes, components as of stress."""
        tensor = mandel.copy()
        tensor[3] /= SQRT2
        return self.plain.recovered(self.plain.known(tensor, self._time), self._time)

    @cached_property
    def strain(self) -> Array:
        """Strain at the nodes."""
        return self._tensor(self.plain.strains(self._u, self._plastic, self._time)[0])

    @cached_property
    def plastic_tensor(self) -> Array:
        """Plastic strain at the nodes."""
        none = np.zeros((4, self.plain.points.shape[1]))
        return self._tensor(none if self._plastic is None else self._plastic.plastic_strain)

    @property
    def displacement(self) -> Array:
        """Displacements of the nodes; NaN where all elements are removed."""
        return np.where(np.isnan(self.mises), np.nan, self._u.reshape(-1, 2).T)

    @property
    def at_points(self) -> tuple[Array, Array, Array]:
        """Places, von Mises stress and plastic strain of the points."""
        stress, flow = self._points
        return self.plain.points, equivalent(stress), flow


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


class Located:
    """The elements of an undeformed body that contain places (n_axes, n).

    Attributes
    ----------
    inside, outside : (n,) whether places are in or outside the body; both False at its boundary
    """

    def __init__(self, plain: PlainBody, X: Array) -> None:
        part, X = plain.part, plain.in_plane(X)
        dofs, mapping, shape = part.basis.element_dofs, part.basis.mapping, part.basis.elem.lbasis
        corners = plain.in_plane(part.X)[:, dofs]
        low, high, extent = corners.min(axis=1), corners.max(axis=1), np.ptp(corners, axis=1)
        slack = _SLACK * extent + 1e-9
        low, high = low - slack, high + slack
        near = (X[0][:, None] >= low[0]) & (X[0][:, None] <= high[0])
        near &= (X[1][:, None] >= low[1]) & (X[1][:, None] <= high[1])
        place, element = np.nonzero(near)
        quad = part.basis.mesh.t.shape[0] == 4
        at = np.full((2, len(element), 1), 0.5 if quad else 1 / 3)
        for _ in range(_STEPS if len(element) else 0):
            x, y = X[:, place, None] - np.asarray(mapping.F(at, tind=element))
            (a, b), (c, d) = np.asarray(mapping.DF(at, tind=element))
            step = np.stack([d * x - b * y, a * y - c * x]) / (a * d - b * c)
            at = np.clip(at + step, -1.0, 2.0)
            if np.abs(step).max() < _EXACT:  # as in rectangles after the first
                break
        at = at[..., 0]
        beyond = np.maximum(-at.min(axis=0), at.max(axis=0) - 1 if quad else at.sum(axis=0) - 1)
        least = np.full(X.shape[1], np.inf)
        np.minimum.at(least, place, beyond)
        rounded = ROUNDED * np.ptp(corners, axis=(1, 2)).max() / extent.min(axis=0)
        self.inside = np.zeros(X.shape[1], dtype=bool)
        self.inside[place[beyond <= np.maximum(_INSIDE, rounded[element])]] = True
        self.outside = np.ones(X.shape[1], dtype=bool)
        self.outside[place[beyond <= np.maximum(_OUTSIDE, 2 * rounded[element])]] = False
        best = np.flatnonzero((beyond == least[place]) & self.inside[place])
        _, first = np.unique(place[best], return_index=True)
        best = best[first]
        self._at, self._count = place[best], X.shape[1]
        self._nodes = np.asarray(part.same[dofs[:, element[best]]])
        each = [np.asarray(shape(at[:, best], i)[0]) for i in range(len(dofs))]
        self._shape = np.array(each).reshape(len(dofs), -1)

    def of(self, nodal: Array) -> Array:
        """Return nodal fields (..., n_nodes) at the places (..., n); NaN outside the body."""
        out, at = np.full((*nodal.shape[:-1], self._count), np.nan), nodal[..., self._nodes]
        each = np.where(np.isnan(at) & (np.abs(self._shape) < _INSIDE), 0.0, at * self._shape)
        out[..., self._at] = each.sum(axis=-2)
        return out


def _nearest(places: Array, at: Array) -> Ints:
    """Return the number of the nearest place (n,) for each position in ``at``."""
    different, first = np.unique(places, return_index=True)
    middles = (different[1:] + different[:-1]) / 2
    return np.asarray(first[np.searchsorted(middles, at)])
