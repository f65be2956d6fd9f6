"""Railway wheel rolling along a rail, in three dimensions.

The rail is a 60E1, elastic-plastic in a zone under the contact, without ends, on an elastic
foundation. The wheel is an elastic half-space with the shape of its profile. Passes are steady: in
the frame of the wheel nothing changes. Coordinates are x along the rail, y up from the top of the
rail, z across it to the outside of the track; x = 0 is at the wheel. A positive ``traction``
brakes.

P. Marek, PhD thesis, Warsaw University of Technology (1995), chapter 6.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.late import late
from solver.parameters import Other, Stress, described
from solver.parts import declared
from solver.rolling.load import RollingLoad
from solver.rolling.rail.profiles.points import SectionMesh, as_points
from solver.rolling.scenes.initial_stress import INITIAL_STRESS, SectionStress
from solver.rolling.scenes.rail_scene import ROUGH, PrismParameters, rail_scene
from solver.rolling.scenes.sequence import CUT, block_of, check_spreads, deviations

ELEMENT_SIZE: Mapping[str, float] = {"draft": 2.0, "standard": 1.0, "fine": 0.5}
"""Side of the elements under the contact, across and in depth [mm]."""
_HEAD, _WIDEST, _LOWEST, _HIGHEST = 28.0, 38.0, -30.0, 5.0
"""Least and largest distance from the axis of the rail of the ends of a running surface given by
points; lowest and highest position of the surface [mm]."""
_CLOSEST = 1.0
"""Least distance of stations along the rail [mm]."""
_SINKS = 10.0
"""Largest displacement of a rail under equal wheels [mm]: the wheels touch it where it was."""
Points = tuple[tuple[float, float], ...]
"""Points z, y of a profile, z increasing [mm]."""
_OF_A_PASS = (
    "load", "lateral_position", "friction", "traction", "control", "given_creepage",
    "lateral_creepage", "lateral_control", "given_lateral_force", "yaw", "spin",
    "wheel_profile", "wheel_slope", "crown_radius", "wheel_radius",
)  # fmt: skip
"""Parameters that may differ from pass to pass."""
_OF_A_PLACE = (
    "lateral_position", "yaw", "wheel_profile", "wheel_slope", "crown_radius", "wheel_radius",
)  # fmt: skip
"""Parameters of a pass that decide where the wheel touches, for one load."""
_SPREADS = ("load_spread", "lateral_spread", "traction_spread")
_POSITIONS = 13
"""Number of lateral positions that represent those of random traffic, half a standard deviation
apart."""

(_checked,) = late("rolling.rail.profiles.meshed_rail", "checked")


@dataclass(frozen=True, slots=True, kw_only=True)
@INITIAL_STRESS.fields
class WheelRailParameters(PrismParameters):
    """Parameters of a wheel on a rail (N, mm, MPa)."""

    yield_stress: Stress = described(502.0, "uniaxial yield stress Re of the rail")
    load: Annotated[float, Interval(gt=0.0, le=1e6), Unit("N")] = described(
        150e3, "vertical force on the wheel"
    )
    lateral_control: Literal["creepage", "force"] = described(
        "creepage", "whether `lateral_creepage` is prescribed, or `given_lateral_force`"
    )
    given_lateral_force: Annotated[float, Interval(ge=-1e6, le=1e6), Unit("N")] = described(
        0.0, "prescribed force of the wheel on the rail along z"
    )
    yaw: Annotated[float, Interval(ge=-0.1, le=0.1), Unit("rad")] = described(
        0.0,
        "angle by which the wheel is turned about the vertical; a positive one turns its heading "
        "towards the middle of the track",
    )
    spin: Annotated[float, Interval(ge=-0.1, le=0.1), Unit("1/mm")] = described(
        0.0,
        "rotation of the wheel about the downward vertical over its velocity, in addition to the "
        "spin by the slope of the contact",
        needs=ROUGH,
    )
    lateral_position: Annotated[float, Interval(ge=-30.0, le=30.0), Unit("mm")] = described(
        -4.0,
        "position z of the wheel's running circle from the axis of the upright rail; z points to "
        "the outside of the track",
    )
    rail_profile: Literal["60e1"] | Points | SectionMesh = described(
        "60e1",
        "rail: 60E1; 60E1 with a running surface through a list of points [z, y] in mm, z from "
        "the axis of the upright rail and increasing, y from the top of the new rail; or a mesh of "
        "its section: points [z, y], elements, and edges of the running surface and of the foot",
    )
    cant: Annotated[float, Interval(ge=-0.1, le=0.1), Unit("1")] = described(
        0.025, "cant of the rail towards the middle of the track, its tangent"
    )
    wheel_radius: Annotated[float, Interval(ge=50.0, le=5000.0), Unit("mm")] = described(
        460.0, "radius of the wheel at its running circle"
    )
    wheel_profile: Literal["s1002", "conical", "crowned"] | Points = described(
        "s1002",
        "profile of the wheel: S1002, a cone, a crown lowest at the running circle, or a list of "
        "points [z, y] in mm, z from the running circle and increasing to the outside of the track",
    )
    wheel_slope: Annotated[float, Interval(ge=-0.2, le=0.2), Unit("1")] = described(
        0.05, "slope dy/dz of the profile of a conical wheel", needs={"wheel_profile": ("conical",)}
    )
    crown_radius: Annotated[float, Interval(ge=50.0, le=1e5), Unit("mm")] = described(
        300.0, "radius across the wheel of a crowned one", needs={"wheel_profile": ("crowned",)}
    )
    foundation: Annotated[float, Interval(ge=0.1, le=1e4), Unit("MPa")] = described(
        21.0,
        "modulus of the foundation: force per length of the rail and displacement, along x, y and "
        "z",
    )
    span: Annotated[
        Annotated[float, Interval(ge=600.0, le=1e5)] | Literal["endless"], Unit("mm")
    ] = described(
        "endless",
        "length of a rail whose ends neither move nor turn, the wheel in its middle; or endless",
    )
    wheel_distance: Annotated[
        Annotated[float, Interval(ge=20.0, le=1000.0)] | Literal["alone"], Unit("mm")
    ] = described(
        "alone",
        "distance of equal wheels, one behind the other, all on the rail in each pass; or alone",
    )
    initial_stress: str = described(
        "none", "stress of the rail before the first pass; it is brought to equilibrium"
    )
    temperature_change: Annotated[float, Interval(ge=-300.0, le=300.0), Unit("K")] = described(
        0.0,
        "temperature of the rail above its neutral temperature; the welded rail keeps its length",
    )
    expansion: Annotated[float, Interval(ge=0.0, le=1e-3), Unit("1/K")] = described(
        1.15e-5,
        "coefficient of linear thermal expansion of the rail",
        needs={"temperature_change": Other(0.0)},
    )
    sequence: tuple[Mapping[str, float | str | Points], ...] = described(
        (),
        "list of different passes, repeated; each is a table of what differs from the run: "
        f"{', '.join(_OF_A_PASS)}, and `times`",
    )
    load_spread: Annotated[float, Interval(ge=0.0, le=0.33), Unit("1")] = described(
        0.0,
        "standard deviation of the loads of random passes over `load`; passes beyond "
        f"{CUT:g} standard deviations of load, position or traction are not drawn",
    )
    lateral_spread: Annotated[float, Interval(ge=0.0, le=10.0), Unit("mm")] = described(
        0.0, "standard deviation of the lateral positions of random passes"
    )
    traction_spread: Annotated[float, Interval(ge=0.0, le=0.33), Unit("1")] = described(
        0.0, "standard deviation of the tractions of random passes"
    )
    seed: Annotated[int, Interval(ge=0, le=2**32 - 1)] = described(
        0,
        "seed of random passes: another one draws other passes",
        needs=dict.fromkeys(_SPREADS, Other(0.0)),
    )

    def __post_init__(self) -> None:
        PrismParameters.__post_init__(self)
        for name in ("rail_profile", "wheel_profile"):
            value = getattr(self, name)
            if isinstance(value, SectionMesh):
                _checked(value, name)
            elif not isinstance(value, str):
                object.__setattr__(self, name, as_points(name, value))
        self._check_head()
        _ = self.rail_stress  # raises an error for parameters that do not fit together
        self._check_lateral()
        self._check_distance()
        if self.scattered:
            check_spreads(self, _SPREADS)
        if self.sequence:
            _ = self.block  # raises an error for a wrong entry

    def _check_distance(self) -> None:
        """Raise `ModelError` where equal wheels at a distance cannot be, or sink far."""
        apart = self.wheel_distance
        if apart == "alone":
            return
        if self.span != "endless":
            raise ModelError("wheel_distance", apart, "needs span = endless")
        if (sinks := self.load / (float(apart) * self.foundation)) > _SINKS:
            least = self.foundation * sinks / _SINKS
            allowed = (
                f"must be at least {least:.3g} MPa under a wheel of {self.load:g} N every "
                f"{float(apart):g} mm: the rail would sink by {sinks:.3g} mm"
            )
            raise ModelError("foundation", self.foundation, allowed)

    @property
    def rail_stress(self) -> SectionStress:
        """The stress before the first pass, without that of temperature."""
        return INITIAL_STRESS.made(self.initial_stress, self)

    @property
    def stressed_by(self) -> str:
        """The parameter that errors of the stress before the first pass name."""
        own = next(iter(declared(INITIAL_STRESS[self.initial_stress])), "initial_stress")
        return "temperature_change" if self.initial_stress == "none" else own

    @property
    def thermal_strain(self) -> float:
        """Strain by which the rail would expand if nothing held it."""
        return self.expansion * self.temperature_change

    def _check_head(self) -> None:
        """Raise `ModelError` for points that are no running surface of the rail."""
        if isinstance(self.rail_profile, str | SectionMesh):
            return
        (first, *_), (last, *_) = self.rail_profile[0], self.rail_profile[-1]
        y = [y for _, y in self.rail_profile]
        if first > -_HEAD or last < _HEAD or max(map(abs, (first, last))) > _WIDEST:
            allowed = f"must end at the sides of the head, {_HEAD:g} to {_WIDEST:g} mm away"
            raise ModelError("rail_profile", f"z = {first:g} to {last:g}", allowed)
        if not (min(y) > _LOWEST and max(y) < _HIGHEST):
            allowed = f"must lie between {_LOWEST:g} and {_HIGHEST:g} mm"
            raise ModelError("rail_profile", f"y = {min(y):g} to {max(y):g}", allowed)

    def _check_lateral(self) -> None:
        """Raise `ModelError` for a lateral force or creepage that has no effect."""
        force, creepage = self.given_lateral_force, self.lateral_creepage
        if self.lateral_control == "creepage" and force:
            raise ModelError("given_lateral_force", force, "needs lateral_control = force")
        if self.lateral_control == "force" and creepage:
            allowed = "must be 0 with lateral_control = force"
            raise ModelError("lateral_creepage", creepage, allowed)
        if self.lateral_control == "force" and self.frictionless:
            allowed = "must be creepage without friction"
            raise ModelError("lateral_control", self.lateral_control, allowed)

    @property
    def scattered(self) -> bool:
        """Whether passes are random."""
        return any(getattr(self, name) for name in _SPREADS)

    @property
    def block(self) -> tuple[WheelRailParameters, ...]:
        """The parameters of each pass of the sequence; without one those of the run."""
        return block_of(self, self.sequence, _OF_A_PASS) or (self,)

    @property
    def cycle(self) -> int | None:
        """Passes after which the loading repeats itself; None if it is random."""
        return None if self.scattered else len(self.block)

    def each_pass(self) -> list[WheelRailParameters]:
        """Return the parameters of each pass; those of one entry of the sequence are one object."""
        block = self.block
        turns = [block[number % len(block)] for number in range(self.passes)]
        if not self.scattered:
            return turns
        drawn = deviations(self.seed, self.passes, len(_SPREADS))
        return [own.deviating(each) for own, each in zip(turns, drawn, strict=True)]

    def deviating(self, deviation: Sequence[float]) -> WheelRailParameters:
        """Return the parameters of a pass with these deviations of load, position and traction.

        They are in standard deviations; the pass itself has no spread.
        """
        load, lateral, traction = deviation
        return replace(
            self,
            load=float(self.load * (1 + self.load_spread * load)),
            lateral_position=float(self.lateral_position + self.lateral_spread * lateral),
            traction=float(self.traction + self.traction_spread * traction),
            sequence=(),
            load_spread=0.0,
            lateral_spread=0.0,
            traction_spread=0.0,
        )

    @property
    def outermost(self) -> list[WheelRailParameters]:
        """Passes whose contacts cover those of all passes: the heaviest at each place."""
        heaviest: dict[tuple[Any, ...], WheelRailParameters] = {}
        for own in sorted(self.block, key=lambda own: own.load):
            heaviest[tuple(getattr(own, name) for name in _OF_A_PLACE)] = own
        found = []
        for own in heaviest.values():
            places = np.linspace(-CUT, CUT, _POSITIONS) if own.lateral_spread else (0.0,)
            found += [own.deviating((CUT, place, 0.0)) for place in places]
        return found

    def under(self, force: float) -> RollingLoad:
        """See `PrismParameters`."""
        lateral = self.given_lateral_force if self.lateral_control == "force" else None
        own = PrismParameters.under(self, force)
        return replace(own, lateral_force=lateral, spin=self.spin)

    @property
    def element_size(self) -> float:
        """Side of the elements under the contact [mm]."""
        return ELEMENT_SIZE[self.accuracy]

    @property
    def spacing(self) -> float:
        """Distance of stations along the rail [mm], of which a distance of wheels is a multiple."""
        most = max(self.element_size, _CLOSEST)
        apart = most if self.wheel_distance == "alone" else float(self.wheel_distance)
        return apart / math.ceil(round(apart / most, 6))


(_geometry,) = late("rolling.scenes.wheel_rail_track", "geometry")

WHEEL_RAIL = rail_scene(
    "wheel_rail",
    "railway wheel rolling along an elastic-plastic rail, in three dimensions",
    WheelRailParameters,
    geometry=_geometry,
    outputs=late("rolling.scenes.wheel_rail_setup", "traffic", "wheel"),
)
