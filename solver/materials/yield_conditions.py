"""Yield conditions by the word that names them in scenes and scene files.

A condition is a frozen dataclass whose fields are its parameters. Together with a hardening rule it
gives the law of a material.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

from solver.errors import ModelError
from solver.materials.elastic_plastic import SmoothMaterial, TrescaMaterial
from solver.materials.elasticity import Elasticity
from solver.materials.hardening_rules import GrowingRule, HardeningRule
from solver.materials.law import Law
from solver.materials.smooth_surface import SmoothSurface
from solver.parameters import Checked
from solver.parts import Parts


class YieldCondition(Checked, ABC):
    """The stress at which a material yields, and the direction of flow.

    Attributes
    ----------
    rules : class of the hardening rules that it can be combined with
    """

    __slots__ = ()
    rules: ClassVar[type[Any]] = GrowingRule

    @abstractmethod
    def law(self, elasticity: Elasticity, yield_stress: float, rule: Any) -> Law:
        """Return the law of a material that hardens by a rule, one of `rules`.

        Raises
        ------
        ModelError
            naming the wrong parameter
        """


YIELD_CONDITIONS: Parts[YieldCondition] = Parts("yield_condition")
"""The conditions by word. Files and tables list their parameters in this order."""


class SmoothCondition(SmoothSurface, YieldCondition):
    """A smooth convex surface that subclasses define as a function of principal stresses."""

    __slots__ = ()

    def law(self, elasticity: Elasticity, yield_stress: float, rule: Any) -> Law:
        """Return the law of this surface with the curve of the rule."""
        curve = rule.flow_curve(elasticity, yield_stress)
        try:
            return SmoothMaterial(elasticity=elasticity, curve=curve, surface=self)
        except ModelError as error:
            raise ModelError("yield_condition", self, error.allowed) from None


# -- the conditions of the package ---------------------------------------------------------------


@YIELD_CONDITIONS.word("mises")
@dataclass(frozen=True, slots=True, kw_only=True)
class MisesCondition(YieldCondition):
    """Yield by the size of the deviator, with any hardening rule."""

    rules: ClassVar[type[Any]] = HardeningRule

    def law(self, elasticity: Elasticity, yield_stress: float, rule: Any) -> Law:
        """Return the law of the rule."""
        return rule.law(elasticity, yield_stress)


@YIELD_CONDITIONS.word("tresca")
@dataclass(frozen=True, slots=True, kw_only=True)
class TrescaCondition(YieldCondition):
    """Yield by the largest shear stress."""

    def law(self, elasticity: Elasticity, yield_stress: float, rule: Any) -> Law:
        """Return Tresca's law with the curve of the rule."""
        return TrescaMaterial(
            elasticity=elasticity, curve=rule.flow_curve(elasticity, yield_stress)
        )
