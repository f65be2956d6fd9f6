"""The rail of the wheel-rail scene: where the contact will be, and the zone and window around it.

The part of the section whose elements are small, and the length along the rail, follow from the gap
of the undeformed profiles. Runs of the same geometry share what is set up for it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from solver.errors import ModelError
from solver.materials import Elasticity
from solver.mesh.rail import rail_60e1
from solver.mesh.wheel_profile import conical, crowned, s1002
from solver.mesh.zone import Zone, rail_mesh
from solver.prism.patch import RollingPatch
from solver.prism.profiled_wheel import ProfiledWheel
from solver.prism.section import Section
from solver.scenes.prism_window import whole, windowed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.mesh.rail import RailSection
    from solver.mesh.wheel_profile import WheelProfile
    from solver.prism.track import PrismTrack
    from solver.scenes.wheel_rail_parameters import WheelRailParameters

    Array = NDArray[np.float64]

_FOOT = 150.0
"""Width of the foot of the rail, over which the foundation acts [mm]."""
_PRESSED = 0.5
"""Ratio of the gap of undeformed bodies at the edge of contact to their approach, as for a ball."""
_APPROACH = 1.122
"""Approach in the middle of a uniform pressure p on a square of side s, over p s / E*: K.L.
Johnson, Contact Mechanics (1985), section 3.3."""
_STEP, _GRID = 0.05, 0.5
"""Step with which gaps are searched, and to which the middle of the zone is rounded [mm]."""
_BESIDE, _DEPTH = 0.35, 1.5
"""Width of the zone beside the contact over half its width; depth over the mean half-axis."""
_REACH = 1.15
"""Half the length where the load may act over half that of the contact."""
_STEEPEST = math.radians(80.0)
"""Steepest slope of the running surface within the zone [rad]."""
_LEVELS = 4
"""Levels of the far field: the last one is 260 m long, where a rail on 21 MPa turns over 10 m."""


@dataclass(frozen=True, slots=True)
class ExpectedContact:
    """The contact as the gap of the undeformed bodies tells it.

    Attributes
    ----------
    middle : position z of its middle [mm]
    across, along : half its width across the rail, and half its length [mm]
    gap : gap at height 0 where the bodies first touch [mm]
    """

    middle: float
    across: float
    along: float
    gap: float


def expected_contact(parameters: WheelRailParameters) -> ExpectedContact:
    """Return where the wheel will touch the rail.

    Raises
    ------
    ModelError
        for ``lateral_position``, if the wheel does not meet the running surface within its ends
    """
    p = parameters
    section, profile = _rail(p.cant), wheel_profile(p)
    ends = section.running
    z, y = section.outline.at(np.arange(ends[1], ends[0], -_STEP))
    rising = np.append(True, np.diff(z) > 0)  # the sides of the head lean
    z, y = z[rising], y[rising]
    gap = profile.height(z - p.lateral_position) - y
    least = int(gap.argmin())
    gap0 = float(gap[least])
    allowed = "must let the wheel touch the running surface, not beside it"
    if not 0 < least < len(z) - 1 or not np.isfinite(gap0):
        raise ModelError("lateral_position", p.lateral_position, allowed)
    level = np.sort(gap[np.isfinite(gap)])[1:] - gap0
    width = np.gradient(z)
    # the contact grows with the gap at its edge, and the approach of its area falls
    first, last = 0, len(level) - 1
    while first < last:
        at = (first + last) // 2
        d = level[at]
        length = 2 * np.sqrt(2 * p.wheel_radius * np.clip(d - (gap - gap0), 0.0, None))
        approach = (
            _APPROACH * p.load / (p.contact_modulus * math.sqrt(float(length @ width) + 1e-9))
        )
        first, last = (first, at) if d > _PRESSED * approach else (at + 1, last)
    inside = z[gap - gap0 <= level[first]]
    return ExpectedContact(
        middle=round(float(inside[0] + inside[-1]) / 2 / _GRID) * _GRID,
        across=float(np.ptp(inside)) / 2 + _GRID,
        along=math.sqrt(2 * p.wheel_radius * float(level[first])),
        gap=gap0,
    )


def wheel_profile(parameters: WheelRailParameters) -> WheelProfile:
    """Return the profile of the wheel, its running circle at z = 0."""
    p = parameters
    if p.wheel_profile == "s1002":
        return s1002()
    return conical(p.wheel_slope) if p.wheel_profile == "conical" else crowned(p.crown_radius)


@lru_cache(maxsize=16)
def _rail(cant: float) -> RailSection:
    return rail_60e1().canted(cant)


@dataclass(frozen=True, slots=True)
class RailGeometry:
    """All that the set-up of a rail depends on; runs with equal geometry share it.

    Attributes
    ----------
    cant, foundation : of the rail
    elasticity : Young's modulus and Poisson ratio of the rail
    at, half_width, depth, size : of the zone [mm]
    spacing, reach : distance of stations; half the length where the load may act [mm]
    """

    cant: float
    foundation: float
    elasticity: tuple[float, float]
    at: float
    half_width: float
    depth: float
    size: float
    spacing: float
    reach: float

    @property
    def zone(self) -> Zone:
        """Where elements are small and may yield."""
        return Zone(at=self.at, half_width=self.half_width, depth=self.depth, size=self.size)


def geometry(parameters: WheelRailParameters, reach: float = 1.0) -> RailGeometry:
    """Return the geometry; ``reach`` is the ratio of zone and window to their usual size.

    Raises
    ------
    ModelError
        for ``lateral_position``, if the zone would reach the side of the head
    """
    p, contact = parameters, expected_contact(parameters)

    h = p.element_size
    mean = math.sqrt(contact.across * contact.along)
    half_width = whole(reach * (1 + _BESIDE) * contact.across, h)
    section = _rail(p.cant)
    right, left = section.running
    ends = section.place(contact.middle) + half_width * np.array([-1, 1])
    inside = right < ends[0] and ends[1] < left
    if not inside or abs(section.outline.direction(ends)[0]).min() < math.cos(_STEEPEST):
        raise ModelError(
            "lateral_position", p.lateral_position,
            f"must keep the contact, expected at z = {contact.middle:g} mm, farther than "
            f"{half_width:g} mm from the sides of the head",
        )  # fmt: skip
    return RailGeometry(
        cant=p.cant,
        foundation=p.foundation,
        elasticity=(p.youngs_modulus, p.poisson_ratio),
        at=contact.middle,
        half_width=half_width,
        depth=whole(reach * _DEPTH * mean, h),
        size=h,
        spacing=p.spacing,
        reach=whole(reach * _REACH * contact.along, p.spacing),
    )


@lru_cache(maxsize=4)
def section_of(own: RailGeometry) -> Section:
    """Return the meshed section of a rail on its foundation."""
    E, nu = own.elasticity
    spring = own.foundation / _FOOT
    return Section(
        rail_mesh(_rail(own.cant), own.zone),
        Elasticity(youngs_modulus=E, poisson_ratio=nu),
        springs={"foot": (spring, spring, spring)},
    )


@lru_cache(maxsize=2)
def track_of(own: RailGeometry) -> PrismTrack:
    """Return the rail, set up once in a process for each geometry."""
    return windowed(section_of(own), own.zone, spacing=own.spacing, reach=own.reach, levels=_LEVELS)


class RolledRail:
    """A wheel on a rail, as `solver.scenes.prism_passes.RolledPrism`."""

    def __init__(self, parameters: WheelRailParameters) -> None:
        self.parameters = parameters

    def track(self, reach: float) -> PrismTrack:
        """See `RolledPrism`."""
        return track_of(geometry(self.parameters, reach))

    def load(self, track: PrismTrack) -> RollingPatch:
        """See `RolledPrism`."""
        p, profile = self.parameters, wheel_profile(self.parameters)
        wheel = ProfiledWheel(
            profile=lambda z: profile.height(z - p.lateral_position),
            radius=p.wheel_radius,
            elasticity=p.wheel_elasticity,
        )
        return RollingPatch(
            track.grid, track.compliance, wheel, friction=p.friction, force=p.load, **p.motion
        )
