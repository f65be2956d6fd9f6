"""Fields of a body at its points, nodes and places, without the operators of the results.

They follow from displacements, internal variables and declared loads of a state by increments, from
the layers before and behind a steady pass over a track, or from the strain of a pass over a prism.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.audit.plain import GHOST, PlainBody, nominal
from solver.mesh.rounding import ROUNDED
from solver.tensors import SQRT2

Array = NDArray[np.float64]

SLACK = 0.05
"""Ratio to the side of an element's bounding box by which curved edges may extend beyond it."""
STEPS, EXACT = 8, 1e-12
INSIDE, OUTSIDE = 1e-8, 1e-6
"""Distances in reference coordinates beyond an element: up to the first a place is inside, above
the second it is outside. Between them both answers are accepted."""
SAME_DEPTH = 1e-6
"""Ratio of a difference of depth to the depth of the first row; up to it points are in one row."""


def equivalent(stress: Array) -> Array:
    """Von Mises stress (...) of components (n, ...), the three normal ones first."""
    away = stress[:3] - stress[:3].mean(axis=0)
    return np.asarray(np.sqrt(1.5 * (away**2).sum(axis=0) + 3 * (stress[3:] ** 2).sum(axis=0)))


def tensor(mandel: Array) -> Array:
    """Tensor components (n, ...) of Mandel vectors."""
    return np.concatenate([mandel[:3], mandel[3:] / SQRT2])


def hooke(elasticity: Any, elastic: Array) -> Array:
    """Stress (n, ...), tensor components, of an elastic Mandel strain."""
    nu, double_shear = elasticity.poisson_ratio, 2 * elasticity.shear_modulus
    stress = double_shear * elastic
    stress[:3] += double_shear * nu / (1 - 2 * nu) * elastic[:3].sum(axis=0)
    return tensor(stress)


class PlainSection(PlainBody):
    """The section of a prism in z and y; its positions are x, y and z."""

    @cached_property
    def volume(self) -> Array:
        return np.asarray(self.part.basis.dx)

    @cached_property
    def points(self) -> Array:
        z, y = np.asarray(self.part.basis.global_coordinates()).reshape(2, -1)
        return np.stack([np.zeros_like(z), y, z])

    def strain(self, u: Array) -> Array:
        """Mandel strain (6, n_elements, n_points) of displacements (n,) constant along x."""
        at = u.reshape(-1, 3)[self._nodes]
        by_z, by_y = (np.einsum("iep,iea->aep", self._gradients[:, k], at) for k in (0, 1))
        shear = np.array([by_y[0], by_z[1] + by_y[2], by_z[0]]) / SQRT2
        return np.concatenate([[np.zeros_like(by_y[1]), by_y[1], by_z[2]], shear])


def in_plane(plain: PlainBody, X: Array) -> Array:
    """Coordinates (2, n) in the plane of the mesh of positions (n_axes, n)."""
    return np.asarray(X[[2, 1]] if isinstance(plain, PlainSection) else X)


def recovered(plain: PlainBody, values: Array, gone: NDArray[np.bool_]) -> Array:
    """Nodal values (..., n_nodes) of values at points (..., n_points).

    In each element a (bi)linear field is fitted to the points by least squares; a node takes the
    mean of its elements, weighted with their volume. Elements that are removed, ``gone``, do not
    count; nodes of other elements with an unknown value are NaN.
    """
    basis, each = plain.part.basis, plain.volume
    terms = 4 if basis.mesh.t.shape[0] == 4 else 3
    terms = next(k for k in (terms, 3, 1) if each.shape[1] >= k)

    def linear(x: Array) -> Array:
        return np.stack([np.ones(x.shape[1]), x[0], x[1], x[0] * x[1]][:terms], axis=1)

    fit, *_ = np.linalg.lstsq(linear(np.asarray(basis.X)), np.eye(each.shape[1]))
    to_nodes = linear(np.array(basis.elem.doflocs, dtype=float).T) @ fit
    volume, nodes, count = each.sum(axis=1), plain._nodes, plain.part.X.shape[1]
    weighted = values.reshape(*values.shape[:-1], *each.shape) * volume[:, None]
    weighted = np.where(gone[:, None], 0.0, weighted)
    rows = np.moveaxis(weighted @ to_nodes.T, -1, -2).reshape(-1, nodes.size)
    total = np.bincount(nodes.ravel(), np.tile(np.where(gone, 0, volume), len(nodes)), count)
    total[total == 0] = np.nan
    sums = np.stack([np.bincount(nodes.ravel(), one, count) for one in rows]) / total
    return np.asarray(sums.reshape(*values.shape[:-1], count))


