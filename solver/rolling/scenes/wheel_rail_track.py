"""The rail of the wheel-rail scene: the zone and the window around the expected contact.

Runs of the same geometry share what is set up for it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from solver.errors import ModelError
from solver.memory import kept
from solver.rolling.rail.profiles.meshed_rail import MeshedRail, ZonedMesh
from solver.rolling.rail.profiles.points import SectionMesh
from solver.rolling.rail.profiles.zone import Zone, rail_mesh
from solver.rolling.rail.section import Section
from solver.rolling.rail.straight import SettledStress, StraightPrism, check_elastic
from solver.rolling.rail.track import PrismTrack
from solver.rolling.scenes.initial_stress import NoStress, SectionStress
from solver.rolling.scenes.rail_window import PrismGeometry, split_rows, whole
from solver.rolling.scenes.sequence import as_given
from solver.rolling.scenes.wheel_rail import Points, WheelRailParameters
from solver.rolling.scenes.wheel_rail_contact import (
    canted,
    expected_contact,
    rail_of,
    upper,
    wheel_of,
    wheel_profile,
)
from solver.tensors import to_mandel
from solver.typing import Array

_FOOT = 150.0
"""Width of the foot of 60E1, over which the foundation acts [mm]."""
_COARSE = 2.0
"""Largest side of elements of a given mesh under the wheel, over that of the accuracy."""
_DEEPEST = 0.9
"""Largest depth of the zone, over the least radius of the surface there."""
_BESIDE, _DEPTH = 0.35, 1.5
"""Width of the zone on either side of the contact, over half the width of the contact; depth over
its mean semi-axis."""
_REACH = 1.15
"""Half the length where the load may act, over half the length of the contact."""
_STEP = 0.05
"""Distance of places at which the radius of the surface is computed [mm]."""
_SMOOTH = 4.0
"""Least radius of a curve through points in the zone, over the side of elements."""
_APART = 6.0
"""Largest distance of points of a profile in the zone [mm]."""
_LEVELS = 4
"""Levels of the far field: the last one is 260 m long, where a rail on 21 MPa turns over 10 m."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RailGeometry(PrismGeometry):
    """The geometry of a rail.

    Attributes
    ----------
    profile, cant, foundation : of the rail
    span : length of a rail clamped at both ends, the wheel in its middle [mm]; None if it is
        endless
    at : of the zone, see `Zone` [mm]
    """

    profile: str | Points | SectionMesh
    cant: float
    foundation: float
    span: float | None
    at: float

    @property
    def elements(self) -> int:
        """See `PrismGeometry`."""
        return mesh_of(self).elements


def geometry(parameters: WheelRailParameters, reach: float = 1.0) -> RailGeometry:
    """Return the geometry; ``reach`` is the ratio of zone and window to their usual size.

    Raises
    ------
    ModelError
        for ``lateral_position``, of the run or of an entry of its sequence, or for the spread that
        leads there, if the contact is on the side of the head, or at the end of the wheel's profile
    """
    try:
        return _geometry(parameters, reach)
    except ModelError as error:
        raise as_given(parameters, error) from None


def _geometry(parameters: WheelRailParameters, reach: float) -> RailGeometry:
    p, contact = parameters, expected_contact(parameters)
    h, section = p.element_size, rail_of(p)

    at, half = contact.middle, contact.across + _BESIDE * contact.widest
    middle, (right, left) = section.place(at), upper(section)
    low, high = contact.near
    if low < middle - half or high > middle + half:
        low, high = min(middle - half, low), max(middle + half, high)
        middle, half = (low + high) / 2, (high - low) / 2
        at = float(section.outline.at(np.array(middle))[0])
    # as far as the sides of the head
    half_width = min(whole(reach * half, h), h * math.floor((left - right) / (2 * h)))
    inside = float(np.clip(middle, right + half_width, left - half_width))
    if inside != middle:
        at = float(section.outline.at(np.array(inside))[0])
    ends = np.array([inside - half_width, inside + half_width])
    if contact.ends[0] - right < h or left - contact.ends[1] < h:
        raise ModelError(
            "lateral_position", _places(p),
            f"must keep the contact, expected about z = {contact.middle:g} mm, above the sides of "
            "the head",
        )  # fmt: skip
    for own in p.outermost:
        if not np.isfinite(wheel_of(own).surface(np.zeros(2), section.outline.at(ends)[0])).all():
            raise ModelError(
                "lateral_position", own.lateral_position,
                f"must keep the contact, expected about z = {contact.middle:g} mm, farther than "
                f"{half_width:g} mm from the ends of the wheel's profile",
            )  # fmt: skip
    s = np.arange(ends[0], ends[1], _STEP)
    z, curvature = section.outline.at(s)[0], section.outline.curvature(s)
    _check_points("rail_profile", p.rail_profile, z, curvature, h)
    for own in p.outermost:
        on_wheel = z - own.lateral_position
        bends = wheel_profile(own).curvature(on_wheel)
        _check_points("wheel_profile", own.wheel_profile, on_wheel, bends, h)
    mean, bend = math.sqrt(contact.widest * contact.along), float(curvature.max())
    # columns of the zone that turn with the surface must not meet
    deepest = h * math.floor(_DEEPEST / bend / h) if bend > 0 else math.inf
    depth = min(whole(reach * _DEPTH * mean, h), max(deepest, 2 * h))
    return RailGeometry(
        profile=p.rail_profile,
        cant=p.cant,
        foundation=p.foundation,
        span=None if p.span == "endless" else float(p.span),
        elasticity=p.elasticity,
        at=at,
        half_width=half_width,
        depth=depth,
        size=h,
        split=0
        if isinstance(p.rail_profile, SectionMesh)
        else min(split_rows(p, mean, h), round(depth / h)),
        spacing=p.spacing,
        reach=whole(reach * (_REACH * contact.along + contact.ahead), p.spacing),
        apart=None if p.wheel_distance == "alone" else float(p.wheel_distance),
    )


