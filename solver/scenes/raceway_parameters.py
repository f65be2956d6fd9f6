"""Parameters of a ball or roller on a raceway, in three dimensions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.parameters import Fraction, Length, Other, Ratio, Stress, described
from solver.scenes.hertz_ellipse import MOST_LONG, HertzEllipse
from solver.scenes.prism_parameters import PrismParameters

ELEMENTS: Mapping[str, int] = {"draft": 4, "standard": 6, "fine": 10}
"""Elements per semi-axis of the elastic Hertz contact: across, along, and in depth for the shorter
one. The largest shear under a circle, which decides shakedown without friction, is 3 % too small
with 4 of them, 0.3 % with 6."""
BESIDE = 1.5
"""Half the width of the zone that may yield, along the surface, over b."""
_STEEPEST = math.radians(60.0)
"""Largest slope of ball, roller and groove in the zone [rad]."""
_LONGEST = 0.2
"""Largest ratio of the semi-axis along the raceway to the radius: the ball or roller must be above
all stations at which it may touch."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RacewayParameters(PrismParameters):
    """Parameters of a ball or roller on a raceway (N, mm, MPa)."""

    yield_stress: Stress = described(1500.0, "uniaxial yield stress Re of the raceway")
    load: Literal["contact", "hertz"] = described(
        "contact",
        "a ball or roller in contact, or the pressure of its elastic Hertz contact with shear in "
        "proportion",
    )
    load_by: Literal["load_ratio", "force"] = described(
        "load_ratio", "the parameter that gives the load"
    )
    load_ratio: Ratio = described(
        2.5,
        "ratio of the peak pressure p0 of the elastic Hertz contact to the yield stress",
        needs={"load_by": ("load_ratio",)},
    )
    force: Annotated[float, Interval(gt=0.0, le=1e9), Unit("N")] = described(
        2000.0, "vertical force on the ball or roller", needs={"load_by": ("force",)}
    )
    friction: Fraction = described(
        0.1,
        "Coulomb friction coefficient",
        needs={"load": ("contact",), "traction": Other(0.0)},
    )
    radius: Length = described(
        10.0, "radius R of the ball or roller in the plane of rolling; the raceway is straight"
    )
    crown_radius: Annotated[
        Annotated[float, Interval(gt=0.0, le=1e6)] | Literal["same"], Unit("mm")
    ] = described("same", "radius of the ball or roller across the raceway; same: a ball")
    groove_radius: Annotated[
        Annotated[float, Interval(gt=0.0, le=1e6)] | Literal["flat"], Unit("mm")
    ] = described("flat", "radius of the groove across the raceway; flat: without a groove")

    def __post_init__(self) -> None:
        # zero-argument super() does not see the class that dataclass(slots=True) makes
        PrismParameters.__post_init__(self)
        for name, usual in (("control", "moment"), ("lateral_creepage", 0.0)):
            value = getattr(self, name)
            if self.load == "hertz" and value != usual:
                raise ModelError(name, value, f"must be {usual}: load = hertz has no wheel")
        if self.groove_radius != "flat" and not self.groove_radius > self.across:
            allowed = f"must be greater than {self.across:g}, the radius across the ball or roller"
            raise ModelError("groove_radius", self.groove_radius, allowed)
        self._check_ellipse()

    def _check_ellipse(self) -> None:
        """Raise `ModelError` if the elastic Hertz contact is too long or too wide."""
        if self._found is None:
            name, value = ("crown_radius", self.crown_radius)
            if self.groove_radius != "flat":
                name, value = "groove_radius", self.groove_radius
            allowed = f"must make an ellipse whose semi-axes have a ratio of at most {MOST_LONG:g}"
            raise ModelError(name, value, allowed)
        sizes = (
            ("along x", self.size[0], _LONGEST * self.radius),
            ("across", self.size[1], self.room / BESIDE),
        )
        for way, axis, most in sizes:
            if axis > most:
                allowed = f"must make a semi-axis {way} of at most {most:.4g} mm, here {axis:.4g}"
                raise ModelError(self.load_by, getattr(self, self.load_by), allowed)

    @property
    def across(self) -> float:
        """Radius of the ball or roller across the raceway [mm]."""
        return self.radius if self.crown_radius == "same" else float(self.crown_radius)

    @property
    def groove(self) -> float:
        """Radius of the groove, inf without one [mm]."""
        return math.inf if self.groove_radius == "flat" else float(self.groove_radius)

    @property
    def room(self) -> float:
        """Half the width of the largest zone, along the surface [mm]."""
        most = self.across * math.sin(_STEEPEST)
        return most if self.groove == math.inf else self.groove * math.asin(most / self.groove)

    @property
    def _found(self) -> HertzEllipse | None:
        own = {
            "load_ratio": {"peak_pressure": self.load_ratio * self.yield_stress},
            "force": {"force": self.force},
        }
        radii = self.radius, 1 / (1 / self.across - 1 / self.groove)
        return HertzEllipse.of(radii, self.contact_modulus, **own[self.load_by])

    @property
    def ellipse(self) -> HertzEllipse:
        """The elastic Hertz contact."""
        found = self._found
        assert found is not None
        return found

    @property
    def size(self) -> tuple[float, float]:
        """Semi-axes to which mesh and results are made, rounded so that runs share them [mm]."""
        return float(f"{self.ellipse.a:.3g}"), float(f"{self.ellipse.b:.3g}")

    @property
    def elements(self) -> int:
        """Elements per semi-axis."""
        return ELEMENTS[self.accuracy]