class Fields:
    """Fields of one body in one state; NaN where they are not known.

    Attributes
    ----------
    stress, flow : (n_components, n) [MPa] and accumulated plastic strain (n,) at the points
    strain, plastic : Mandel tensors (n_components, n) at the points; None if not known
    u : (n_axes, n_nodes) displacements [mm], None if not known
    gone : (n_elements,) whether elements are removed
    top : nodes of the surface that have values of their own, these stresses, and their flow
    """

    def __init__(
        self, plain: PlainBody, stress: Array, flow: Array, *, strain: Array | None = None,
        plastic: Array | None = None, u: Array | None = None,
        gone: NDArray[np.bool_] | None = None, top: tuple[Any, Array, float] | None = None,
    ) -> None:  # fmt: skip
        gone = np.zeros(len(plain.volume), dtype=bool) if gone is None else gone
        hidden = np.repeat(gone, plain.volume.shape[1])
        self.plain, self.gone, self.top = plain, gone, top
        self.stress, self.flow = np.where(hidden, np.nan, stress), np.where(hidden, np.nan, flow)
        self._tensors, self._u = {"strain": strain, "plastic_tensor": plastic}, u
        self._known: dict[str, Array] = {}

    def at(self, name: str) -> Array:
        """The field of this name in `BODY_FIELDS` at the nodes, or ``flow``, of either sign."""
        if name not in self._known:
            self._known[name] = self._nodal(name)
        return self._known[name]

    def _nodal(self, name: str) -> Array:
        if name == "displacement":
            nowhere = np.full_like(self.plain.part.X, np.nan)
            return (
                nowhere
                if self._u is None
                else np.where(np.isnan(self.at("mises")), np.nan, self._u)
            )
        if name == "plastic_strain":
            return np.maximum(self.at("flow"), 0.0)
        if name in self._tensors:
            mandel = self._tensors[name]
            at = np.full_like(self.stress, np.nan) if mandel is None else tensor(mandel)
        else:
            at = {"stress": self.stress, "mises": equivalent(self.stress), "flow": self.flow}[name]
        nodal = recovered(self.plain, at, self.gone)
        if self.top is not None:
            nodes, stress, flow = self.top
            there = {"stress": stress, "mises": equivalent(stress), "flow": np.asarray(flow)}
            nodal[..., nodes] = there.get(name, np.asarray(np.nan))[..., None]
        return np.maximum(nodal, 0.0) if name == "mises" else nodal

    @property
    def at_points(self) -> tuple[Array, Array, Array]:
        """Positions, von Mises stress and plastic strain of the points, then of the surface."""
        X, mises, flow = self.plain.points, equivalent(self.stress), self.flow
        if self.top is None:
            return X, mises, flow
        nodes, stress, surface = self.top
        more = np.full(len(nodes), equivalent(stress)), np.full(len(nodes), surface)
        X = np.concatenate([X, self.plain.part.X[:, nodes]], axis=1)
        return X, np.append(mises, more[0]), np.append(flow, more[1])


