"""Autofrettage in closed form: an incompressible hardening tube, loaded and unloaded.

Plane strain, von Mises, Poisson ratio 1/2, linear hardening. Everything follows from one number:
the displacement is C/r, the hoop strain C/r^2, and the difference D of hoop and radial stress is
4 G times its elastic part. The axial stress is the mean of the two, so that von Mises' stress is
sqrt(3)/2 D, and (4/3) H times the plastic hoop strain is what hardening adds to D.

References
----------
R. Hill, The Mathematical Theory of Plasticity (1950), V.3, without hardening. With kinematic or no
hardening the change on unloading is a loading with twice the yield stress (G. Masing, 1926).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Wall:
    """Stresses of a tube where D = constant + inverse / r^2 up to ``front``, elastic / r^2 beyond.

    It may also stand for a change of stresses.
    """

    inner: float
    outer: float
    front: float
    constant: float
    inverse: float
    elastic: float

    def difference(self, r: Array) -> Array:
        """Return D, hoop less radial stress."""
        return np.where(r < self.front, self.constant + self.inverse / r**2, self.elastic / r**2)

    def radial(self, r: Array) -> Array:
        """Return the radial stress: less the integral of D/r from r to the free outer face."""
        c, b = self.front, self.outer
        beyond = self.elastic / 2 * (1 / np.maximum(r, c) ** 2 - 1 / b**2)
        s = np.minimum(r, c)
        within = self.constant * np.log(c / s) + self.inverse / 2 * (1 / s**2 - 1 / c**2)
        return -beyond - within

    def hoop(self, r: Array) -> Array:
        """Return the hoop stress."""
        return self.radial(r) + self.difference(r)

    @property
    def pressure(self) -> float:
        """Internal pressure."""
        return -float(self.radial(np.array(self.inner)))


@dataclass(frozen=True, slots=True, kw_only=True)
class IncompressibleTube:
    """A tube under internal pressure; ``kinematic_share`` of the hardening moves the yield surface.

    ``plastic_modulus`` H is the slope of stress over plastic strain in tension [MPa].
    """

    inner: float
    outer: float
    youngs_modulus: float
    yield_stress: float
    plastic_modulus: float = 0.0
    kinematic_share: float = 1.0

    def loaded(self, pressure: float) -> Wall:
        """Return the stresses under a pressure that yields a part of the wall, or none."""
        return self._wall(pressure, self.yield_stress * 2 / sqrt(3), 0.0)

    def change(self, pressure: float) -> Wall:
        """Return by how much the stresses fall when the pressure is taken away.

        Where the elastic range, twice 2 k + (1 - share) times hardening, is passed, the wall yields
        in reverse.
        """
        loaded, share = self.loaded(pressure), self.kinematic_share
        first = 2 * self.yield_stress * 2 / sqrt(3)
        if loaded.front == self.inner:
            return loaded
        constant = share * first + (1 - share) * 2 * loaded.constant
        return self._wall(pressure, constant, (1 - share) * 2 * loaded.inverse)

    def residual(self, pressure: float, r: Array) -> tuple[Array, Array]:
        """Return radial and hoop stress after the pressure is taken away."""
        loaded, change = self.loaded(pressure), self.change(pressure)
        return loaded.radial(r) - change.radial(r), loaded.hoop(r) - change.hoop(r)

    def _wall(self, pressure: float, constant: float, inverse: float) -> Wall:
        """Return the wall that yields where D passes constant + inverse / r^2, from its bore."""
        a, b = self.inner, self.outer

        def at(front: float) -> Wall:
            # hardening: D (1 + H / 3 G) = limit + (4/3) H C / r^2, and 4 G C = D r^2 at the front
            G, H = self.youngs_modulus / 3, self.plastic_modulus
            elastic = constant * front**2 + inverse
            soft = 1 + H / (3 * G)
            return Wall(
                inner=a,
                outer=b,
                front=front,
                constant=constant / soft,
                inverse=(inverse + H * elastic / (3 * G)) / soft,
                elastic=elastic,
            )

        if pressure <= at(a).pressure:
            elastic = 2 * pressure / (1 / a**2 - 1 / b**2)
            return Wall(inner=a, outer=b, front=a, constant=0.0, inverse=0.0, elastic=elastic)
        if pressure > at(b).pressure:
            raise ValueError(f"{pressure} MPa yields the whole wall, {at(b).pressure} at most")
        return at(brentq(lambda front: at(front).pressure - pressure, a, b, xtol=1e-13))

    @property
    def collapse(self) -> float:
        """Pressure that no wall without hardening bears: 2 k ln(b/a) [MPa]."""
        return 2 / sqrt(3) * self.yield_stress * log(self.outer / self.inner)
