"""Hardening rules by the word that names them in scenes and scene files.

A rule is a frozen dataclass whose fields are its parameters. It gives the law of a material. A rule
by which the yield surface grows and does not move gives a curve and goes with any yield condition.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from solver.errors import ModelError
from solver.materials.back_stress import ArmstrongFrederick, BackStress
from solver.materials.curves import Curve, Exponent, Power, Rate, Saturation, Table, Voce
from solver.materials.elastic_plastic import Chaboche
from solver.materials.elasticity import Elasticity
from solver.materials.law import Law
from solver.materials.layered import Layered
from solver.parameters import Checked, Fraction, HardeningRatio, Pairs, described
from solver.parts import Parts
from solver.typing import Array


class HardeningRule(Checked, ABC):
    """How a material hardens once it has yielded."""

    __slots__ = ()

    @abstractmethod
    def law(self, elasticity: Elasticity, yield_stress: float) -> Law:
        """Return the law of a von Mises material with this hardening; ``yield_stress`` in MPa.

        Raises
        ------
        ModelError
            naming the wrong parameter
        """


HARDENING: Parts[HardeningRule] = Parts("hardening")
"""The rules by word. Files and tables list their parameters in this order."""


class GrowingRule(HardeningRule):
    """The yield surface grows along a curve and does not move."""

    __slots__ = ()

    @abstractmethod
    def flow_curve(self, elasticity: Elasticity, yield_stress: float) -> Curve:
        """Return the curve along which the yield surface grows; ``yield_stress`` in MPa."""

    def law(self, elasticity: Elasticity, yield_stress: float) -> Law:
        """Return the von Mises law with this curve."""
        return Chaboche(elasticity=elasticity, curve=self.flow_curve(elasticity, yield_stress))


class MovingRule(HardeningRule):
    """The yield surface moves by back stresses; it grows only if `flow_curve` is overridden."""

    __slots__ = ()

    @abstractmethod
    def parts(self, yield_stress: float) -> tuple[BackStress, ...]:
        """Return the rules of the back stresses; ``yield_stress`` in MPa."""

    def flow_curve(self, yield_stress: float) -> Curve:
        """Return the curve along which the yield surface grows; by default it is constant."""
        return Voce(yield_stress=yield_stress)

    def law(self, elasticity: Elasticity, yield_stress: float) -> Law:
        """Return Chaboche's law with these back stresses and this curve."""
        parts, curve = self.parts(yield_stress), self.flow_curve(yield_stress)
        return Chaboche(elasticity=elasticity, curve=curve, back_stresses=parts)


# -- the rules of the package --------------------------------------------------------------------


@HARDENING.word("none")
@dataclass(frozen=True, slots=True, kw_only=True)
class NoHardening(GrowingRule):
    """The yield surface does not change."""

    def flow_curve(self, elasticity: Elasticity, yield_stress: float) -> Curve:
        """Return the constant yield stress."""
        return Voce(yield_stress=yield_stress)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Sloped:
    hardening_ratio: HardeningRatio = described(
        0.024, "ratio of the slope Eu of the uniaxial hardening branch to Young's modulus"
    )

    def modulus(self, elasticity: Elasticity) -> float:
        """Return the slope of stress over plastic strain in tension [MPa]."""
        return elasticity.youngs_modulus * self.hardening_ratio / (1 - self.hardening_ratio)


@HARDENING.word("isotropic")
@dataclass(frozen=True, slots=True, kw_only=True)
class IsotropicHardening(_Sloped, GrowingRule):
    """The yield surface grows linearly."""

    def flow_curve(self, elasticity: Elasticity, yield_stress: float) -> Curve:
        """Return the yield stress with its linear growth."""
        return Voce(yield_stress=yield_stress, modulus=self.modulus(elasticity))


@HARDENING.word("kinematic")
@dataclass(frozen=True, slots=True, kw_only=True)
class KinematicHardening(_Sloped, HardeningRule):
    """The yield surface moves linearly."""

    def law(self, elasticity: Elasticity, yield_stress: float) -> Law:
        """Return the law with Prager's back stress."""
        return _mixed(elasticity, yield_stress, 0.0, self.modulus(elasticity))


@HARDENING.word("mixed")
@dataclass(frozen=True, slots=True, kw_only=True)
class MixedHardening(_Sloped, HardeningRule):
    """The yield surface grows and moves linearly."""

    isotropic_fraction: Fraction = described(0.5, "part of mixed hardening that is isotropic")

    def law(self, elasticity: Elasticity, yield_stress: float) -> Law:
        """Return the law with linear growth and Prager's back stress."""
        H = self.modulus(elasticity)
        grows = self.isotropic_fraction * H
        return _mixed(elasticity, yield_stress, grows, H - grows)


