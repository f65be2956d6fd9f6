"""Where a wheel will touch a rail, from the gap of the undeformed bodies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from solver.errors import ModelError
from solver.materials import Elasticity
from solver.rolling.rail.profiled_wheel import ProfiledWheel
from solver.rolling.rail.profiles.meshed_rail import MeshedRail
from solver.rolling.rail.profiles.points import RUNNING, SectionMesh
from solver.rolling.rail.profiles.rail import Rail, RailSection, rail_60e1
from solver.rolling.rail.profiles.wheel_profile import (
    WheelProfile,
    conical,
    crowned,
    measured,
    s1002,
)
from solver.rolling.scenes.wheel_rail import Points, WheelRailParameters
from solver.typing import Ints

_PRESSED = 0.5
"""Gap of the undeformed bodies at the edge of contact, over their approach, as for a ball."""
_APPROACH = 1.122
"""Approach in the middle of a uniform pressure p on a square of side s, over p s / E*: K.L.
Johnson, Contact Mechanics (1985), section 3.3."""
_STEP, _GRID = 0.05, 0.5
"""Distance of places at which gaps are computed, and step to which the middle of the contact is
rounded [mm]."""
_NEAR = 2.2
"""Gap at which a second contact may form, as the rail turns under the first one, over that at the
edge of contact."""
_TREAD, _RISE, _FLANGE = math.radians(20.0), 1.0, 10.0
"""Largest slope of the top of the rail [rad]; largest height of the wheel above the top while it
touches a side, and largest height of its running circle over the rail in contact [mm]."""
_STEEPEST = math.radians(88.0)
"""Steepest slope of the surface that the wheel may touch [rad]."""
_HALVINGS = 6
"""Number of bisections for the lateral displacement of the rail, which decides only the size of the
zone."""


class _Touching(NamedTuple):
    """Values that decide where a wheel touches: parameters, and values derived from them."""

    load: float
    lateral_position: float
    yaw: float
    wheel_profile: str | Points
    wheel_slope: float
    crown_radius: float
    wheel_radius: float
    wheel_elasticity: Elasticity
    contact_modulus: float
    rail_profile: str | Points | SectionMesh
    cant: float
    foundation: float
    youngs_modulus: float

    @classmethod
    def of(cls, parameters: WheelRailParameters) -> _Touching:
        """Return the values of a pass."""
        return cls(*(getattr(parameters, name) for name in cls._fields))


@dataclass(frozen=True, slots=True)
class ExpectedContact:
    """The contact; it may have several parts.

    Attributes
    ----------
    ends : lengths along the outline of the rail at its right and left end [mm]
    near : such lengths, between which the wheel may touch when the rail moves aside or turns [mm]
    middle : position z of its middle, along the surface [mm]
    across, along : half its width along the surface across the rail, and half its length [mm]
    widest : half the width of its widest part [mm]
    ahead : largest distance of the middle of its length from the axle [mm]
    gap : gap at height 0 where the bodies first touch [mm]
    """

    ends: tuple[float, float]
    near: tuple[float, float]
    middle: float
    across: float
    along: float
    widest: float
    ahead: float
    gap: float


def expected_contact(parameters: WheelRailParameters) -> ExpectedContact:
    """Return where wheels will touch the rail in any pass; its gap is the smallest.

    Raises
    ------
    ModelError
        for ``lateral_position``, if a wheel does not meet the running surface within its ends, or
        if its flange is inside the rail
    """
    each = list(dict.fromkeys(_contact_of(_Touching.of(own)) for own in parameters.outermost))
    if len(each) == 1:
        return each[0]
    (right, left), near = _around([own.ends for own in each]), _around([own.near for own in each])
    outline = rail_of(parameters).outline
    middle = float(outline.at(np.array((right + left) / 2))[0])
    return ExpectedContact(
        ends=(right, left),
        near=near,
        middle=round(middle / _GRID) * _GRID,
        across=(left - right) / 2 + _GRID,
        along=max(own.along for own in each),
        widest=max(own.widest for own in each),
        ahead=max(own.ahead for own in each),
        gap=min(own.gap for own in each),
    )


def _around(each: list[tuple[float, float]]) -> tuple[float, float]:
    """Return the smallest and the largest length of several ends."""
    return min(low for low, _ in each), max(high for _, high in each)


@lru_cache(maxsize=4096)
def _contact_of(touching: _Touching) -> ExpectedContact:
    """Return where the wheel of one pass will touch the rail; it takes a tenth of a second."""
    p, section = touching, rail_of(touching)
    here = _Gap(p, section)
    here.check(p.lateral_position)
    inside, near = here.within(1.0), here.within(_NEAR)
    parts = np.split(inside, np.flatnonzero(np.diff(inside) > 1) + 1)
    aside = _aside(p, section, here)
    s = here.s
    right, left = float(s[inside[-1]]), float(s[inside[0]])
    middle = float(section.outline.at(np.array((right + left) / 2))[0])
    return ExpectedContact(
        ends=(right, left),
        near=(float(min(s[near[-1]], aside[0])), float(max(s[near[0]], aside[1]))),
        middle=round(middle / _GRID) * _GRID,
        across=(left - right) / 2 + _GRID,
        along=math.sqrt(2 * p.wheel_radius * here.level),
        widest=max(float(s[each[0]] - s[each[-1]]) for each in parts) / 2 + _GRID,
        ahead=float(abs(here.x[inside]).max()),
        gap=here.first,
    )


class _Gap:
    """The gap over the running surface, from left to right, when the bodies first touch.

    Attributes
    ----------
    s, z, angle : (n,) lengths along the outline, positions [mm] and slope angles [rad]
    x : (n,) positions where the wheel is lowest over them [mm]
    vertical : (n,) heights of the wheel above the surface, at its height 0 [mm]
    first : the smallest of them [mm]
    gap : (n,) by which the wheel must sink to close the gap along the normal [mm]
    level : this gap at the edge of contact [mm]
    """

    def __init__(self, p: _Touching, section: Rail, aside: float = 0.0) -> None:
        outline, wheel = section.outline, wheel_of(p, aside)
        right, left = upper(section)
        self.s = np.arange(left, right, -_STEP)
        self.z, y = outline.at(self.s)
        dz, dy = -outline.direction(self.s)
        self.angle = np.arctan2(dy, dz)
        self.x = wheel.lowest(self.z)
        self.vertical = wheel.surface(self.x, self.z) - y
        self.first = float(self.vertical.min())
        if not np.isfinite(self.first):
            allowed = "must let the wheel touch the running surface, not beside it"
            raise ModelError("lateral_position", p.lateral_position, allowed)
        normal, _, _ = wheel.above(self.x, self.z, y, self.angle)
        self.gap = normal / np.cos(self.angle)
        self.level = self._edge(p)

    def _edge(self, p: _Touching) -> float:
        """Return the gap at the edge of contact: a share of the approach on the area inside it."""
        level, square = np.sort(self.gap)[1:], np.cos(self.angle) ** 2
        first, last = 0, len(level) - 1
        while first < last:
            at = (first + last) // 2
            d = level[at]
            area = 2 * _STEP * np.sqrt(2 * p.wheel_radius * np.clip(d - self.gap, 0.0, None))
            side = math.sqrt(float(area.sum()) + 1e-9)
            approach = (
                _APPROACH * p.load * side / (p.contact_modulus * (float(area @ square) + 1e-9))
            )
            first, last = (first, at) if d > _PRESSED * approach else (at + 1, last)
        return float(level[first])

    def within(self, ratio: float) -> Ints:
        """Return the numbers of places with a gap of at most this ratio to that at the edge."""
        return np.flatnonzero(self.gap <= ratio * self.level)

    @property
    def slope(self) -> float:
        """Lateral force over load without friction; positive pushes the rail along z."""
        weight = np.clip(self.level - self.gap, 0.0, None)
        return float(weight @ np.tan(self.angle) / weight.sum())

    def check(self, lateral_position: float) -> None:
        """Raise `ModelError` if the wheel touches beside the head, or its flange is inside it."""
        least = int(self.vertical.argmin())
        allowed = ""
        rise = float(self.vertical[abs(self.angle) < _TREAD].min(initial=np.inf)) - self.first
        if not 0 < least < len(self.z) - 1:
            allowed = "must let the wheel touch the running surface, not beside it"
        elif _RISE < rise < np.inf:
            inside = rise / abs(math.tan(self.angle[least]))
            allowed = (
                "must leave the flange beside the rail: it would be about "
                f"{inside:.2g} mm inside its side at z = {self.z[least]:.3g} mm"
            )
        elif self.first < -_FLANGE:
            allowed = "must leave the flange beside the rail: it would stand on it"
        if allowed:
            raise ModelError("lateral_position", lateral_position, allowed)


def _aside(p: _Touching, section: Rail, here: _Gap) -> tuple[float, float]:
    """Return the right and left end of the contact when the rail has moved aside [mm].

    The rail is a beam on its foundation under the lateral force that the slope of the contact
    makes; the farther it moves, the less of the contact is on its side.
    """
    inertia = float(section.outline.second_moments[0, 0])
    wavelength = (p.foundation / (4 * p.youngs_modulus * inertia)) ** 0.25
    compliance = wavelength / (2 * p.foundation) * p.load
    (low, high), found = sorted((0.0, compliance * here.slope)), here
    for _ in range(_HALVINGS):
        way = (low + high) / 2
        try:
            found = _Gap(p, section, way)
        except ModelError:
            break
        low, high = (way, high) if compliance * found.slope > way else (low, way)
    inside = found.within(1.0)
    return float(found.s[inside[-1]]), float(found.s[inside[0]])


def wheel_of(parameters: WheelRailParameters | _Touching, aside: float = 0.0) -> ProfiledWheel:
    """Return the wheel at its lateral position over a rail that has moved along z by ``aside``."""
    p, profile = parameters, wheel_profile(parameters)
    at = p.lateral_position - aside
    return ProfiledWheel(
        profile=lambda z: profile.height(z - at),
        radius=p.wheel_radius,
        elasticity=p.wheel_elasticity,
        middle=at,
        yaw=p.yaw,
    )


def wheel_profile(parameters: WheelRailParameters | _Touching) -> WheelProfile:
    """Return the profile of the wheel, its running circle at z = 0."""
    p = parameters
    if not isinstance(p.wheel_profile, str):
        return measured(np.array(p.wheel_profile).T)
    if p.wheel_profile == "s1002":
        return s1002()
    return conical(p.wheel_slope) if p.wheel_profile == "conical" else crowned(p.crown_radius)


def rail_of(parameters: WheelRailParameters | _Touching) -> Rail:
    """Return the section of the rail."""
    return canted(parameters.rail_profile, parameters.cant)


@lru_cache(maxsize=16)
def canted(profile: str | Points | SectionMesh, cant: float) -> RailSection | MeshedRail:
    """Return the section of a canted rail.

    Raises
    ------
    ModelError
        for ``rail_profile``, if it is a mesh whose running line has too few points, or is too steep
    """
    if isinstance(profile, SectionMesh):
        try:
            return MeshedRail.of(profile).canted(cant)
        except ModelError as error:
            allowed = f"must have a line {RUNNING} that fits the cant: it {error.allowed}"
            raise ModelError("rail_profile", profile.in_words, allowed) from None
    section = rail_60e1()
    if not isinstance(profile, str):
        section = section.worn(np.array(profile).T)
    return section.canted(cant)


def upper(section: Rail) -> tuple[float, float]:
    """Return the lengths along the outline between which a wheel may touch the rail [mm]."""
    right, left = section.running
    s = np.arange(right, left, _STEP)
    across, _ = section.outline.direction(s)
    flat = s[-across > math.cos(_STEEPEST)]
    if not len(flat):
        steepest = math.degrees(_STEEPEST)
        raise ModelError("rail_profile", "a surface", f"must be flatter than {steepest:g} degrees")
    return float(flat[0]), float(flat[-1])
