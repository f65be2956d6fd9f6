"""The materials that scenes ask for, and the laws that their parameters stand for."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal, cast

import numpy as np
from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.materials.chaboche import BackStress, Chaboche
from solver.materials.curves import Table, Voce
from solver.materials.law import Law
from solver.materials.layered import Layered
from solver.materials.material import Hardening, Material
from solver.materials.tresca import TrescaMaterial
from solver.model.friction import FRICTION, FrictionLaw
from solver.model.model import ContactPair
from solver.parameters import (
    Accuracy,
    Fraction,
    HardeningRatio,
    Poisson,
    Stress,
    check,
    described,
)

if TYPE_CHECKING:
    from solver.materials.curves import Curve
    from solver.materials.elasticity import Elasticity

YieldCondition = Literal["mises", "tresca"]
HardeningRule = Literal[
    "none", "isotropic", "kinematic", "mixed", "voce", "table", "chaboche", "layered"
]
LINEAR = ("none", "isotropic", "kinematic", "mixed")
"""Rules of the closed-form law, which steady passes know."""
_ISOTROPIC = ("none", "isotropic", "voce", "table")
"""Rules that go with Tresca's condition."""
_USED: Mapping[HardeningRule, frozenset[str]] = {
    "isotropic": frozenset({"hardening_ratio"}),
    "kinematic": frozenset({"hardening_ratio"}),
    "mixed": frozenset({"hardening_ratio", "isotropic_fraction"}),
    "voce": frozenset({"saturation", "saturation_rate"}),
    "table": frozenset({"curve"}),
    "chaboche": frozenset({"saturation", "saturation_rate", "back_stresses"}),
    "layered": frozenset({"curve"}),
}
"""Parameters of hardening that a rule uses."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ElasticParameters:
    """The elastic material every scene asks for, and how accurate the answer is to be."""

    accuracy: Accuracy = described(
        "standard", "sets mesh and increments together, where they are not given"
    )
    youngs_modulus: Stress = described(2.0e5, "Young's modulus E")
    poisson_ratio: Poisson = described(0.3, "Poisson ratio")

    def __post_init__(self) -> None:
        check(self)
        for name, value in self.usual().items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)

    def usual(self) -> Mapping[str, float]:
        """Return the values of the parameters that ``accuracy`` sets."""
        return {}

    def elastic_material(self) -> Material:
        """Return a material that never yields."""
        return Material(youngs_modulus=self.youngs_modulus, poisson_ratio=self.poisson_ratio)


@dataclass(frozen=True, slots=True, kw_only=True)
class MaterialParameters(ElasticParameters):
    """An elastic-plastic material."""

    yield_condition: YieldCondition = described("mises", "condition of first yield, and of flow")
    hardening: HardeningRule = described("none", "hardening rule of the yielding bodies")
    hardening_ratio: HardeningRatio = described(
        0.024, "slope Eu of the uniaxial hardening branch / Young's modulus"
    )
    isotropic_fraction: Fraction = described(0.5, "part of mixed hardening that is isotropic")
    saturation: Annotated[float, Interval(ge=0.0, le=1e7), Unit("MPa")] = described(
        0.0, "growth of the yield stress in the end, with voce and chaboche hardening"
    )
    saturation_rate: Annotated[float, Interval(gt=0.0, le=1e6), Unit("1")] = described(
        10.0, "how fast it grows: as 1 - exp(-rate * plastic strain)"
    )
    curve: tuple[tuple[float, float], ...] = described(
        (), "points [plastic strain, stress in MPa] of the tension curve, with table and layered "
        "hardening; the first is [0, yield_stress]",
    )  # fmt: skip
    back_stresses: tuple[tuple[float, float], ...] = described(
        (), "[modulus C in MPa, recall gamma] of each, with chaboche hardening"
    )
    yield_stress: Stress = described(350.0, "uniaxial yield stress Re")

    def __post_init__(self) -> None:
        # zero-argument super() does not see the class that dataclass(slots=True) makes
        ElasticParameters.__post_init__(self)
        self.material()  # refuses what does not go together

    @property
    def idle(self) -> frozenset[str]:
        """Parameters that no number depends on with this hardening rule."""
        return idle_of(self)

    def material(self, stiffness: float = 1.0, *, elastic: bool = False) -> Law:
        """Return the law of the material, with ``stiffness`` times Young's modulus."""
        material = self.linear_material(stiffness, elastic=elastic)
        return material if elastic else law_of(self, material)

    def linear_material(self, stiffness: float = 1.0, *, elastic: bool = False) -> Material:
        """Return the von Mises law with these constants and linear hardening, where there is any.

        Steady passes know no other.
        """
        return Material(
            youngs_modulus=self.youngs_modulus * stiffness,
            poisson_ratio=self.poisson_ratio,
            yield_stress=math.inf if elastic else self.yield_stress,
            hardening=cast("Hardening", self.hardening) if self.hardening in LINEAR else "none",
            hardening_ratio=self.hardening_ratio,
            isotropic_fraction=self.isotropic_fraction,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
@FRICTION.fields
class ContactParameters(MaterialParameters):
    """Elastic-plastic material, and a law of friction with the parameters of all laws."""

    friction_law: str = described("coulomb", "law of friction")

    @property
    def idle(self) -> frozenset[str]:
        """Parameters that no number depends on with these rules."""
        others = frozenset(FRICTION.parameters()) - FRICTION.used(self.friction_law)
        return others.union(idle_of(self))

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


def idle_of(parameters: MaterialParameters) -> frozenset[str]:
    """Return the parameters of hardening that its rule does not use."""
    used = _USED.get(parameters.hardening, frozenset())
    return frozenset().union(*_USED.values()) - used


def law_of(parameters: MaterialParameters, material: Material) -> Law:
    """Return the law of the parameters.

    Parameters
    ----------
    parameters : of the scene
    material : the same constants with linear hardening, where there is any

    Raises
    ------
    ModelError
        naming the parameter, if those of the rule are wrong or do not go with the yield condition
    """
    p = parameters
    if p.yield_condition == "tresca":
        if p.hardening not in _ISOTROPIC:
            allowed = f"must be one of {', '.join(_ISOTROPIC)} where yield_condition is tresca"
            raise ModelError("hardening", p.hardening, allowed)
        return TrescaMaterial(elasticity=material.elasticity, curve=_curve(p, material))
    if p.hardening in LINEAR:
        return material
    if p.hardening == "layered":
        return _layered(p, material.elasticity)
    back = tuple(BackStress(*each) for each in _pairs(p, "back_stresses"))
    if p.hardening == "chaboche" and not back:
        allowed = "must be given with chaboche hardening: [modulus C in MPa, recall gamma] of each"
        raise ModelError("back_stresses", p.back_stresses, allowed)
    used = back if p.hardening == "chaboche" else ()
    return Chaboche(elasticity=material.elasticity, curve=_curve(p, material), back_stresses=used)


def _curve(p: MaterialParameters, material: Material) -> Curve:
    """Return how the yield surface grows."""
    if p.hardening == "table":
        strain, stress = _points(p)
        return Table(plastic_strain=tuple(strain.tolist()), stress=tuple(stress.tolist()))
    if p.hardening == "voce" and not p.saturation:
        raise ModelError("saturation", p.saturation, "must be given with voce hardening")
    if p.hardening in ("voce", "chaboche"):
        return Voce(yield_stress=p.yield_stress, saturation=p.saturation, rate=p.saturation_rate)
    return Voce(yield_stress=p.yield_stress, modulus=material.isotropic_modulus)


def _pairs(p: MaterialParameters, name: str) -> tuple[tuple[float, float], ...]:
    """Return the pairs of numbers that a parameter must be."""
    value = getattr(p, name)
    known = isinstance(value, tuple) and all(
        isinstance(pair, Sequence) and len(pair) == 2 and all(map(_finite, pair)) for pair in value
    )
    if not known:
        raise ModelError(name, value, "must be pairs of finite numbers")
    return value


def _finite(value: object) -> bool:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and math.isfinite(cast("float", value))


def _layered(p: MaterialParameters, elasticity: Elasticity) -> Layered:
    strain, stress = _points(p)
    total = strain + stress / elasticity.youngs_modulus
    try:
        return Layered.of_curve(elasticity, total.tolist(), stress.tolist())
    except ModelError as error:
        raise ModelError("curve", p.curve, error.allowed) from None


def _points(p: MaterialParameters) -> tuple[np.ndarray, np.ndarray]:
    """Return plastic strain and stress of the points of the curve."""
    strain, stress = np.reshape(_pairs(p, "curve"), (-1, 2)).T
    begins = bool(p.curve) and (strain[0], stress[0]) == (0.0, p.yield_stress)
    rises = (np.diff(strain) > 0).all() and (np.diff(stress) >= 0).all()
    if not (begins and rises):
        raise ModelError(
            "curve", p.curve,
            f"must be points [plastic strain, stress in MPa] with {p.hardening} hardening: the "
            "first [0, yield_stress], strain increasing, stress not falling",
        )  # fmt: skip
    return strain, stress
