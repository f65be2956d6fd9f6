"""Material = linear elasticity + von Mises yield surface + linear hardening."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

from solver.errors import ModelError
from solver.kinds import check_kinds
from solver.materials.elasticity import Elasticity
from solver.materials.hardening import LinearHardening
from solver.materials.law import Law
from solver.materials.projected_return import ProjectedReturn
from solver.materials.radial_return import radial_return
from solver.materials.state import PlasticState, Response
from solver.typing import Array

Hardening = Literal["none", "isotropic", "kinematic", "mixed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Material(Law):
    """An isotropic elastic, linearly hardening von Mises material.

    Attributes
    ----------
    youngs_modulus : E [MPa]
    poisson_ratio : nu, 0 <= nu < 0.5
    yield_stress : uniaxial yield stress [MPa]; ``inf`` (default) means elastic
    hardening : ``none``, ``isotropic``, ``kinematic`` (Prager) or ``mixed``
    hardening_ratio : Eu / E, ratio of the slope of the uniaxial curve beyond yield to Young's
        modulus
    isotropic_fraction : part of the plastic modulus that expands the yield surface when
        ``hardening`` is ``mixed``; the rest moves it

    Raises
    ------
    ModelError
        if a number is out of its range, or the word unknown
    """

    youngs_modulus: float
    poisson_ratio: float
    yield_stress: float = math.inf
    hardening: Hardening = "none"
    hardening_ratio: float = 0.0
    isotropic_fraction: float = 0.5

    def __post_init__(self) -> None:
        check_kinds(Material, self)
        if not (math.isfinite(self.youngs_modulus) and self.youngs_modulus > 0):
            raise ModelError("youngs_modulus", self.youngs_modulus, "must be positive [MPa]")
        if not 0 <= self.poisson_ratio < 0.5:
            raise ModelError("poisson_ratio", self.poisson_ratio, "must be in [0, 0.5)")
        if not self.yield_stress > 0:
            raise ModelError("yield_stress", self.yield_stress, "must be positive [MPa]")
        if self.hardening not in get_args(Hardening):
            allowed = "must be one of " + ", ".join(get_args(Hardening))
            raise ModelError("hardening", self.hardening, allowed)
        if not 0 <= self.hardening_ratio < 1:
            raise ModelError("hardening_ratio", self.hardening_ratio, "must be in [0, 1)")
        if not 0 <= self.isotropic_fraction <= 1:
            raise ModelError("isotropic_fraction", self.isotropic_fraction, "must be in [0, 1]")

    # -- parts ---------------------------------------------------------------------------------

    @property
    def elasticity(self) -> Elasticity:
        """Hooke's law."""
        return Elasticity(youngs_modulus=self.youngs_modulus, poisson_ratio=self.poisson_ratio)

    @property
    def hardening_rule(self) -> LinearHardening:
        """Linear growth and motion of the yield surface."""
        return LinearHardening(
            yield_stress=self.yield_stress,
            isotropic_modulus=self.isotropic_modulus,
            kinematic_modulus=self.kinematic_modulus,
        )

    @property
    def shear_modulus(self) -> float:
        """G [MPa]."""
        return self.elasticity.shear_modulus

    @property
    def bulk_modulus(self) -> float:
        """K [MPa]."""
        return self.elasticity.bulk_modulus

    @property
    def plastic_modulus(self) -> float:
        """H = E Eu / (E - Eu): slope of stress over plastic strain in tension [MPa]."""
        if self.hardening == "none":
            return 0.0
        return self.youngs_modulus * self.hardening_ratio / (1 - self.hardening_ratio)

    @property
    def isotropic_modulus(self) -> float:
        """Part of the plastic modulus that expands the yield surface [MPa]."""
        share = {"isotropic": 1.0, "mixed": self.isotropic_fraction}.get(self.hardening, 0.0)
        return share * self.plastic_modulus

    @property
    def kinematic_modulus(self) -> float:
        """Part of the plastic modulus that moves the yield surface [MPa]."""
        return self.plastic_modulus - self.isotropic_modulus

    # -- the law, see `Law` --------------------------------------------------------------------

    @property
    def hardens(self) -> bool:
        """Whether stress grows with plastic strain."""
        return self.plastic_modulus > 0

    @property
    def ultimate_shear_stress(self) -> float:
        """The shear yield stress without hardening, inf with it [MPa]."""
        return math.inf if self.hardens else self.shear_yield_stress

    def flow_stress(self, state: PlasticState) -> Array:
        """Return the yield stress plus its isotropic growth (n_points,) [MPa]."""
        return self.hardening_rule.flow_stress(state.accumulated)

    def back_stress(self, state: PlasticState) -> Array:
        """Return Prager's back stress (n_components, n_points), Mandel [MPa]."""
        return self.hardening_rule.back_stress(state.plastic_strain)

    def strength(self, state: PlasticState) -> Array:
        """Return the stress of the uniaxial curve at this plastic strain (n_points,) [MPa]."""
        return self.hardening_rule.strength(state.accumulated)

    def respond(self, strain: Array, state: PlasticState) -> Response:
        """Return stress, tangent and new state by the radial return."""
        return radial_return(strain, state, self.elasticity, self.hardening_rule)

    def in_plane_stress(self) -> ProjectedReturn:
        """Return this law in plane stress, by the projected return."""
        return ProjectedReturn(self, self.hardening_rule)
