"""Laws with an isotropic yield surface that grows along a curve and does not move."""

from __future__ import annotations

import math
from dataclasses import dataclass

from solver.materials.curves import Curve
from solver.materials.elasticity import Elasticity
from solver.materials.law import Law
from solver.materials.state import PlasticState
from solver.typing import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class GrowingLaw(Law):
    """An isotropic elastic material with isotropic hardening.

    Attributes
    ----------
    elasticity : Hooke's law
    curve : size of its yield surface; `Voce` without saturation and modulus does not harden
    """

    elasticity: Elasticity
    curve: Curve

    @property
    def hardens(self) -> bool:
        """Whether stress grows with plastic strain without bound."""
        return math.isinf(self.curve.limit)

    @property
    def ultimate_shear_stress(self) -> float:
        """Shear stress equivalent to the limit of the curve [MPa]."""
        return self.surface.shear(self.curve.limit)

    def flow_stress(self, state: PlasticState) -> Array:
        """Return the stress of the curve (n_points,) [MPa]."""
        return self.curve.flow_stress(state.accumulated)
