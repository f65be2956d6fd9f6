"""A bar between rigid walls that is heated and cooled: the plainest thermal residual stress."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstrainedBar:
    """A bar held at both ends, with a bilinear curve of tension.

    Stresses in MPa, ``expansion`` in 1/K. ``tangent_modulus`` is the slope beyond yield;
    ``kinematic_share`` of the hardening moves the elastic range, the rest widens it.
    """

    youngs_modulus: float
    expansion: float
    yield_stress: float
    tangent_modulus: float = 0.0
    kinematic_share: float = 1.0

    @property
    def plastic_modulus(self) -> float:
        """Slope of stress over plastic strain H = E Et / (E - Et) [MPa]."""
        E, Et = self.youngs_modulus, self.tangent_modulus
        return E * Et / (E - Et)

    @property
    def yield_temperature(self) -> float:
        """Change of temperature at first yield [K]."""
        return self.yield_stress / (self.youngs_modulus * self.expansion)

    def stresses(self, temperatures: Iterable[float]) -> Array:
        """Return the stress [MPa] at each temperature [K], in turn, from 0 at 0.

        Between two temperatures the change is monotonic. The sum of elastic, plastic and thermal
        strain is zero, so beyond the elastic range the stress changes by -Et alpha dT: the exact
        solution, whatever the length of the step.
        """
        E, H = self.youngs_modulus, self.plastic_modulus
        stress, back, radius, before = 0.0, 0.0, self.yield_stress, 0.0
        result = []
        for temperature in temperatures:
            stress -= E * self.expansion * (temperature - before)
            before = temperature
            excess = abs(stress - back) - radius
            if excess > 0:
                strain = float(np.sign(stress - back)) * excess / (E + H)
                stress -= E * strain
                back += self.kinematic_share * H * strain
                radius += (1 - self.kinematic_share) * H * abs(strain)
            result.append(stress)
        return np.array(result)
