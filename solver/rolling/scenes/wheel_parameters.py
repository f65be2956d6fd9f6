"""Parameters of a wheel under load, and its elastic Hertz contact."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.materials.elasticity import Elasticity
from solver.materials.material import Material
from solver.parameters import Friction, Length, Other, Poisson, described
from solver.scenes.material_parameters import ContactParameters

Traction = Annotated[float, Interval(ge=-0.99, le=1.0), Unit("1")]
"""Ratio of the longitudinal force to that of full slip: positive brakes, 1 is a locked wheel."""
Control = Literal["moment", "creepage"]
"""What turns a wheel."""
Stiffness = Annotated[float, Interval(ge=1e-3, le=1e3), Unit("1")]
"""Ratio of Young's modulus of a wheel to that of the body it rolls on."""
SamePoisson = Annotated[Poisson | Literal["same"], Unit("1")]
"""Poisson ratio of a wheel, or that of the body."""

TRACTION = (
    "ratio of the longitudinal force to that of full slip, friction times load: positive brakes, "
    "negative accelerates, 1 is a locked wheel"
)
CONTROL = "whether the moment of `traction` turns the wheel, or `given_creepage` is prescribed"
STIFFNESS = "ratio of Young's modulus of the wheel to that of the body it rolls on"
POISSON = "Poisson ratio of the wheel; same: that of the body it rolls on"
"""Descriptions of parameters of all wheels."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelParameters(ContactParameters):
    """Material, load and wheel of rolling (N, mm, MPa; forces per mm of width)."""

    yield_stress: Annotated[float, Interval(gt=0.0, le=1e7), Unit("MPa")] = described(
        502.0, "uniaxial yield stress Re of the half-space"
    )
    load_ratio: Annotated[float, Interval(gt=0.0, le=10.0), Unit("1")] = described(
        1360.0 / 502.0,
        "ratio of the peak pressure of the elastic Hertz contact to the yield stress",
    )
    friction: Friction = described(
        0.3,
        "Coulomb friction coefficient",
        needs={"load": ("contact",), "traction": Other(0.0)},
    )
    traction: Traction = described(0.0, TRACTION)
    control: Control = described("moment", CONTROL)
    given_creepage: Annotated[float, Interval(ge=-0.1, le=1.0), Unit("1")] = described(
        0.0,
        "creepage 1 + R d(rotation) / d(advance) of a prescribed rotation: positive brakes",
    )
    radius: Length = described(334.92, "radius R of the wheel")
    wheel_stiffness: Stiffness = described(1.0, STIFFNESS)
    wheel_poisson_ratio: SamePoisson = described("same", POISSON)
    wheel_turned: Annotated[float, Interval(ge=-math.pi, le=math.pi), Unit("rad")] = described(
        0.0,
        "angle by which the wheel is turned before it is set down",
        needs={"load": ("contact",)},
    )

    def __post_init__(self) -> None:
        # zero-argument super() does not see the class that dataclass(slots=True) makes
        ContactParameters.__post_init__(self)
        check_traction(self)

    @property
    def wheel_material(self) -> Material:
        """The elastic material of the wheel."""
        own = Elasticity(youngs_modulus=self.youngs_modulus, poisson_ratio=self.poisson_ratio)
        wheel = elasticity_of_wheel(own, self.wheel_stiffness, self.wheel_poisson_ratio)
        return Material(youngs_modulus=wheel.youngs_modulus, poisson_ratio=wheel.poisson_ratio)

    @property
    def peak_pressure(self) -> float:
        """p0 of the elastic Hertz contact [MPa]."""
        return self.load_ratio * self.yield_stress

    @property
    def contact_modulus(self) -> float:
        """E* of wheel and half-space [MPa]."""
        own = (1 - self.poisson_ratio**2) / self.youngs_modulus
        wheel = self.wheel_material
        return 1 / (own + 1 / wheel.elasticity.plane_strain_modulus)

    @property
    def half_width(self) -> float:
        """Half-width a = 2 R p0 / E* of the elastic Hertz contact [mm]."""
        return 2 * self.radius * self.peak_pressure / self.contact_modulus

    @property
    def force(self) -> float:
        """Vertical force pi a p0 / 2 [N per mm of width]."""
        return math.pi * self.half_width * self.peak_pressure / 2


def elasticity_of_wheel(
    own: Elasticity, stiffness: float, poisson_ratio: float | Literal["same"]
) -> Elasticity:
    """Return the elastic constants of a wheel on a body with constants ``own``.

    Parameters
    ----------
    stiffness : ratio of Young's moduli
    poisson_ratio : of the wheel, or same
    """
    return Elasticity(
        youngs_modulus=own.youngs_modulus * stiffness,
        poisson_ratio=own.poisson_ratio if poisson_ratio == "same" else float(poisson_ratio),
    )


def check_traction(parameters: Any) -> None:
    """Raise `ModelError` if friction has no such traction, or for both moment and creepage."""
    p, traction = parameters, parameters.traction
    if traction and p.frictionless:
        raise ModelError("traction", traction, "must be 0 without friction")
    if p.friction_law != "coulomb" and traction not in (0.0, 1.0):
        allowed = "must be 0 or 1 unless friction_law is coulomb: full slip is friction * force"
        raise ModelError("traction", traction, allowed)
    if traction not in (0.0, 1.0) and not p.friction:
        allowed = "must be 0 or 1 without a coefficient of friction: full slip is friction * force"
        raise ModelError("traction", traction, allowed)
    if p.control == "creepage" and traction:
        raise ModelError("traction", traction, "must be 0 with control = creepage")
    if p.given_creepage and p.control != "creepage":
        raise ModelError("given_creepage", p.given_creepage, "needs control = creepage")


def check_given_shear(parameters: Any) -> None:
    """Raise `ModelError` for a friction law that a prescribed shear, in proportion, has not."""
    for name, usual in (("friction_law", "coulomb"), ("shear_limit", 0), ("cohesion", 0)):
        if (value := getattr(parameters, name)) != usual:
            raise ModelError(name, value, f"must be {usual}: load = hertz prescribes the shear")
