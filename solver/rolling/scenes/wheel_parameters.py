"""Parameters of a wheel that rolls on a body that yields."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.materials.elasticity import Elasticity
from solver.model.friction import coefficient
from solver.parameters import Friction, Needs, Other, Poisson, described
from solver.scenes.material_parameters import ContactParameters

ROLLED: Needs = {"load": ("contact",), "traction": Other(0.0)}
"""Parameters of which the friction of a wheel needs one to have an effect."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelParameters(ContactParameters):
    """Material of a body, and motion and elasticity of a wheel that rolls on it (N, mm, MPa)."""

    friction: Friction = coefficient(0.3, ROLLED)
    traction: Annotated[float, Interval(ge=-0.99, le=1.0), Unit("1")] = described(
        0.0,
        "ratio of the longitudinal force to that of full slip, friction times load: positive "
        "brakes, negative accelerates, 1 is a locked wheel",
    )
    control: Literal["moment", "creepage"] = described(
        "moment",
        "whether the moment of `traction` turns the wheel, or `given_creepage` is prescribed",
    )
    given_creepage: Annotated[float, Interval(ge=-0.1, le=1.0), Unit("1")] = described(
        0.0,
        "creepage 1 + R d(rotation) / d(advance) of a prescribed rotation: positive brakes",
    )
    wheel_stiffness: Annotated[float, Interval(ge=1e-3, le=1e3), Unit("1")] = described(
        1.0, "ratio of Young's modulus of the wheel to that of the body it rolls on"
    )
    wheel_poisson_ratio: Annotated[Poisson | Literal["same"], Unit("1")] = described(
        "same", "Poisson ratio of the wheel; same: that of the body it rolls on"
    )

    def __post_init__(self) -> None:
        ContactParameters.__post_init__(self)
        allowed, full_slip = "", "full slip is friction * force"
        if self.traction and self.frictionless:
            allowed = "must be 0 without friction"
        elif self.friction_law != "coulomb" and self.traction not in (0.0, 1.0):
            allowed = f"must be 0 or 1 unless friction_law is coulomb: {full_slip}"
        elif self.traction not in (0.0, 1.0) and not self.friction:
            allowed = f"must be 0 or 1 without a coefficient of friction: {full_slip}"
        elif self.traction and self.control == "creepage":
            allowed = "must be 0 with control = creepage"
        if allowed:
            raise ModelError("traction", self.traction, allowed)
        if self.given_creepage and self.control != "creepage":
            raise ModelError("given_creepage", self.given_creepage, "needs control = creepage")

    @property
    def elasticity(self) -> Elasticity:
        """Elastic constants of the body."""
        return Elasticity(youngs_modulus=self.youngs_modulus, poisson_ratio=self.poisson_ratio)

    @property
    def wheel_elasticity(self) -> Elasticity:
        """Elastic constants of the wheel."""
        nu = self.wheel_poisson_ratio
        return Elasticity(
            youngs_modulus=self.youngs_modulus * self.wheel_stiffness,
            poisson_ratio=self.poisson_ratio if nu == "same" else float(nu),
        )

    @property
    def contact_modulus(self) -> float:
        """E* of the contact of wheel and body [MPa]."""
        both = self.elasticity, self.wheel_elasticity
        return 1 / sum(1 / each.plane_strain_modulus for each in both)


def check_given_shear(parameters: Any) -> None:
    """Raise `ModelError` for friction that does not give shear in proportion to pressure."""
    for name, usual in (("friction_law", "coulomb"), ("shear_limit", 0), ("cohesion", 0)):
        if (value := getattr(parameters, name)) != usual:
            raise ModelError(name, value, f"must be {usual}: load = hertz prescribes the shear")
