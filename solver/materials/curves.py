"""Hardening curves: the size of the yield surface over the accumulated plastic strain."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Protocol

import numpy as np
from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.parameters import Checked, Infinite, Modulus, NotNegative
from solver.typing import Array

Saturation = Annotated[float, Interval(ge=0.0, le=1e7), Unit("MPa")]
Rate = Annotated[float, Interval(gt=0.0, le=1e6), Unit("1")]
Exponent = Annotated[float, Interval(ge=0.0, le=1.0), Unit("1")]


class Curve(Protocol):
    """The size of a yield surface, as a tensile stress; it must not fall with plastic strain."""

    def flow_stress(self, accumulated: Array) -> Array:
        """Return the size (n,) of the yield surface at plastic strains (n,) [MPa]."""

    def slope(self, accumulated: Array) -> Array:
        """Return the derivative (n,) of the size by plastic strain [MPa]."""

    @property
    def limit(self) -> float:
        """Limit of the size at large plastic strain [MPa]; inf if it grows without bound."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Voce(Checked):
    """Exponential growth that saturates, plus a linear part: Re + Q (1 - exp(-b p)) + H p.

    Attributes
    ----------
    yield_stress : Re, tensile stress at first yield [MPa]; inf if it never yields
    saturation : Q, growth at saturation [MPa]
    rate : b, rate of growth with plastic strain
    modulus : H, slope of the linear part [MPa]

    References
    ----------
    E. Voce, J. Inst. Metals 74 (1948) 537-562.
    """

    yield_stress: Modulus | Infinite
    saturation: Saturation = 0.0
    rate: Rate = 1.0
    modulus: NotNegative = 0.0

    def flow_stress(self, accumulated: Array) -> Array:
        """See `Curve`."""
        grown = -np.expm1(-self.rate * accumulated)
        return self.yield_stress + self.saturation * grown + self.modulus * accumulated

    def slope(self, accumulated: Array) -> Array:
        """See `Curve`."""
        return self.saturation * self.rate * np.exp(-self.rate * accumulated) + self.modulus

    @property
    def limit(self) -> float:
        """See `Curve`."""
        return math.inf if self.modulus else self.yield_stress + self.saturation


@dataclass(frozen=True, slots=True, kw_only=True)
class Power(Checked):
    """A power of the strain that begins at first yield: Re (1 + p / e0)^n, with e0 = Re / E.

    Attributes
    ----------
    yield_stress : Re, tensile stress at first yield [MPa]
    youngs_modulus : E; the curve begins with the slope n E [MPa]
    exponent : n

    References
    ----------
    H.W. Swift, J. Mech. Phys. Solids 1 (1952) 1-18; M. Dao, N. Chollacoop, K.J. Van Vliet, T.A.
    Venkatesh, S. Suresh, Acta Materialia 49 (2001) 3899-3918, eq. (3).
    """

    yield_stress: Modulus
    youngs_modulus: Modulus
    exponent: Exponent

    def flow_stress(self, accumulated: Array) -> Array:
        """See `Curve`."""
        return np.asarray(self.yield_stress * self._grown(accumulated) ** self.exponent)

    def slope(self, accumulated: Array) -> Array:
        """See `Curve`."""
        grown = self._grown(accumulated) ** (self.exponent - 1)
        return np.asarray(self.exponent * self.youngs_modulus * grown)

    def _grown(self, accumulated: Array) -> Array:
        return 1 + accumulated * (self.youngs_modulus / self.yield_stress)

    @property
    def limit(self) -> float:
        """See `Curve`."""
        return math.inf if self.exponent else self.yield_stress


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Straight lines between measured points; constant after the last one.

    Attributes
    ----------
    plastic_strain : (n,) from 0, increasing
    stress : (n,) size at these strains, positive, not falling [MPa]
    """

    plastic_strain: tuple[float, ...]
    stress: tuple[float, ...]

    def __post_init__(self) -> None:
        strain, stress = np.asarray(self.plastic_strain), np.asarray(self.stress)
        if strain.ndim != 1 or strain.shape != stress.shape or not len(strain):
            shapes = f"{strain.shape} and {stress.shape}"
            raise ModelError("table", shapes, "needs as many plastic strains as stresses")
        if not (np.isfinite(strain).all() and strain[0] == 0 and (np.diff(strain) > 0).all()):
            raise ModelError("table.plastic_strain", self.plastic_strain, "must grow from 0")
        if not (np.isfinite(stress).all() and stress[0] > 0 and (np.diff(stress) >= 0).all()):
            allowed = "must be positive and must not fall [MPa]"
            raise ModelError("table.stress", self.stress, allowed)

    def flow_stress(self, accumulated: Array) -> Array:
        """See `Curve`."""
        return np.asarray(np.interp(accumulated, self.plastic_strain, self.stress))

    def slope(self, accumulated: Array) -> Array:
        """See `Curve`; at a point of the table it is the slope of the line after it."""
        slopes = np.append(np.diff(self.stress) / np.diff(self.plastic_strain), 0.0)
        at = np.searchsorted(self.plastic_strain, accumulated, side="right") - 1
        return np.asarray(slopes[at])

    @property
    def limit(self) -> float:
        """See `Curve`."""
        return self.stress[-1]
