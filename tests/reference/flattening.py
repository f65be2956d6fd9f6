"""An elastic-plastic ball that a rigid plane flattens: Hertz, first yield, and fits of the rest.

Neither fit has hardening. Both were made from finite elements, without friction. Interference is
how far the plane has come from first touch. Lengths in mm, forces in N, stresses in MPa.

References
----------
K.L. Johnson, Contact Mechanics (1985), 3.4 and 4.2.
L. Kogut, I. Etsion, J. Appl. Mech. 69 (2002) 657-662.
R.L. Jackson, I. Green, J. Tribology 127 (2005) 343-354.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class HertzBall:
    """An elastic ball pressed on a plane by ``interference`` (Johnson, 4.22-4.24).

    ``radius`` is the relative one; ``modulus`` is the contact modulus E*, for a rigid plane
    E / (1 - nu^2).
    """

    interference: float
    radius: float
    modulus: float

    @property
    def contact_radius(self) -> float:
        """Radius of the contact a [mm]."""
        return sqrt(self.interference * self.radius)

    @property
    def force(self) -> float:
        """Force [N]."""
        return 4 / 3 * self.modulus * sqrt(self.radius) * self.interference**1.5

    @property
    def peak_pressure(self) -> float:
        """Pressure in the middle p0 [MPa], 3/2 of the mean one."""
        return 2 * self.modulus * self.contact_radius / (pi * self.radius)


def axis_stress(depth: Array, poisson_ratio: float) -> Array:
    """Return radial (and hoop) and axial stress over p0 below the middle of a Hertz contact (2, n).

    ``depth`` is over the contact radius (Johnson, 3.45).
    """
    z = np.asarray(depth, dtype=float)
    falling = 1 / (1 + z**2)
    radial = -(1 + poisson_ratio) * (1 - z * np.arctan2(1.0, z)) + falling / 2
    return np.array([radial, -falling])


def first_yield(poisson_ratio: float) -> tuple[float, float]:
    """Return p0 over the yield stress where yielding begins, and its depth over contact radius.

    On the axis the conditions of von Mises and Tresca are one: |radial - axial| = yield stress. The
    mean pressure is then 2/3 of p0, 1.1 of the yield stress at usual Poisson ratios.
    """

    def negative(z: float) -> float:
        radial, axial = axis_stress(np.array(z), poisson_ratio)
        return float(axial - radial)

    found = minimize_scalar(
        negative, bounds=(0.05, 1.5), method="bounded", options={"xatol": 1e-10}
    )
    return float(-1 / found.fun), float(found.x)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlasticBall:
    """An elastic ball without hardening under a rigid plane."""

    radius: float
    youngs_modulus: float
    poisson_ratio: float
    yield_stress: float

    @property
    def modulus(self) -> float:
        """Contact modulus [MPa], that of a rigid plane."""
        return self.youngs_modulus / (1 - self.poisson_ratio**2)

    def yielding(self) -> HertzBall:
        """Return the ball where it begins to yield, exactly: p0 by ``first_yield``."""
        return self._critical(first_yield(self.poisson_ratio)[0])

    def kogut_etsion(self, interference: float) -> tuple[float, float]:
        """Return force and contact area, by their critical interference.

        Raises
        ------
        ValueError
            Interference above 110 critical ones.
        """
        critical = self.kogut_etsion_critical()
        force, area = kogut_etsion_ratios(interference / critical.interference)
        return force * critical.force, area * pi * critical.contact_radius**2

    def kogut_etsion_critical(self) -> HertzBall:
        """Return the ball where Kogut and Etsion let it yield: p0 = K H, hardness H = 2.8 Re."""
        return self._critical(2.8 * (0.454 + 0.41 * self.poisson_ratio))

    def jackson_green(self, interference: float) -> tuple[float, float]:
        """Return force and contact area; their fit holds to a contact radius of 0.41 radii.

        Up to 1.9 critical interferences it is Hertz's solution. Beyond, the mean pressure tends to
        a hardness that falls as the contact grows, ``jackson_green_hardness``.
        """
        critical = self.jackson_green_critical()
        w = interference / critical.interference
        area = pi * critical.contact_radius**2 * w
        if w <= 1.9:
            return critical.force * w**1.5, area
        strain = self.yield_stress / self.modulus
        area *= (w / 1.9) ** (0.14 * exp(23 * strain))
        hardness = jackson_green_hardness(sqrt(area / pi) / self.radius)
        share = 4 * hardness / self._jackson_green_constant
        force = exp(-(w ** (5 / 12)) / 4) * w**1.5 + share * (1 - exp(-(w ** (5 / 9)) / 25)) * w
        return critical.force * force, area

    def jackson_green_critical(self) -> HertzBall:
        """Return the ball where Jackson and Green let it yield: p0 = 1.295 exp(0.736 nu) Re."""
        return self._critical(self._jackson_green_constant)

    @property
    def _jackson_green_constant(self) -> float:
        return 1.295 * exp(0.736 * self.poisson_ratio)

    def _critical(self, ratio: float) -> HertzBall:
        """Return the ball at p0 = ``ratio`` yield stresses."""
        interference = self.radius * (pi * ratio * self.yield_stress / (2 * self.modulus)) ** 2
        return HertzBall(interference=interference, radius=self.radius, modulus=self.modulus)


def kogut_etsion_ratios(ratio: float) -> tuple[float, float]:
    """Return force and area over their critical values at ``ratio`` critical interferences.

    The two branches do not meet: at 6 the force jumps by 2 %, the area by 3 %.
    """
    if ratio <= 1:
        return ratio**1.5, ratio
    if ratio <= 6:
        return 1.03 * ratio**1.425, 0.93 * ratio**1.136
    if ratio <= 110:
        return 1.40 * ratio**1.263, 0.94 * ratio**1.146
    raise ValueError(f"{ratio} critical interferences are more than 110")


def jackson_green_hardness(contact_ratio: float) -> float:
    """Return mean pressure over yield stress where the ball is fully plastic.

    ``contact_ratio`` is contact radius over radius. For small contacts it is 2.84.
    """
    return 2.84 * (1 - exp(-0.82 * contact_ratio**-0.7))
