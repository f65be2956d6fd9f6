"""Material: the law of parts with linear hardening, given by numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from solver.materials.back_stress import ArmstrongFrederick
from solver.materials.curves import Voce
from solver.materials.elastic_plastic import ElasticPlastic
from solver.materials.elasticity import Elasticity
from solver.parameters import Checked, Fraction, HardeningRatio, Infinite, Modulus, Poisson

Hardening = Literal["none", "isotropic", "kinematic", "mixed"]


@dataclass(frozen=True, kw_only=True)
class Material(Checked, ElasticPlastic):
    """An isotropic elastic, linearly hardening von Mises material.

    Attributes
    ----------
    youngs_modulus : E [MPa]
    poisson_ratio : nu
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

    youngs_modulus: Modulus
    poisson_ratio: Poisson
    yield_stress: Modulus | Infinite = math.inf
    hardening: Hardening = "none"
    hardening_ratio: HardeningRatio = 0.0
    isotropic_fraction: Fraction = 0.5

    # -- parts ---------------------------------------------------------------------------------

    @cached_property
    def elasticity(self) -> Elasticity:
        """Hooke's law."""
        return Elasticity(youngs_modulus=self.youngs_modulus, poisson_ratio=self.poisson_ratio)

    @property
    def curve(self) -> Voce:
        """Linear growth of the yield surface."""
        return Voce(yield_stress=self.yield_stress, modulus=self.isotropic_modulus)

    @property
    def back_stresses(self) -> tuple[ArmstrongFrederick, ...]:
        """Prager's back stress, if the yield surface moves."""
        modulus = self.kinematic_modulus
        return (ArmstrongFrederick(modulus),) if modulus else ()

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
