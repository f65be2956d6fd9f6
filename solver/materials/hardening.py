"""Linear growth and motion of a yield surface with plastic strain."""

from __future__ import annotations

from dataclasses import dataclass

from solver.typing import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearHardening:
    """Linear isotropic and linear kinematic (Prager) hardening together.

    Attributes
    ----------
    yield_stress : Re, uniaxial stress at first yield; inf means never [MPa]
    isotropic_modulus : Hi, growth of the yield stress with equivalent plastic strain [MPa]
    kinematic_modulus : Hk, growth of the back stress with plastic strain in tension [MPa]
    """

    yield_stress: float
    isotropic_modulus: float = 0.0
    kinematic_modulus: float = 0.0

    @property
    def modulus(self) -> float:
        """H = Hi + Hk: slope of stress over plastic strain in tension [MPa]."""
        return self.isotropic_modulus + self.kinematic_modulus

    @property
    def prager_modulus(self) -> float:
        """2/3 Hk: ratio of back stress to plastic strain, as tensors [MPa]."""
        return 2 / 3 * self.kinematic_modulus

    def flow_stress(self, accumulated: Array) -> Array:
        """Return the size Re + Hi p (n,) of the yield surface at plastic strain p (n,) [MPa]."""
        return self.yield_stress + self.isotropic_modulus * accumulated

    def strength(self, accumulated: Array) -> Array:
        """Return the stress Re + H p (n,) of the tension curve at plastic strain p (n,) [MPa]."""
        return self.yield_stress + self.modulus * accumulated

    def back_stress(self, plastic_strain: Array) -> Array:
        """Return the centre of the yield surface (n_components, n) for Mandel strain [MPa]."""
        return self.prager_modulus * plastic_strain
