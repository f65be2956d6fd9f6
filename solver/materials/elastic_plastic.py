"""The law of parts: elasticity, yield surface, hardening curve and back stresses; or by numbers.

`ElasticPlastic` is the law; its subclasses only declare its parts. The parts decide how it
responds: in closed form if hardening is linear on a von Mises surface, by one scalar equation or
Newton's method with other curves and back stresses, and in principal stresses on other surfaces.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from solver.errors import ModelError
from solver.materials.back_stress import ArmstrongFrederick, BackStress
from solver.materials.back_stress_return import ChabocheState, back_stress_return
from solver.materials.curves import Curve, Voce
from solver.materials.elasticity import Elasticity
from solver.materials.law import Law, attribute
from solver.materials.principal_return import principal_return
from solver.materials.radial_return import LinearHardening, radial_return
from solver.materials.smooth_surface import SmoothSurface
from solver.materials.state import PlasticState, Response
from solver.materials.yield_surface import IsotropicSurface, Tresca, VonMises
from solver.parameters import Checked, Fraction, HardeningRatio, Infinite, Modulus, Poisson
from solver.typing import Array


class ElasticPlastic(Law):
    """An isotropic elastic material with associated flow, made of parts."""

    def __post_init__(self) -> None:
        if math.isinf(self.elasticity.youngs_modulus):
            raise ModelError("youngs_modulus", math.inf, "must be finite [MPa]")

    @attribute
    def surface(self) -> VonMises | IsotropicSurface:
        """The shape of the yield surface."""
        return VonMises()

    @attribute
    def curve(self) -> Curve:
        """Size of the yield surface over the accumulated plastic strain."""
        raise NotImplementedError(f"{type(self).__name__} must give its curve")

    @attribute
    def back_stresses(self) -> tuple[BackStress, ...]:
        """Rules of the back stresses, whose sum is the centre; only a von Mises surface moves."""
        return ()

    @cached_property
    def linear_hardening(self) -> LinearHardening | None:
        """The hardening, if it is linear and the surface is von Mises'; None otherwise."""
        curve, moduli, own = self.curve, 0.0, type(self)
        # a subclass may change what it inherits
        if not (
            type(self.surface) is VonMises
            and type(curve) is Voce
            and not curve.saturation
            and own.respond is ElasticPlastic.respond
            and own.flow_stress is ElasticPlastic.flow_stress
            and own.back_stress is ElasticPlastic.back_stress
        ):
            return None
        for rule in self.back_stresses:
            if type(rule) is not ArmstrongFrederick or rule.recall:
                return None
            moduli += rule.modulus
        return LinearHardening(
            yield_stress=curve.yield_stress,
            isotropic_modulus=curve.modulus,
            kinematic_modulus=moduli,
        )

    # -- the law, see `Law` --------------------------------------------------------------------

    @property
    def symmetric(self) -> bool:
        """Whether the tangent is symmetric: no back stress fades."""
        return all(rule.symmetric for rule in self.back_stresses)

    @property
    def hardens(self) -> bool:
        """Whether stress grows with plastic strain without bound."""
        return math.isinf(self._limit)

    @property
    def ultimate_shear_stress(self) -> float:
        """Limit of the shear stress that curve and back stresses carry together [MPa]."""
        return self.surface.shear(self._limit)

    @property
    def _limit(self) -> float:
        return self.curve.limit + sum(rule.limit for rule in self.back_stresses)

    def initial(self, n_points: int, n_components: int) -> PlasticState:
        """Return the state of a material that has never yielded.

        Back stresses are internal variables, but for linear hardening: they follow from the plastic
        strain.
        """
        virgin = PlasticState.virgin(n_points, n_components)
        if self.linear_hardening or not isinstance(self.surface, VonMises):
            return virgin
        back = np.zeros((len(self.back_stresses), n_components, n_points))
        return ChabocheState(virgin.plastic_strain, virgin.accumulated, back)

    def flow_stress(self, state: PlasticState) -> Array:
        """Return the stress of the curve (n_points,) [MPa]."""
        return (self.linear_hardening or self.curve).flow_stress(state.accumulated)

    def back_stress(self, state: PlasticState) -> Array:
        """Return the sum of the back stresses (n_components, n_points), Mandel [MPa]."""
        if self.linear_hardening:
            return self.linear_hardening.back_stress(state.plastic_strain)
        if isinstance(state, ChabocheState):
            return np.asarray(state.back.sum(axis=0))
        return Law.back_stress(self, state)

    def strength(self, state: PlasticState) -> Array:
        """Return the stress of a tension test at this plastic strain (n_points,) [MPa]."""
        if self.linear_hardening:
            return self.linear_hardening.strength(state.accumulated)
        p = state.accumulated
        return self.curve.flow_stress(p) + sum(rule.in_tension(p) for rule in self.back_stresses)

    def dissipation(self, before: PlasticState, response: Response) -> Array:
        """Return the work (n_points,) that an increment turns into heat [N mm/mm3].

        Back stresses that fade release stored work.
        """
        heat = Law.dissipation(self, before, response)
        for rule, increment in self._increments(before, response.state):
            heat = heat + rule.heat(*increment)
        return np.asarray(heat)

    def misfit(
        self, strain: Array, stress: Array, before: PlasticState, after: PlasticState
    ) -> Array:
        """Return the error of an increment, including the back stresses (n_points,) [MPa]."""
        worst = Law.misfit(self, strain, stress, before, after)
        for rule, increment in self._increments(before, after):
            worst = np.maximum(worst, np.abs(rule.misfit(*increment)).max(axis=0))
        return worst

    def _increments(
        self, before: PlasticState, after: PlasticState
    ) -> Iterator[tuple[BackStress, tuple[Array, Array, Array, Array]]]:
        """Yield each stored back stress: rule, and old and new value, growth dp and flow."""
        if isinstance(before, ChabocheState) and isinstance(after, ChabocheState):
            flow = after.plastic_strain - before.plastic_strain
            dp = after.accumulated - before.accumulated
            for rule, old, new in zip(self.back_stresses, before.back, after.back, strict=True):
                yield rule, (old, new, dp, flow)

    def respond(self, strain: Array, state: PlasticState) -> Response:
        """Return stress, consistent tangent and new state by the return that the parts need."""
        linear, surface = self.linear_hardening, self.surface
        if linear:
            return radial_return(strain, state, self.elasticity, linear)
        if isinstance(surface, VonMises):
            parts = self.elasticity, self.curve, self.back_stresses
            return back_stress_return(strain, state, *parts)
        return principal_return(strain, state, self.elasticity, self.curve, surface)


