"""Recomputed results of a steady pass over a prism, at the load and behind it.

At the load the strain is that of the pass itself, at the points of its zone. Behind it the strain
of the whole section comes from displacements, which do not change along x.
"""

from __future__ import annotations

from functools import cache, cached_property

import numpy as np

from solver.prism.state import PrismState
from solver.prism.track import PrismTrack
from solver.results.audit.plain import PlainBody
from solver.results.audit.recomputed import Acting
from solver.results.prism import PrismBody, PrismStage
from solver.steady import Pass
from solver.tensors import SQRT2
from solver.typing import Array


class PlainSection(PlainBody):
    """A section in z and y; its positions are x, y and z."""

    def in_plane(self, X: Array) -> Array:
        """Return the coordinates (z, y)."""
        return np.asarray(X[[2, 1]])

    @cached_property
    def volume(self) -> Array:
        """Area of the points (n_elements, n_points) [mm2]."""
        return np.asarray(self.part.basis.dx)

    @cached_property
    def points(self) -> Array:
        """Positions of the points (3, n_points) [mm]."""
        z, y = np.asarray(self.part.basis.global_coordinates()).reshape(2, -1)
        return np.stack([np.zeros_like(z), y, z])

    def strain(self, u: Array) -> Array:
        """Return Mandel strain (6, n_elements, n_points) of displacements (n,) constant along x."""
        at = u.reshape(-1, 3)[self._nodes]  # (n_element_nodes, n_elements, 3)
        by_z, by_y = (np.einsum("iep,iea->aep", self._gradients[:, k], at) for k in (0, 1))
        shear = np.array([by_y[0], by_z[1] + by_y[2], by_z[0]]) / SQRT2
        return np.concatenate([[np.zeros_like(by_y[1]), by_y[1], by_z[2]], shear])


class ZoneFields:
    """`BodyFields` of a section at x = 0: at the load NaN outside the zone.

    Parameters
    ----------
    u : (n,) displacement that the pass leaves [mm]; None for the state at the load
    """

    def __init__(
        self, plain: PlainSection, track: PrismTrack, found: Pass[PrismState], u: Array | None
    ) -> None:
        self.plain, self._track, self._found, self._u = plain, track, found, u

    @cached_property
    def _points(self) -> tuple[Array, Array]:
        """Stress (6, n), tensor components, and accumulated strain (n,) at the points."""
        found, at, zone = self._found, self._track.before, self._track.modes.points
        n = self.plain.points.shape[1]
        accumulated, plastic = np.zeros(n), np.zeros((6, n))
        if self._u is None:
            strain = np.full((6, n), np.nan)
            strain[:, zone] = (found.before.strain + found.strain[:, at]).T
            accumulated[zone], plastic[:, zone] = (
                found.accumulated[:, at], found.plastic_strain[:, at].T,
            )  # fmt: skip
        else:
            strain = self.plain.strain(self._u).reshape(6, n) + self._track.initial_strain.T
            accumulated[zone] = found.after.accumulated
            plastic[:, zone] = found.after.plastic_strain.T
        elasticity, elastic = self._track.elasticity, strain - plastic
        nu, double_shear = elasticity.poisson_ratio, 2 * elasticity.shear_modulus
        stress = double_shear * elastic
        stress[:3] += double_shear * nu / (1 - 2 * nu) * elastic[:3].sum(axis=0)
        stress[3:] /= SQRT2
        return stress, accumulated

    @cached_property
    def stress(self) -> Array:
        """Stress at the nodes."""
        return self.plain.recovered(self._points[0])

    @cached_property
    def mises(self) -> Array:
        """Von Mises stress at the nodes, recovered from the points."""
        return np.maximum(self.plain.recovered(self._equivalent), 0.0)

    @property
    def _equivalent(self) -> Array:
        stress = self._points[0]
        deviator = stress[:3] - stress[:3].mean(axis=0)
        return np.asarray(np.sqrt(1.5 * (deviator**2).sum(0) + 3 * (stress[3:] ** 2).sum(0)))

    @cached_property
    def accumulated(self) -> Array:
        """Plastic strain at the nodes, at least zero."""
        return np.maximum(self.plain.recovered(self._points[1]), 0.0)

    @property
    def displacement(self) -> Array:
        """Not available: NaN."""
        return np.full_like(self.plain.part.X, np.nan)

    @property
    def strain(self) -> Array:
        """Not available: NaN."""
        return np.full((6, self.plain.part.X.shape[1]), np.nan)

    plastic_tensor = strain

    @property
    def at_points(self) -> tuple[Array, Array, Array]:
        """Positions, von Mises stress and plastic strain of the points."""
        return self.plain.points, self._equivalent, self._points[1]


class OfPrismPass:
    """Recomputed results of a steady pass over a prism (see `Recomputed`).

    Parameters
    ----------
    body : the prism as results see it
    found : the pass
    left : state behind the pass
    released : name of that state
    """

    def __init__(
        self, body: PrismBody, found: Pass[PrismState], left: PrismStage, released: str
    ) -> None:
        def fields(name: str, stage: str) -> ZoneFields:
            u = left.state.u[0] if stage == released else None
            return ZoneFields(plain(name), body.track, found, u)

        # a cached method of this object would hold it, and it the prism, in a circle
        self.plain = plain = cache(lambda name: PlainSection(body.full(name)))
        self.fields = cache(fields)

    def exact(self, stage: str) -> bool:
        """See `Recomputed`."""
        del stage
        return True

    def centre(self, stage: str) -> float:
        """See `Recomputed`."""
        del stage
        return 0.0

    def acting(self, stage: str, x: Array) -> Acting:
        """See `Recomputed`: the contact is no line."""
        del stage
        nowhere = np.full_like(x, np.nan)
        return Acting(nowhere, nowhere, nowhere)

    def extent(self, stage: str) -> tuple[float, float, float]:
        """See `Recomputed`."""
        del stage
        return np.nan, np.nan, 0.0