def _places(parameters: WheelRailParameters) -> float | tuple[float, float]:
    """Return the lateral position of all passes, or the least and the largest one [mm]."""
    each = [own.lateral_position for own in parameters.outermost]
    return each[0] if min(each) == max(each) else (min(each), max(each))


def _check_points(
    name: str, points: str | Points | SectionMesh, z: Array, curvature: Array, size: float
) -> None:
    """Raise `ModelError` for points too rough or too far apart for elements of a size [mm].

    Parameters
    ----------
    z, curvature : (n,) positions in the zone, and the curvature of the profile there [mm, 1/mm]
    """
    if isinstance(points, str):
        return
    at = int(abs(curvature).argmax())
    radius = 1 / max(float(abs(curvature[at])), 1e-9)
    given_as = points.in_words if isinstance(points, SectionMesh) else f"{len(points)} points"
    if radius < _SMOOTH * size:
        allowed = (
            f"must be smooth: at z = {z[at]:.4g} mm the radius of the curve through them is "
            f"{radius:.2g} mm, below {_SMOOTH:g} sides of elements, {size:.3g} mm each; "
            "smooth the points"
        )
        raise ModelError(name, given_as, allowed)
    if isinstance(points, SectionMesh):  # `MeshedRail.zoned` looks at its edges
        return
    given = np.array(points)[:, 0]
    inside = np.flatnonzero((given[1:] > z.min()) & (given[:-1] < z.max()))
    widest = inside[np.diff(given)[inside].argmax()] if len(inside) else 0
    if np.diff(given)[widest] > _APART:
        allowed = (
            f"must have points at most {_APART:g} mm apart where the bodies touch, not "
            f"{given[widest]:g} and {given[widest + 1]:g}"
        )
        raise ModelError(name, given_as, allowed)


@kept
def mesh_of(own: RailGeometry) -> ZonedMesh:
    """Return the mesh of a rail."""
    zone = Zone(
        at=own.at, half_width=own.half_width, depth=own.depth, size=own.size, split=own.split
    )
    rail = canted(own.profile, own.cant)
    if isinstance(rail, MeshedRail):
        return rail.zoned(zone, _COARSE * own.size)
    return ZonedMesh(rail_mesh(rail, zone), zone.elements)


@kept
def section_of(own: RailGeometry) -> Section:
    """Return the meshed section of a rail on its foundation."""
    rail = canted(own.profile, own.cant)
    spring = own.foundation / (rail.foot if isinstance(rail, MeshedRail) else _FOOT)
    return Section(
        mesh_of(own).mesh,
        own.elasticity,
        springs={"foot": (spring, spring, spring)},
    )


def meshed(parameters: WheelRailParameters, own: RailGeometry) -> Section:
    """Return the section of a run.

    Raises
    ------
    ModelError
        for ``lateral_position``, or for a stress at which the rail yields before the first pass
    """
    try:
        section = section_of(own)
    except ModelError as error:
        if isinstance(own.profile, SectionMesh):
            raise ModelError("rail_profile", own.profile.in_words, f"is refused: {error}") from None
        allowed = f"leaves no room for the zone of small elements in the head: {error}"
        raise ModelError("lateral_position", _places(parameters), allowed) from None
    p = parameters
    initial = settled_in(own, p.rail_stress, p.thermal_strain)
    if initial is not None:
        try:
            check_elastic(p.material(), initial.strain, section.points.reshape(2, -1))
        except ModelError as error:
            allowed = f"makes {error.value}, which {error.allowed}"
            raise ModelError(p.stressed_by, getattr(p, p.stressed_by), allowed) from None
    return section


@kept
def settled_in(
    own: RailGeometry, rail: SectionStress, thermal_strain: float
) -> SettledStress | None:
    """Return the stress of a rail before the first pass in equilibrium, None without."""
    return settled(section_of(own), rail, thermal_strain)


@kept
def track_of(own: RailGeometry, length: float | None = None) -> PrismTrack:
    """Return the rail, set up once in a process for each geometry.

    Parameters
    ----------
    length : after which waves repeat [mm]; by default long enough for a pass
    """
    return own.track(section_of(own), _LEVELS, length=length, span=own.span)


@kept
def stressed_track(own: RailGeometry, rail: SectionStress, thermal_strain: float) -> PrismTrack:
    """Return the rail with its stress before the first pass."""
    track, initial = track_of(own), settled_in(own, rail, thermal_strain)
    return track if initial is None else track.stressed(initial)


def settled(section: Section, of: SectionStress, thermal_strain: float) -> SettledStress | None:
    """Return a stress and that of a thermal strain that is held along x, in equilibrium.

    None if there is neither.
    """
    if isinstance(of, NoStress) and thermal_strain == 0.0:
        return None
    given = to_mandel(of.stress(section.points.reshape(2, -1), section.weights.ravel()))
    expanded = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]) * thermal_strain
    held = np.tile(section.elasticity.stiffness(6) @ -expanded, (given.shape[1], 1))
    return StraightPrism(section).settled(given.T, held)
