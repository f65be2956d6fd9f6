"""Tresca's material: linear elasticity, yield by the largest shear stress, isotropic hardening."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from solver.materials.elasticity import Elasticity
from solver.materials.law import Law
from solver.materials.tresca_return import tresca_return
from solver.materials.yield_surface import Tresca

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from solver.materials.curves import Curve
    from solver.materials.state import PlasticState, Response


@dataclass(frozen=True, slots=True, kw_only=True)
class TrescaMaterial(Law):
    """An isotropic elastic material that yields by Tresca's condition, with associated flow.

    Attributes
    ----------
    elasticity : Hooke's law
    curve : how its yield surface grows; `Voce` without saturation and modulus does not harden
    """

    elasticity: Elasticity
    curve: Curve

    @property
    def surface(self) -> Tresca:
        """Tresca's hexagonal prism."""
        return Tresca()

    @property
    def has_corners(self) -> bool:
        """Yes: its surface has edges."""
        return True

    @property
    def hardens(self) -> bool:
        """Whether stress grows with plastic strain without bound."""
        return math.isinf(self.curve.limit)

    @property
    def ultimate_shear_stress(self) -> float:
        """Half the stress that the curve tends to [MPa]."""
        return self.surface.shear(self.curve.limit)

    def flow_stress(self, state: PlasticState) -> NDArray[np.float64]:
        """Return the stress of the curve (n_points,) [MPa]."""
        return self.curve.flow_stress(state.accumulated)

    def flow_rule_error(
        self,
        stress: NDArray[np.float64],
        flow: NDArray[np.float64],
        growth: NDArray[np.float64],
        after: PlasticState,
    ) -> NDArray[np.float64]:
        """Return the error of a flow, which at an edge may lie between two normals."""
        return self.surface.flow_rule_error(stress, flow, growth, 2 * self.elasticity.shear_modulus)

    def respond(self, strain: NDArray[np.float64], state: PlasticState) -> Response:
        """Return stress, tangent and new state by the return in principal stresses."""
        return tresca_return(strain, state, self.elasticity, self.curve)
