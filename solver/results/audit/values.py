"""Fields of a body at its nodes and at places, independent of the operators of the results.

`StateFields` computes them from displacements, internal variables and declared loads. `Located`
finds the elements that contain places.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from solver.materials.state import PlasticState
from solver.mesh.rounding import ROUNDED
from solver.results.audit.plain import PlainBody
from solver.results.audit.recomputed import BodyFields
from solver.tensors import SQRT2
from solver.typing import Array

_SLACK = 0.05
"""Ratio to the side of an element's bounding box by which curved edges may extend beyond it."""
_STEPS, _EXACT = 8, 1e-12
_INSIDE, _OUTSIDE = 1e-8, 1e-6
"""Distances in reference coordinates beyond an element: up to the first a place is inside, above
the second it is outside. Between them both answers are accepted."""


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
