"""Parameters of a wheel that rolls along a prism, in three dimensions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from annotated_types import Interval, Unit

from solver.materials.elasticity import Elasticity
from solver.parameters import Fraction, Other, described
from solver.rolling.load import FULL_SLIP, RollingLoad
from solver.rolling.scenes.wheel_parameters import (
    CONTROL,
    POISSON,
    STIFFNESS,
    TRACTION,
    Control,
    SamePoisson,
    Stiffness,
    Traction,
    check_traction,
    elasticity_of_wheel,
)
from solver.scenes.material_parameters import ContactParameters

ROUGH = {"friction": Other(0.0), "cohesion": Other(0.0), "friction_law": Other("coulomb")}
"""What a creepage needs to have an effect."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PrismParameters(ContactParameters):
    """Passes, motion and elasticity of a wheel on a prism that yields (N, mm, MPa)."""

    passes: Annotated[int, Interval(ge=1, le=1000)] = described(1, "number of passes")
    friction: Fraction = described(0.17, "Coulomb friction coefficient")
    traction: Traction = described(0.0, TRACTION)
    control: Control = described("moment", CONTROL)
    given_creepage: Annotated[float, Interval(ge=-0.1, le=0.1), Unit("1")] = described(
        0.0,
        "prescribed creepage 1 - w R / V of a wheel that turns by w and advances by V",
        needs=ROUGH,
    )
    lateral_creepage: Annotated[float, Interval(ge=-0.1, le=0.1), Unit("1")] = described(
        0.0,
        "velocity of the axle along z over that along x, as by skew; the yaw of a wheel adds to it",
        needs=ROUGH,
    )
    wheel_stiffness: Stiffness = described(1.0, STIFFNESS)
    wheel_poisson_ratio: SamePoisson = described("same", POISSON)

    def __post_init__(self) -> None:
        # zero-argument super() does not see the class that dataclass(slots=True) makes
        ContactParameters.__post_init__(self)
        check_traction(self)

    @property
    def elasticity(self) -> Elasticity:
        """Elastic constants of the prism."""
        return Elasticity(youngs_modulus=self.youngs_modulus, poisson_ratio=self.poisson_ratio)

    @property
    def wheel_elasticity(self) -> Elasticity:
        """Elastic constants of the wheel."""
        return elasticity_of_wheel(self.elasticity, self.wheel_stiffness, self.wheel_poisson_ratio)

    @property
    def contact_modulus(self) -> float:
        """E* of wheel and prism [MPa]."""
        return 1 / sum(
            1 / each.plane_strain_modulus for each in (self.elasticity, self.wheel_elasticity)
        )

    def under(self, force: float) -> RollingLoad:
        """Return the load with this vertical force [N], and the motion of the wheel."""
        locked = self.traction == 1.0
        drive = self.traction * self.friction * force
        return RollingLoad(
            force=force,
            drive=None if locked or self.control == "creepage" else drive,
            creepage=FULL_SLIP if locked else self.given_creepage,
            lateral_creepage=self.lateral_creepage,
        )

    @property
    def rubbing(self) -> Mapping[str, Any]:
        """Friction and strength, as `RollingPatch` takes them."""
        return {
            "friction": self.friction_part,
            "strength": self.material().shear_yield_stress,
        }