def _mixed(elasticity: Elasticity, yield_stress: float, grows: float, moves: float) -> Law:
    curve, back = Voce(yield_stress=yield_stress, modulus=grows), ArmstrongFrederick(moves)
    return Chaboche(elasticity=elasticity, curve=curve, back_stresses=(back,))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Saturating:
    saturation: Saturation = described(
        0.0, "growth of the yield stress at saturation, with voce and chaboche hardening"
    )
    saturation_rate: Rate = described(
        10.0, "rate of this growth: it follows 1 - exp(-rate * plastic strain)"
    )

    def voce(self, yield_stress: float) -> Voce:
        return Voce(
            yield_stress=yield_stress, saturation=self.saturation, rate=self.saturation_rate
        )


@HARDENING.word("voce")
@dataclass(frozen=True, slots=True, kw_only=True)
class VoceHardening(_Saturating, GrowingRule):
    """The yield surface grows and saturates."""

    def flow_curve(self, elasticity: Elasticity, yield_stress: float) -> Curve:
        """Return Voce's curve."""
        if not self.saturation:
            raise ModelError("saturation", self.saturation, "must be given with voce hardening")
        return self.voce(yield_stress)


@HARDENING.word("power")
@dataclass(frozen=True, slots=True, kw_only=True)
class PowerHardening(GrowingRule):
    """The yield surface grows with a power of the strain."""

    hardening_exponent: Exponent = described(
        0.1, "exponent n of power hardening: stress Re (1 + E p / Re)^n at the plastic strain p"
    )

    def flow_curve(self, elasticity: Elasticity, yield_stress: float) -> Curve:
        """Return the power law that begins at the yield stress."""
        return Power(
            yield_stress=yield_stress, youngs_modulus=elasticity.youngs_modulus,
            exponent=self.hardening_exponent,
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class _Measured:
    curve: Pairs = described(
        (), "points [plastic strain, stress in MPa] of the tension curve, with table and layered "
        "hardening; the first is [0, yield_stress]",
    )  # fmt: skip

    def points(self, yield_stress: float, word: str) -> tuple[Array, Array]:
        """Return plastic strain (n,) and stress (n,) [MPa] of the points.

        Raises `ModelError` unless they begin at [0, yield_stress] and rise.
        """
        strain, stress = np.reshape(self.curve, (-1, 2)).T
        begins = bool(self.curve) and (strain[0], stress[0]) == (0.0, yield_stress)
        rises = (np.diff(strain) > 0).all() and (np.diff(stress) >= 0).all()
        if not (begins and rises):
            raise ModelError(
                "curve", self.curve,
                f"must be points [plastic strain, stress in MPa] with {word} hardening: the "
                f"first [0, yield_stress] = [0, {yield_stress:g}], strain increasing, stress not "
                "falling",
            )  # fmt: skip
        return strain, stress


@HARDENING.word("table")
@dataclass(frozen=True, slots=True, kw_only=True)
class TableHardening(_Measured, GrowingRule):
    """The yield surface grows along measured points."""

    def flow_curve(self, elasticity: Elasticity, yield_stress: float) -> Curve:
        """Return the straight lines between the points."""
        strain, stress = self.points(yield_stress, "table")
        return Table(plastic_strain=tuple(strain.tolist()), stress=tuple(stress.tolist()))


@HARDENING.word("chaboche")
@dataclass(frozen=True, slots=True, kw_only=True)
class ChabocheHardening(_Saturating, MovingRule):
    """The yield surface moves by back stresses that fade, and may grow as with voce."""

    back_stresses: Pairs = described(
        (), "[modulus C in MPa, recall gamma] of each, with chaboche hardening"
    )

    def parts(self, yield_stress: float) -> tuple[BackStress, ...]:
        """Return one Armstrong-Frederick rule per pair of constants."""
        if not self.back_stresses:
            allowed = (
                "must be given with chaboche hardening: [modulus C in MPa, recall gamma] of each"
            )
            raise ModelError("back_stresses", self.back_stresses, allowed)
        found = []
        for k, pair in enumerate(self.back_stresses, start=1):
            try:
                found.append(ArmstrongFrederick(*pair))
            except ModelError as error:
                field = f"back_stresses.{k}.{error.field}"
                raise ModelError(field, error.value, error.allowed) from None
        return tuple(found)

    def flow_curve(self, yield_stress: float) -> Curve:
        """Return Voce's curve."""
        return self.voce(yield_stress)


@HARDENING.word("layered")
@dataclass(frozen=True, slots=True, kw_only=True)
class LayeredHardening(_Measured, HardeningRule):
    """Layers yield one after the other."""

    def law(self, elasticity: Elasticity, yield_stress: float) -> Law:
        """Return Besseling's law."""
        strain, stress = self.points(yield_stress, "layered")
        total = strain + stress / elasticity.youngs_modulus
        try:
            return Layered.of_curve(elasticity, total.tolist(), stress.tolist())
        except ModelError as error:
            raise ModelError("curve", self.curve, error.allowed) from None
