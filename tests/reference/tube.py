"""Elastic thick-walled tubes: pressure (Lamé), a steady flow of heat, a press fit of equal lengths.

Radii and displacements in mm, stresses and pressures in MPa, temperatures in K above that of the
tube without stress.

References
----------
S. Timoshenko, J.N. Goodier, Theory of Elasticity (1951), 26 (Lamé) and 135 (temperature).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ends = Literal["fixed", "free"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tube:
    """An elastic tube; ``inner`` may be 0 for a solid shaft.

    ``ends`` are ``fixed`` (plane strain, no axial strain) or ``free`` (no axial force; the cross
    sections far from the ends stay plane).
    """

    inner: float
    outer: float
    youngs_modulus: float
    poisson_ratio: float
    ends: Ends = "fixed"

    def __post_init__(self) -> None:
        """Check that the wall has a thickness."""
        if not 0 <= self.inner < self.outer:
            raise ValueError(f"inner radius {self.inner} must be from 0 to below {self.outer}")

    def pressed(self, r: Array, inside: float = 0.0, outside: float = 0.0) -> Array:
        """Return radial, hoop and axial stress (3, n) under pressure inside and outside."""
        a2, b2 = self.inner**2, self.outer**2
        mean = (inside * a2 - outside * b2) / (b2 - a2)
        turn = 0.0 if a2 == 0 else (inside - outside) * a2 * b2 / (b2 - a2) / r**2
        radial, hoop = mean - turn + 0 * r, mean + turn + 0 * r
        axial = self.poisson_ratio * (radial + hoop) if self.ends == "fixed" else 0 * r
        return np.array([radial, hoop, axial])

    def widening(self, r: float, inside: float = 0.0, outside: float = 0.0) -> float:
        """Return the radial displacement at radius ``r`` under pressure: r times hoop strain."""
        radial, hoop, axial = self.pressed(np.array(r), inside, outside)
        return float(r * (hoop - self.poisson_ratio * (radial + axial)) / self.youngs_modulus)

    def heated(self, r: Array, inside: float, outside: float, expansion: float) -> Array:
        """Return radial, hoop and axial stress (3, n) of a steady flow of heat through the wall.

        The temperatures of the two faces are given; between them the temperature is a logarithm of
        the radius. ``expansion`` is the thermal expansion [1/K].
        """
        a, b, E, nu = self.inner, self.outer, self.youngs_modulus, self.poisson_ratio
        ratio = log(b / a)
        scale = E * expansion * (inside - outside) / (2 * (1 - nu) * ratio)
        share = a**2 / (b**2 - a**2) * ratio
        radial = scale * (-np.log(b / r) - share * (1 - (b / r) ** 2))
        hoop = scale * (1 - np.log(b / r) - share * (1 + (b / r) ** 2))
        if self.ends == "free":
            return np.array([radial, hoop, radial + hoop])
        warmth = self.temperature(r, inside, outside)
        return np.array([radial, hoop, nu * (radial + hoop) - E * expansion * warmth])

    def temperature(self, r: Array, inside: float, outside: float) -> Array:
        """Return the steady temperature between faces of given temperature."""
        return outside + (inside - outside) * np.log(self.outer / r) / log(self.outer / self.inner)


@dataclass(frozen=True, slots=True, kw_only=True)
class PressFit:
    """A tube or shaft pressed into a hub of the same length.

    ``interference`` is by how much the outer radius of the shaft exceeds the inner one of the hub
    [mm]. It is small against the radius: both are set to ``shaft.outer`` where stress is meant.
    """

    shaft: Tube
    hub: Tube
    interference: float

    @property
    def pressure(self) -> float:
        """Pressure between shaft and hub [MPa]: the widening of both takes up the interference."""
        radius = self.shaft.outer
        wider = self.hub.widening(radius, inside=1.0)
        narrower = -self.shaft.widening(radius, outside=1.0)
        return self.interference / (wider + narrower)

    def shaft_stress(self, r: Array) -> Array:
        """Return radial, hoop and axial stress of the shaft (3, n)."""
        return self.shaft.pressed(r, outside=self.pressure)

    def hub_stress(self, r: Array) -> Array:
        """Return radial, hoop and axial stress of the hub (3, n)."""
        return self.hub.pressed(r, inside=self.pressure)
