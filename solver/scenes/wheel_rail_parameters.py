"""Parameters of a wheel that rolls along a rail, in three dimensions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.materials.elasticity import Elasticity
from solver.parameters import Fraction, Poisson, Stress, described
from solver.scenes.material_parameters import MaterialParameters
from solver.scenes.sequence import block_of
from solver.scenes.traffic import CUT, check_spreads, deviations
from solver.scenes.wheel_parameters import check_control, elasticity_of_wheel

ELEMENT_SIZE: Mapping[str, float] = {"draft": 2.0, "standard": 1.0, "fine": 0.5}
"""Side of the elements under the contact, across and in depth [mm]."""
_CLOSEST = 1.0
"""Least distance of stations along the rail [mm]."""
_OF_A_PASS = (
    "load", "lateral_position", "traction", "friction", "lateral_creepage", "wheel_profile",
    "wheel_slope", "crown_radius", "wheel_radius",
)  # fmt: skip
"""Parameters that may differ from pass to pass."""
_SPREADS = ("load_spread", "lateral_spread", "traction_spread")
_POSITIONS = 13
"""Number of lateral positions that stand for those of random traffic, half a standard deviation
apart."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelRailParameters(MaterialParameters):
    """Parameters of a wheel on a rail (N, mm, MPa)."""

    yield_stress: Stress = described(502.0, "uniaxial yield stress Re of the rail")
    passes: Annotated[int, Interval(ge=1, le=1000)] = described(1, "number of passes")
    sequence: tuple[Mapping[str, float | str], ...] = described(
        (),
        "list of different passes, repeated; each is a table of what differs from the run: "
        f"{', '.join(_OF_A_PASS)}, and `times`",
    )
    load_spread: Annotated[float, Interval(ge=0.0, le=0.33), Unit("1")] = described(
        0.0,
        "standard deviation of the loads of random passes over their mean, `load`; cut off at "
        f"{CUT:g} of them, as all spreads",
    )
    lateral_spread: Annotated[float, Interval(ge=0.0, le=10.0), Unit("mm")] = described(
        0.0, "standard deviation of the lateral positions of random passes"
    )
    traction_spread: Annotated[float, Interval(ge=0.0, le=0.33), Unit("1")] = described(
        0.0, "standard deviation of the tractions of random passes"
    )
    seed: Annotated[int, Interval(ge=0, le=2**32 - 1)] = described(
        0, "seed of random passes: another one draws other passes"
    )
    load: Annotated[float, Interval(gt=0.0, le=1e6), Unit("N")] = described(
        150e3, "vertical force on the wheel"
    )
    friction: Fraction = described(0.17, "Coulomb friction coefficient")
    traction: Annotated[float, Interval(ge=-0.99, le=0.99), Unit("1")] = described(
        0.0,
        "ratio of the longitudinal force to that of full slip, friction times load: positive "
        "brakes, negative accelerates",
    )
    control: Literal["moment", "creepage"] = described(
        "moment", "whether the moment of `traction` turns the wheel, or its creepage is prescribed"
    )
    given_creepage: Annotated[float, Interval(ge=-0.1, le=0.1), Unit("1")] = described(
        0.0, "prescribed creepage 1 - w R / V of a wheel that turns by w and advances by V"
    )
    lateral_creepage: Annotated[float, Interval(ge=-0.1, le=0.1), Unit("1")] = described(
        0.0,
        "velocity of the wheel along z over that along x, relative to rolling: the yaw angle of a "
        "wheel whose heading is turned towards the middle of the track",
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
    wheel_stiffness: Annotated[float, Interval(ge=1e-3, le=1e3), Unit("1")] = described(
        1.0, "ratio of Young's modulus of the wheel to that of the rail"
    )
    wheel_poisson_ratio: Annotated[Poisson | Literal["same"], Unit("1")] = described(
        "same", "Poisson ratio of the wheel; same: that of the rail"
    )
    foundation: Annotated[float, Interval(ge=0.1, le=1e4), Unit("MPa")] = described(
        21.0,
        "modulus of the foundation: force per length of the rail and displacement, along x, y and "
        "z",
    )

    def __post_init__(self) -> None:
        # zero-argument super() does not see the class that dataclass(slots=True) makes
        MaterialParameters.__post_init__(self)
        if self.traction and not self.friction:
            raise ModelError("traction", self.traction, "must be 0 without friction")
        check_control(self.control, self.traction, self.given_creepage)
        if self.scattered:
            check_spreads(self, _SPREADS)
        if self.sequence:
            self.block  # noqa: B018 - raises an error for a wrong entry

    @property
    def idle(self) -> Mapping[str, str]:
        """Parameters without effect, each with the parameter whose word has no use for it."""
        own = {"conical": "wheel_slope", "crowned": "crown_radius"}
        profiles = {each.wheel_profile for each in self.block}
        unused = {name: "wheel_profile" for word, name in own.items() if word not in profiles}
        if not self.scattered:
            unused["seed"] = "load_spread"
        return {**MaterialParameters.idle.fget(self), **unused}  # type: ignore[attr-defined]

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
        """Passes whose contacts hold those of all passes: heavy ones, beside each other."""
        found = []
        for own in dict.fromkeys(self.block) if self.sequence else (self,):
            places = np.linspace(-CUT, CUT, _POSITIONS) if own.lateral_spread else (0.0,)
            found += [own.deviating((CUT, place, 0.0)) for place in places]
        return found

    @property
    def elasticity(self) -> Elasticity:
        """Elastic constants of the rail."""
        return Elasticity(youngs_modulus=self.youngs_modulus, poisson_ratio=self.poisson_ratio)

    @property
    def wheel_elasticity(self) -> Elasticity:
        """Elastic constants of the wheel."""
        return elasticity_of_wheel(self.elasticity, self.wheel_stiffness, self.wheel_poisson_ratio)

    @property
    def element_size(self) -> float:
        """Side of the elements under the contact [mm]."""
        return ELEMENT_SIZE[self.accuracy]

    @property
    def spacing(self) -> float:
        """Distance of stations along the rail [mm]."""
        return max(self.element_size, _CLOSEST)
