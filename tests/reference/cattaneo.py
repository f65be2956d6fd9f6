"""Two similar elastic cylinders pressed together, then pushed sideways (Cattaneo, Mindlin).

Plane strain, equal materials (or any with Dundurs' beta zero), so that the shear traction does
not act back on the pressure. The normal force is constant while the tangential one changes.
Forces are those per unit thickness [N/mm].

References
----------
K.L. Johnson, Contact Mechanics (1985), 4.2(c) Hertz, 7.2 (a) Cattaneo, 7.4 (a) alternating force.
C. Cattaneo, Rend. Accad. Lincei 27 (1938) 342-348; R.D. Mindlin, J. Appl. Mech. 16 (1949) 259-268;
R.D. Mindlin, H. Deresiewicz, J. Appl. Mech. 20 (1953) 327-344.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad

Array = NDArray[np.float64]


def ellipse(x: Array, half_width: float) -> Array:
    """Return sqrt(1 - x^2 / half_width^2), and 0 outside."""
    return np.sqrt(np.maximum(0.0, 1 - (x / half_width) ** 2))


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingCylinders:
    """Cylinders pressed together by ``force`` P [N/mm], with a tangential force below f P.

    ``radius`` is the relative one [mm], 1/R = 1/R1 + 1/R2; ``modulus`` is the contact modulus E*
    [MPa], 1/E* the sum of (1 - nu^2) / E of both bodies.
    """

    force: float
    radius: float
    modulus: float
    friction: float

    def __post_init__(self) -> None:
        """Check that all numbers are positive."""
        if min(self.force, self.radius, self.modulus, self.friction) <= 0:
            raise ValueError("force, radius, modulus and friction must be positive")

    @property
    def half_width(self) -> float:
        """Half-width of the contact a [mm]."""
        return sqrt(4 * self.force * self.radius / (pi * self.modulus))

    @property
    def peak_pressure(self) -> float:
        """Pressure in the middle p0 [MPa]."""
        return 2 * self.force / (pi * self.half_width)

    def pressure(self, x: Array) -> Array:
        """Return the contact pressure [MPa] at distances ``x`` [mm] from the middle."""
        return self.peak_pressure * ellipse(x, self.half_width)

    def stick_width(self, tangential: float) -> float:
        """Return half the width c [mm] of what sticks after the first push by ``tangential``."""
        return self.half_width * sqrt(1 - self._share(tangential))

    def reversed_stick_width(self, tangential: float, largest: float) -> float:
        """Return half the width b [mm] of what has not slipped back on the way from ``largest``.

        A change of force acts as a first push against twice the friction.
        """
        return self.half_width * sqrt(1 - self._share((largest - tangential) / 2))

    def shear(self, x: Array, tangential: float) -> Array:
        """Return the shear traction [MPa] after the first push by ``tangential`` [N/mm]."""
        c = self.stick_width(tangential)
        return np.sign(tangential) * self._ellipses(x, (1, self.half_width), (-1, c))

    def reversed_shear(self, x: Array, tangential: float, largest: float) -> Array:
        """Return the shear traction [MPa] on the way from ``largest`` to ``-largest``.

        At ``-largest`` it is that of a first push by ``-largest``: every later cycle is alike.
        """
        if abs(tangential) > abs(largest):
            raise ValueError(f"{tangential} N/mm is beyond the largest, {largest}")
        b, c = self.reversed_stick_width(tangential, largest), self.stick_width(largest)
        terms = (-1, self.half_width), (2, b), (-1, c)
        return np.sign(largest) * self._ellipses(x, *terms)

    def slip(self, x: Array, tangential: float) -> Array:
        """Return by how much what is pushed has slipped forward over the other body [mm].

        Its gradient is (2 / E*) (1/pi) int q / (x - s) ds: zero where the surfaces stick, and
        (2 / E*) f p0 sign(x) sqrt(x^2 - c^2) / a in the rest of the contact.
        """
        c, y = self.stick_width(tangential), np.abs(x)
        y = np.where((c < y) & (y <= self.half_width), y, c)
        root = np.sqrt(y**2 - c**2)
        area = y * root if c == 0 else y * root - c**2 * np.log((y + root) / c)
        return np.sign(tangential) * self._slip_scale * area

    def dissipation(self, largest: float) -> float:
        """Return the heat of one cycle between ``largest`` and ``-largest`` [N/mm * mm].

        Twice a cycle each point of the slip zone slips by twice its first slip, under f p.
        """
        c, a = self.stick_width(largest), self.half_width

        def power(x: float) -> float:
            at = np.array([x])
            return float((self.friction * self.pressure(at) * self.slip(at, abs(largest)))[0])

        return 2 * 2 * 2 * quad(power, c, a, epsrel=1e-10)[0]

    @property
    def _slip_scale(self) -> float:
        return self.friction * self.peak_pressure / (self.half_width * self.modulus)

    def _share(self, tangential: float) -> float:
        """Return the share of a tangential force in that of full slip."""
        share = abs(tangential) / (self.friction * self.force)
        if share > 1 + 1e-12:
            raise ValueError(f"{tangential} N/mm is more than friction bears")
        return min(share, 1.0)

    def _ellipses(self, x: Array, *terms: tuple[float, float]) -> Array:
        """Return the sum of f p0 (width / a) sqrt(1 - x^2 / width^2) times each factor."""
        total = np.zeros(np.shape(x))
        for factor, width in terms:
            if width > 0:
                total += factor * width / self.half_width * ellipse(x, width)
        return self.friction * self.peak_pressure * total