def of_state(plain: PlainBody, u: Array, plastic: Any, time: float) -> Fields:
    """Fields of a body by its displacements (n,), internal variables and declared loads."""
    elasticity, nothing = plain.body.material.elasticity, np.zeros((4, plain.points.shape[1]))
    flow = nothing if plastic is None else plastic.plastic_strain
    inelastic = plain.eigenstrain(time) + flow
    elastic = plain.strain(u).reshape(4, -1) - inelastic
    if plane_stress := plain.body.kinematics == "plane_stress":
        nu = elasticity.poisson_ratio
        elastic[2] = -nu / (1 - nu) * (elastic[0] + elastic[1])
    stress = plain.shares(time)[0] * hooke(elasticity, elastic)
    if plane_stress:
        stress[2] = 0.0
    if plain.body.large:
        true = _cauchy(plain, stress, u, np.exp((elastic + inelastic)[2] * plane_stress))
        large = np.repeat(plain.body.large_elements, plain.volume.shape[1])
        stress = np.where(large, true, stress)
    gone = (plain.remaining(time) <= GHOST).reshape(plain.volume.shape)[:, 0]
    return Fields(
        plain, stress, nothing[0] if plastic is None else plastic.accumulated,
        strain=elastic + inelastic, plastic=flow,
        u=u.reshape(-1, 2).T, gone=gone,
    )  # fmt: skip


def _cauchy(plain: PlainBody, stress: Array, u: Array, thickness: Array) -> Array:
    """True stress (4, n): nominal stress times F', over the change of volume."""
    H, hoop = plain.gradient(u)
    P, around = nominal(plain.level(stress.reshape(4, *hoop.shape)), H, hoop)
    F = H + np.eye(2)[:, :, None, None]
    true = np.einsum("ik...,jk...->ij...", P, F)
    found = np.array([true[0, 0], true[1, 1], around * (1 + hoop), true[0, 1]])
    volume = np.linalg.det(np.moveaxis(F, (0, 1), (2, 3))) * (1 + hoop)
    return (found / volume).reshape(4, -1) / thickness


def layered(elasticity: Any, flow: Array) -> Array:
    """Strain (4, n) of unloaded layers with this plastic strain: none along x and z."""
    nu, strain = elasticity.poisson_ratio, np.zeros_like(flow)
    strain[1] = flow[1] + nu / (1 - nu) * (flow[0] + flow[2])
    strain[3] = flow[3]
    return strain


def of_pass(plain: PlainBody, track: Any, found: Any, *, loaded: bool) -> Fields:
    """Fields of the half-plane behind a steady pass, or of its window under the load.

    The state behind a pass is a function of depth alone. The surface has values of its own.
    """
    elasticity, way, X, depth = track.elasticity, found.direction, plain.points, found.before.depth
    near, row = SAME_DEPTH * depth[0], nearest(depth, -X[1])
    here = np.abs(-X[1] - depth[row]) < near
    if loaded:
        x = way * track.part.points.reshape(2, -1)[0, track.rows.points[0]]
        column = nearest(x, X[0])
        here &= np.abs(X[0] - x[column]) < near
        before = layered(elasticity, found.before.plastic_strain.T).T[:, None]
        elastic = np.moveaxis(before + found.strain - found.plastic_strain, 2, 0)
        stress, total = hooke(elasticity, elastic)[:, row, column], found.accumulated[row, column]
        outside, at_surface, surface = np.nan, np.full(4, np.nan), np.nan
    else:
        flow, above = found.after.plastic_strain.T, found.after.top.plastic_strain.T
        stress = hooke(elasticity, layered(elasticity, flow) - flow)[:, row]
        total, outside = found.after.accumulated[row], 0.0  # below the rows nothing has yielded
        at_surface = hooke(elasticity, layered(elasticity, above) - above)[:, 0]
        surface = found.after.top.accumulated[0]
    turned = np.array([1.0, 1.0, 1.0, way])
    top = np.flatnonzero(plain.part.X[1] > -near)
    return Fields(
        plain, turned[:, None] * np.where(here, stress, outside), np.where(here, total, outside),
        top=(top, turned * at_surface, surface),
    )  # fmt: skip


