"""The materials that scenes ask for, and the laws that their parameters stand for."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from solver.errors import ModelError
from solver.materials.elasticity import Elasticity
from solver.materials.hardening_rules import HARDENING, LinearRule, NoHardening
from solver.materials.law import Law
from solver.materials.yield_conditions import YIELD_CONDITIONS
from solver.model.friction import FRICTION, FrictionLaw
from solver.model.model import ContactPair
from solver.parameters import Accuracy, Poisson, Stress, check, described
from solver.parts import Parts


@dataclass(frozen=True, slots=True, kw_only=True)
@YIELD_CONDITIONS.fields
class YieldParameters:
    """Accuracy, elasticity, and at which stress a material yields, by any condition.

    It has no yield stress yet, which follows the parameters of conditions and hardening rules.
    """

    PARTS: ClassVar[tuple[Parts[Any], ...]] = ()

    accuracy: Accuracy = described(
        "standard", "sets mesh and increments together, where they are not given"
    )
    youngs_modulus: Stress = described(2.0e5, "Young's modulus E")
    poisson_ratio: Poisson = described(0.3, "Poisson ratio")
    yield_condition: str = described("mises", "condition of first yield, and of flow")

    def __post_init__(self) -> None:
        check(self)
        for name, value in self.usual().items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)

    @property
    def idle(self) -> Mapping[str, str]:
        """Parameters that no number depends on, each with the one whose word decides that."""
        each = ((parts, getattr(self, parts.kind)) for parts in self.PARTS)
        return {name: parts.kind for parts, word in each for name in parts.unused(word)}

    def usual(self) -> Mapping[str, float]:
        """Return the values of the parameters that ``accuracy`` sets."""
        return {}


@dataclass(frozen=True, slots=True, kw_only=True)
@HARDENING.fields
class HardeningParameters(YieldParameters):
    """How a material yields and hardens, with the parameters of all hardening rules."""

    hardening: str = described("none", "hardening rule of the yielding bodies")


@dataclass(frozen=True, slots=True, kw_only=True)
class MaterialParameters(HardeningParameters):
    """An elastic-plastic material."""

    yield_stress: Stress = described(350.0, "uniaxial yield stress Re")

    def __post_init__(self) -> None:
        # zero-argument super() does not see the class that dataclass(slots=True) makes
        YieldParameters.__post_init__(self)
        self.material()  # refuses what does not go together

    def material(self, stiffness: float = 1.0, *, elastic: bool = False) -> Law:
        """Return the law of the material, with ``stiffness`` times Young's modulus.

        Raises
        ------
        ModelError
            naming the parameter, if those of the rule are wrong or do not go with the yield
            condition
        """
        rule = HARDENING.made(self.hardening, self)
        elasticity = Elasticity(
            youngs_modulus=self.youngs_modulus * stiffness, poisson_ratio=self.poisson_ratio
        )
        if elastic:
            linear = rule if isinstance(rule, LinearRule) else NoHardening()
            return linear.law(elasticity, math.inf)
        condition = YIELD_CONDITIONS.made(self.yield_condition, self)
        if not isinstance(rule, condition.rules):
            words = [word for word, kind in HARDENING.all().items()
                     if issubclass(kind, condition.rules)]  # fmt: skip
            known = f"one of {', '.join(words)} where yield_condition is {self.yield_condition}"
            raise ModelError("hardening", self.hardening, f"must be {known}")
        return condition.law(elasticity, self.yield_stress, rule)


@dataclass(frozen=True, slots=True, kw_only=True)
@FRICTION.fields
class ContactParameters(MaterialParameters):
    """Elastic-plastic material, and a law of friction with the parameters of all laws."""

    friction_law: str = described("coulomb", "law of friction")

    @property
    def friction_part(self) -> FrictionLaw:
        """The law of friction."""
        return FRICTION.made(self.friction_law, self)

    @property
    def frictionless(self) -> bool:
        """Whether the contact is solved without friction."""
        return not self.friction_part.rough

    def contact(
        self,
        slave: tuple[str, str],
        master: tuple[str, str],
        sliding: Literal["small", "finite"] = "small",
    ) -> ContactPair:
        """Return a pair of boundaries with this friction; flat ones slide by little."""
        return ContactPair(
            slave=slave,
            master=master,
            friction=self.friction_part,
            sliding=sliding,
        )
