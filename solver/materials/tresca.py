"""Tresca's material: linear elasticity, yield by the largest shear stress, isotropic hardening."""

from __future__ import annotations

from dataclasses import dataclass

from solver.materials.growing import GrowingLaw
from solver.materials.principal_return import Returned, principal_return
from solver.materials.state import PlasticState, Response
from solver.materials.tresca_return import tresca_return
from solver.materials.yield_surface import Tresca
from solver.typing import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class TrescaMaterial(GrowingLaw):
    """An isotropic elastic material that yields by Tresca's condition, with associated flow."""

    @property
    def surface(self) -> Tresca:
        """Tresca's hexagonal prism."""
        return Tresca()

    @property
    def has_corners(self) -> bool:
        """True: the surface has edges."""
        return True

    def flow_rule_error(
        self, stress: Array, flow: Array, growth: Array, after: PlasticState
    ) -> Array:
        """Return the error (n_points,) of a flow; at an edge it may lie between two normals."""
        return self.surface.flow_rule_error(stress, flow, growth, 2 * self.elasticity.shear_modulus)

    def respond(self, strain: Array, state: PlasticState) -> Response:
        """Return stress, tangent and new state by the return in principal stresses."""

        def returned(trial: Array, before: Array) -> Returned:
            return tresca_return(trial, before, self.elasticity.shear_modulus, self.curve)

        return principal_return(strain, state, self.elasticity, self.curve, self.surface, returned)
