"""Parameters of materials and of friction in scenes, and the laws made from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from solver.errors import ModelError
from solver.materials.elastic_plastic import Material
from solver.materials.elasticity import Elasticity
from solver.materials.hardening_rules import HARDENING
from solver.materials.law import Law
from solver.materials.yield_conditions import YIELD_CONDITIONS
from solver.model.friction import FRICTION, FrictionLaw
from solver.model.pairs import ContactPair
from solver.parameters import Accuracy, Poisson, Stress, check, described
from solver.parts import Parts


@dataclass(frozen=True, slots=True, kw_only=True)
@YIELD_CONDITIONS.fields
class YieldParameters:
    """Accuracy, elasticity and yield condition, with the parameters of all conditions.

    A subclass declares the yield stress, so that it follows the parameters of all hardening rules.
    """

    PARTS: ClassVar[tuple[Parts[Any], ...]] = ()

    accuracy: Accuracy = described(
        "standard", "sets the mesh and the increments that are not given"
    )
    youngs_modulus: Stress = described(2.0e5, "Young's modulus E")
    poisson_ratio: Poisson = described(0.3, "Poisson ratio")
    yield_condition: str = described("mises", "yield condition, with associated flow")

    def __post_init__(self) -> None:
        check(self)
        for name, value in self.usual().items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)

    def usual(self) -> Mapping[str, float]:
        """Return the values of the parameters that ``accuracy`` sets."""
        return {}


@dataclass(frozen=True, slots=True, kw_only=True)
@HARDENING.fields
class HardeningParameters(YieldParameters):
    """Yield condition and hardening rule, with the parameters of all rules."""

    hardening: str = described("none", "hardening rule of the yielding bodies")


@dataclass(frozen=True, slots=True, kw_only=True)
class MaterialParameters(HardeningParameters):
    """An elastic-plastic material."""

    yield_stress: Stress = described(350.0, "uniaxial yield stress Re")

    def __post_init__(self) -> None:
        YieldParameters.__post_init__(self)
        self.material()  # raises an error for parameters that do not fit together

    def material(self, stiffness: float = 1.0, *, elastic: bool = False) -> Law:
        """Return the law of the material, with ``stiffness`` times Young's modulus.

        Raises
        ------
        ModelError
            naming the parameter, if the hardening rule does not accept it or if the yield condition
            does not allow the rule
        """
        rule = HARDENING.made(self.hardening, self)
        E, nu = self.youngs_modulus * stiffness, self.poisson_ratio
        if elastic:
            return Material(youngs_modulus=E, poisson_ratio=nu)
        elasticity = Elasticity(youngs_modulus=E, poisson_ratio=nu)
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
    """An elastic-plastic material and a friction law, with the parameters of all friction laws."""

    friction_law: str = described("coulomb", "friction law")

    @property
    def friction_part(self) -> FrictionLaw:
        """The friction law."""
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
        """Return a contact pair with this friction law."""
        return ContactPair(slave=slave, master=master, friction=self.friction_part, sliding=sliding)
