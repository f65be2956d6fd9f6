"""Hertz's elliptic contact of two elastic bodies: from their radii and load to the ellipse."""

from __future__ import annotations

import math
from dataclasses import dataclass

_LONGEST = 1e6
"""Largest ratio of the semi-axes that is computed; longer ellipses get this ratio."""
_HALVINGS = 60
_MEANS = 9
"""Steps of the arithmetic-geometric mean; they converge quadratically."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HertzEllipse:
    """A frictionless elastic contact, pressure p0 sqrt(1 - (x/a)^2 - (z/b)^2).

    Attributes
    ----------
    a, b : semi-axes along x and z [mm]
    peak_pressure : p0 [MPa]
    approach : of the bodies, if both are half-spaces [mm]

    References
    ----------
    K.L. Johnson, Contact Mechanics (1985), (4.25) to (4.28)
    """

    a: float
    b: float
    peak_pressure: float
    approach: float

    @classmethod
    def of(
        cls,
        radii: tuple[float, float],
        modulus: float,
        *,
        peak_pressure: float | None = None,
        force: float | None = None,
    ) -> HertzEllipse:
        """Return the contact for a peak pressure or a force.

        Parameters
        ----------
        radii : relative radii in the planes of x and z, each 1 / (1/R1 + 1/R2) [mm]
        modulus : E*, 1/E* is the sum of (1 - nu^2)/E [MPa]
        """
        long, short = max(radii), min(radii)
        ratio = _ratio(long / short)
        K, D = _integrals(ratio)
        steepness = modulus / (2 * long * ratio * D)  # p0 over the longer semi-axis
        if peak_pressure is None:
            assert force is not None
            peak_pressure = (1.5 * force * steepness**2 / (math.pi * ratio)) ** (1 / 3)
        longer = peak_pressure / steepness
        axes = longer, ratio * longer
        a, b = axes if radii[0] >= radii[1] else axes[::-1]
        return cls(
            a=a, b=b, peak_pressure=peak_pressure,
            approach=peak_pressure * ratio * longer * K / modulus,
        )  # fmt: skip

    @property
    def ratio(self) -> float:
        """The longer over the shorter semi-axis."""
        return max(self.a / self.b, self.b / self.a)

    @property
    def force(self) -> float:
        """Force [N]."""
        return 2 / 3 * math.pi * self.a * self.b * self.peak_pressure


def radii_of(ratio: float) -> float:
    """Return the ratio of relative radii, at least 1, of an ellipse with this ratio of semi-axes.

    The ratio of the semi-axes may be longer over shorter, or shorter over longer.
    """
    short = min(ratio, 1 / ratio)
    K, D = _integrals(short)
    return (K - D) / (short**2 * D)


def _ratio(radii: float) -> float:
    """Return the shorter over the longer semi-axis for the ratio of radii, at least 1."""
    low, high = 1 / _LONGEST, 1.0
    for _ in range(_HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if radii_of(middle) > radii else (low, middle)
    return high


def _integrals(ratio: float) -> tuple[float, float]:
    """Return the complete elliptic integrals K and D = (K - E) / e^2, e^2 = 1 - ratio^2.

    M. Abramowitz, I.A. Stegun, Handbook of Mathematical Functions (1964), 17.6: means a, g and
    halves of their difference c; (K - E) / K is the sum of 2^(n-1) c_n^2, with c_0 = e.
    """
    a, g = (1 + ratio) / 2, math.sqrt(ratio)
    square, share = ((1 - ratio) / 2) ** 2, (1 - ratio) / (4 * (1 + ratio))  # c^2, c^2 / e^2
    total, factor = 0.5 + share, 1.0
    for _ in range(_MEANS):
        a, g = (a + g) / 2, math.sqrt(a * g)
        change = square / (16 * a**2)  # c_n+1 = c_n^2 / (4 a_n+1)
        square, share, factor = square * change, share * change, 2 * factor
        total += factor * share
    K = math.pi / (2 * a)
    return K, K * total