@dataclass(frozen=True, kw_only=True)
class Chaboche(ElasticPlastic):
    """A von Mises material whose yield surface grows along a curve and moves by back stresses.

    It is the law of fatigue and rail engineers: the back stresses of Armstrong and Frederick fade,
    so that repeated loading about a mean stress ratchets; the curve lets the surface grow and
    saturate. Other rules of back stresses are subclasses of `BackStress`.

    Attributes
    ----------
    elasticity : Hooke's law
    curve : size of the yield surface over the accumulated plastic strain
    back_stresses : rules of the back stresses, whose sum is the centre of the yield surface

    References
    ----------
    J.L. Chaboche, Int. J. Plasticity 5 (1989) 247-302. Backward Euler and its tangent as in
    S. Hartmann, P. Haupt, Int. J. Numer. Meth. Engng 36 (1993) 3801-3814.
    """

    elasticity: Elasticity
    curve: Curve
    back_stresses: tuple[BackStress, ...] = ()


@dataclass(frozen=True, kw_only=True)
class TrescaMaterial(ElasticPlastic):
    """A material that yields by Tresca's condition and grows along a curve.

    Attributes
    ----------
    elasticity : Hooke's law
    curve : size of its yield surface; `Voce` without saturation and modulus does not harden
    """

    elasticity: Elasticity
    curve: Curve

    @property
    def surface(self) -> Tresca:
        """Tresca's hexagonal prism."""
        return Tresca()


@dataclass(frozen=True, kw_only=True)
class SmoothMaterial(ElasticPlastic):
    """A material that yields on a smooth surface and grows along a curve.

    Attributes
    ----------
    elasticity : Hooke's law
    curve : size of its yield surface; `Voce` without saturation and modulus does not harden
    surface : the shape of its yield surface

    Raises
    ------
    ModelError
        if the surface is not smooth or not convex, or does not give the stress in tension
    """

    elasticity: Elasticity
    curve: Curve
    surface: SmoothSurface

    def __post_init__(self) -> None:
        ElasticPlastic.__post_init__(self)
        self.surface.check()


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