def of_zone(plain: PlainSection, track: Any, found: Any, u: Array | None) -> Fields:
    """Fields of a section at x = 0 behind a pass, by what is left of displacements ``u``.

    Without them those under the load: NaN outside the zone.
    """
    n, zone, at = plain.points.shape[1], track.modes.points, track.before
    flow, plastic = np.zeros(n), np.zeros((6, n))
    if u is None:
        strain = np.full((6, n), np.nan)
        strain[:, zone] = (found.before.strain + found.strain[:, at]).T
        flow[zone], plastic[:, zone] = found.accumulated[:, at], found.plastic_strain[:, at].T
    else:
        strain = plain.strain(u).reshape(6, n) + track.initial_strain.T
        flow[zone], plastic[:, zone] = found.after.accumulated, found.after.plastic_strain.T
    return Fields(plain, hooke(track.elasticity, strain - plastic), flow)


class Located:
    """The elements of an undeformed body that contain places (n_axes, n).

    Attributes
    ----------
    inside, outside : (n,) whether places are in or outside the body; both False at its boundary
    """

    def __init__(self, plain: PlainBody, X: Array) -> None:
        part, X = plain.part, in_plane(plain, X)
        dofs, mapping, shape = part.basis.element_dofs, part.basis.mapping, part.basis.elem.lbasis
        corners = in_plane(plain, part.X)[:, dofs]
        low, high, extent = corners.min(axis=1), corners.max(axis=1), np.ptp(corners, axis=1)
        slack = SLACK * extent + 1e-9
        near = (X[:, :, None] >= (low - slack)[:, None]) & (
            X[:, :, None] <= (high + slack)[:, None]
        )
        place, element = np.nonzero(near.all(axis=0))
        quad = part.basis.mesh.t.shape[0] == 4
        at = np.full((2, len(element), 1), 0.5 if quad else 1 / 3)
        for _ in range(STEPS if len(element) else 0):
            x, y = X[:, place, None] - np.asarray(mapping.F(at, tind=element))
            (a, b), (c, d) = np.asarray(mapping.DF(at, tind=element))
            step = np.stack([d * x - b * y, a * y - c * x]) / (a * d - b * c)
            at = np.clip(at + step, -1.0, 2.0)
            if np.abs(step).max() < EXACT:  # as in rectangles after the first
                break
        at = at[..., 0]
        beyond = np.maximum(-at.min(axis=0), at.max(axis=0) - 1 if quad else at.sum(axis=0) - 1)
        least = np.full(X.shape[1], np.inf)
        np.minimum.at(least, place, beyond)
        rounded = ROUNDED * np.ptp(corners, axis=(1, 2)).max() / extent.min(axis=0)
        self.inside = np.zeros(X.shape[1], dtype=bool)
        self.inside[place[beyond <= np.maximum(INSIDE, rounded[element])]] = True
        self.outside = np.ones(X.shape[1], dtype=bool)
        self.outside[place[beyond <= np.maximum(OUTSIDE, 2 * rounded[element])]] = False
        best = np.flatnonzero((beyond == least[place]) & self.inside[place])
        _, first = np.unique(place[best], return_index=True)
        best = best[first]
        self._at, self._count = place[best], X.shape[1]
        self._nodes = np.asarray(dofs[:, element[best]])
        each = [np.asarray(shape(at[:, best], i)[0]) for i in range(len(dofs))]
        self._shape = np.array(each).reshape(len(dofs), -1)

    def of(self, nodal: Array) -> Array:
        """Nodal fields (..., n_nodes) at the places (..., n); NaN outside the body."""
        out, at = np.full((*nodal.shape[:-1], self._count), np.nan), nodal[..., self._nodes]
        each = np.where(np.isnan(at) & (np.abs(self._shape) < INSIDE), 0.0, at * self._shape)
        out[..., self._at] = each.sum(axis=-2)
        return out


def nearest(places: Array, at: Array) -> NDArray[np.int64]:
    """Number of the nearest place (n,) for each position in ``at``."""
    different, first = np.unique(places, return_index=True)
    middles = (different[1:] + different[:-1]) / 2
    return np.asarray(first[np.searchsorted(middles, at)])
