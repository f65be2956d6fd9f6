"""Parameters of a wheel that rolls along a rail, in three dimensions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval, Unit

from solver.parameters import Stress, described
from solver.scenes.prism_parameters import PrismParameters

ELEMENT_SIZE: Mapping[str, float] = {"draft": 2.0, "standard": 1.0, "fine": 0.5}
"""Side of the elements under the contact, across and in depth [mm]."""
_CLOSEST = 1.0
"""Least distance of stations along the rail [mm]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelRailParameters(PrismParameters):
    """Parameters of a wheel on a rail (N, mm, MPa)."""

    yield_stress: Stress = described(502.0, "uniaxial yield stress Re of the rail")
    load: Annotated[float, Interval(gt=0.0, le=1e6), Unit("N")] = described(
        150e3, "vertical force on the wheel"
    )
    lateral_position: Annotated[float, Interval(ge=-30.0, le=30.0), Unit("mm")] = described(
        -4.0,
        "position z of the wheel's running circle from the axis of the upright rail; z points to "
        "the outside of the track",
    )
    cant: Annotated[float, Interval(ge=-0.1, le=0.1), Unit("1")] = described(
        0.025, "cant of the rail towards the middle of the track, its tangent"
    )
    wheel_radius: Annotated[float, Interval(ge=50.0, le=5000.0), Unit("mm")] = described(
        460.0, "radius of the wheel at its running circle"
    )
    wheel_profile: Literal["s1002", "conical", "crowned"] = described(
        "s1002", "profile of the wheel: S1002, a cone, or a crown lowest at the running circle"
    )
    wheel_slope: Annotated[float, Interval(ge=-0.2, le=0.2), Unit("1")] = described(
        0.05, "slope dy/dz of the profile of a conical wheel"
    )
    crown_radius: Annotated[float, Interval(ge=50.0, le=1e5), Unit("mm")] = described(
        300.0, "radius across the wheel of a crowned one"
    )
    foundation: Annotated[float, Interval(ge=0.1, le=1e4), Unit("MPa")] = described(
        21.0,
        "modulus of the foundation: force per length of the rail and displacement, along x, y and "
        "z",
    )

    @property
    def idle(self) -> Mapping[str, str]:
        """Parameters without effect, each with the parameter whose word has no use for it."""
        own = {"conical": "wheel_slope", "crowned": "crown_radius"}
        unused = {name: "wheel_profile" for word, name in own.items() if word != self.wheel_profile}
        return {**PrismParameters.idle.fget(self), **unused}  # type: ignore[attr-defined]

    @property
    def element_size(self) -> float:
        """Side of the elements under the contact [mm]."""
        return ELEMENT_SIZE[self.accuracy]

    @property
    def spacing(self) -> float:
        """Distance of stations along the rail [mm]."""
        return max(self.element_size, _CLOSEST)
