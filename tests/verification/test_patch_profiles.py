"""A wheel on surfaces of any slope: contact on a side, at two places, and with a yawed axle."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.errors import ModelError
from solver.rolling.rail.friction_cone import OPEN
from solver.rolling.rail.patch_contact import PatchContact
from solver.rolling.rail.patch_grid import PatchGrid
from solver.rolling.rail.profiled_wheel import ProfiledWheel
from solver.rolling.rail.profiles.wheel_profile import s1002
from tests.verification.hertz_ellipse import STEEL, ellipse, flat, pressed, surface_of, wheel_on

Array = NDArray[np.float64]


def solved(
    grid: PatchGrid, wheel: ProfiledWheel, force: float, friction: float = 0.0
) -> PatchContact:
    patch = wheel_on(grid, surface_of(grid), wheel, friction=friction, force=force)
    return patch.solve(flat(patch))


@pytest.mark.parametrize("crowned", ["rail", "wheel"])
@pytest.mark.parametrize("degrees", [30.0, -60.0])
def test_a_contact_that_is_turned_as_a_whole_has_the_same_pressure(
    crowned: str, degrees: float
) -> None:
    """The vertical force is the part of the normal force; a cone has its radius over the cosine.

    The radius of the cone of 60 degrees changes by 0.4 % across the contact, which moves the
    pressure at its edge by 1 % of the largest.
    """
    hertz, turn = ellipse(1.0, 1.0), np.radians(degrees)
    level = pressed(hertz, 1 / 6, 1 / 6)
    grid, (rolling, crown) = level.grid, hertz.radii
    cos, sin = np.cos(turn), np.sin(turn)
    z, y, angle = grid.z, grid.y, grid.angle
    if crowned == "wheel":
        z, y, angle = crown * np.sin(z / crown), 0 * y, 0 * angle
    turned = PatchGrid(
        z=z * cos - y * sin, y=z * sin + y * cos, angle=angle + turn, spacing=grid.spacing,
        ahead=grid.ahead, stations=grid.stations,
    )  # fmt: skip

    def profile(z: Array) -> Array:
        if crowned == "rail":
            return np.tan(turn) * z
        return crown * cos - np.sqrt(crown**2 - (z + crown * sin) ** 2)

    wheel = ProfiledWheel(profile=profile, radius=rolling * cos, elasticity=STEEL)
    contact, as_before = solved(turned, wheel, hertz.force * cos), level.solve(flat(level))
    scale = hertz.peak_pressure
    assert contact.pressure == pytest.approx(as_before.pressure, abs=0.015 * scale)
    assert contact.pressure.max() == pytest.approx(scale, rel=5e-3)
    assert contact.force[2] == pytest.approx(hertz.force * sin, rel=1e-2)


def test_two_contacts_share_the_load_with_equal_approach() -> None:
    """One on the top, one on a side of 45 degrees, which the same sinking closes by 0.71.

    Both are circles, of a load 4/3 E* R^(1/2) approach^(3/2). Each lowers the other as a point
    force does on two half-spaces, which takes 4 % off the ratio of the loads.
    """
    hertz, apart = ellipse(1.0, 1.0), 6.0
    rolling, slope = hertz.radii[0], np.pi / 4
    radii = np.array([rolling, (rolling + apart * np.sin(slope)) / np.cos(slope)])
    s = np.arange(-1.5, 1.51, 1 / 6)
    side, top = (s - apart, s + apart)
    bump = s**2 / (2 * radii[1]), s**2 / (2 * radii[0])
    z = np.concatenate([side * np.cos(slope) + bump[0] * np.sin(slope), top])
    y = np.concatenate([side * np.sin(slope) - bump[0] * np.cos(slope), -bump[1]])
    angle = np.concatenate([slope - s / radii[1], -s / radii[0]])
    grid = PatchGrid(z=z, y=y, angle=angle, spacing=1 / 6, ahead=1.5, stations=19)
    wheel = ProfiledWheel(profile=lambda z: np.minimum(z, 0.0), radius=rolling, elasticity=STEEL)
    contact = solved(grid, wheel, 1.5 * hertz.force)
    normal = (contact.pressure * grid.area).sum(axis=0)
    on_side, on_top = normal[: len(s)].sum(), normal[len(s) :].sum()
    assert on_top + on_side * np.cos(slope) == pytest.approx(1.5 * hertz.force, rel=1e-5)
    distance = np.ptp(grid.hats.s[[len(s) // 2, len(s) + len(s) // 2]])
    sunk = -contact.height * np.array([1.0, np.cos(slope)])
    sunk -= np.array([on_side, on_top]) / (np.pi * hertz.modulus * distance)
    carried = 4 / 3 * hertz.modulus * np.sqrt(radii) * sunk**1.5
    assert [on_top, on_side] == pytest.approx(carried, rel=5e-3)
    touching = (contact.status != OPEN).any(axis=0)
    assert np.diff(touching.astype(int)).tolist().count(1) == 2


def test_the_gap_is_the_distance_along_the_normal() -> None:
    """Of circles across: their centres are known, so is the distance of every point."""
    rail, wheel_crown, turn = 13.0, 14.0, np.radians(50.0)
    angle = turn + np.linspace(-0.2, 0.2, 21)
    z, y = -rail * np.sin(angle), rail * np.cos(angle)
    grid = PatchGrid(z=z[::-1], y=y[::-1], angle=angle[::-1], spacing=1.0, ahead=1.0, stations=3)
    # the circle around them, concave, touches at the angle ``turn``
    centre = np.array([np.sin(turn), -np.cos(turn)]) * (wheel_crown - rail)

    def profile(z: Array) -> Array:
        return centre[1] + np.sqrt(wheel_crown**2 - (z - centre[0]) ** 2)

    wheel = ProfiledWheel(profile=profile, radius=460.0, elasticity=STEEL)
    gap = wheel.rolling(grid)[0][1, :, 1]
    normal = np.stack([-np.sin(grid.angle), np.cos(grid.angle)])
    away = np.stack([grid.z, grid.y]) - centre[:, None]
    along = (away * normal).sum(axis=0)
    exact = -along + np.sqrt(along**2 + wheel_crown**2 - (away**2).sum(axis=0))
    inside = slice(1, -1)  # a mean under a hat: 1 / 12 of the second difference more
    mean = exact[inside] + np.diff(exact, 2) / 12
    assert gap[inside] == pytest.approx(mean, abs=2e-4 * exact.max())
    assert gap.min() < 1e-3 < 0.015 < exact.max()


@pytest.mark.parametrize("ring", [24.05, -35.95])
def test_a_ball_rolls_in_the_groove_of_a_ring(ring: float) -> None:
    """Gap and slip are those of the bodies that turn, a ball and a torus (Heathcote's slip).

    Both surfaces move by w times the distance from their axis; they have one speed at y = 0.
    """
    radius, groove = 5.95, 6.07
    angle = np.linspace(-0.5, 0.5, 41)
    grid = PatchGrid(
        z=groove * np.sin(angle), y=groove * (1 - np.cos(angle)), angle=angle,
        spacing=0.05, ahead=0.5, stations=21,
    )  # fmt: skip
    wheel = ProfiledWheel(
        profile=lambda z: radius - np.sqrt(radius**2 - z**2), radius=radius, elasticity=STEEL,
        track_radius=ring,
    )  # fmt: skip
    rest, _ = wheel.rolling(grid)
    x, y = grid.x[:, None], grid.y
    torus = np.sign(ring) * np.sqrt((ring + y) ** 2 - x**2) - ring  # over the same z
    vertical = radius - np.sqrt(radius**2 - grid.z**2 - x**2) - torus
    inside = slice(1, -1)
    gap = (vertical * np.cos(angle))[:, inside]  # along the normal
    assert rest[:, inside, 1] == pytest.approx(gap, rel=0.02, abs=2e-5)
    rise = radius - np.sqrt(radius**2 - grid.z**2)
    slip = -rise / radius - y / ring
    along = np.broadcast_to(slip[inside], rest[:, inside, 0].shape)
    assert rest[:, inside, 0] / grid.spacing == pytest.approx(along, rel=0.03, abs=2e-4)
    across = x * np.sin(angle) * (1 / radius + 1 / ring)
    assert rest[:, inside, 2] / grid.spacing == pytest.approx(across[:, inside], abs=1e-6)


@pytest.mark.parametrize(
    ("ring", "allowed"),
    [(0.0, "positive, or below -5"), (-5.0, "positive, or below -5"), (np.nan, "a finite number")],
)
def test_a_ring_that_the_ball_does_not_fit_in_is_refused(ring: float, allowed: str) -> None:
    with pytest.raises(ModelError, match=rf"track_radius = {ring}: must be {allowed}"):
        ProfiledWheel(profile=np.zeros_like, radius=5.0, elasticity=STEEL, track_radius=ring)


def test_a_yawed_wheel_touches_behind_on_its_flange_and_slips_across() -> None:
    """By R tan(slope) tan(yaw), as its heading turns away from the flange; creepage grows there.

    The velocity of the wheel across the track is the yaw; up and down it adds to it, so that the
    lateral creepage on the slope is yaw / cos(slope).
    """
    hertz, slope, yaw = ellipse(1.0, 1.0), np.radians(60.0), 0.002
    level = pressed(hertz, 1 / 6, 1 / 6, margin=3.0)
    grid, rolling = level.grid, hertz.radii[0]
    cos, sin = np.cos(slope), np.sin(slope)
    turned = PatchGrid(
        z=grid.z * cos - grid.y * sin, y=grid.z * sin + grid.y * cos, angle=grid.angle + slope,
        spacing=grid.spacing, ahead=grid.ahead + 0.5, stations=grid.stations + 6,
    )  # fmt: skip
    wheel = ProfiledWheel(
        profile=lambda z: np.tan(slope) * z, radius=rolling * cos, elasticity=STEEL, yaw=yaw
    )
    contact = solved(turned, wheel, hertz.force * cos)
    weight = contact.pressure / contact.pressure.sum()
    middle = float((weight * turned.x[:, None]).sum())
    behind = -wheel.radius * np.tan(slope) * np.tan(yaw)
    assert behind < -1.0
    assert middle == pytest.approx(behind, rel=0.01)
    assert wheel.lowest(np.zeros(1))[0] == pytest.approx(behind, rel=1e-3)
    assert contact.pressure.max() == pytest.approx(hertz.peak_pressure, rel=5e-3)
    slip = wheel.rolling(turned)[0][..., 2]
    assert float((weight * slip).sum()) / turned.spacing == pytest.approx(-yaw / cos, rel=0.01)


@pytest.mark.parametrize("yaw", [0.005, -0.03, 0.1])
def test_the_lowest_line_of_a_yawed_wheel_is_below_all_others(yaw: float) -> None:
    """Also beside the flange, where a wheel of 0.1 rad touches 110 mm ahead."""
    wheel = ProfiledWheel(profile=s1002().height, radius=460.0, elasticity=STEEL, yaw=yaw)
    z, x = np.arange(-36.0, 30.0, 0.7), np.arange(-150.0, 150.0, 0.1)[:, None]
    lowest = wheel.lowest(z)
    assert np.abs(lowest).max() > 400.0 * abs(yaw)
    assert (wheel.surface(lowest, z) <= wheel.surface(x, z).min(axis=0) + 1e-8).all()
    assert not wheel.lowest(np.array([-300.0, 300.0])).any(), "where there is no wheel"


def test_yaw_of_a_cylinder_is_a_lateral_creepage() -> None:
    hertz, yaw = ellipse(1.0, 1.0), 2e-4
    creeping = pressed(hertz, 1 / 6, 1 / 5, friction=0.3, lateral_creepage=np.tan(yaw), drive=0.0)
    wheel = ProfiledWheel(profile=np.zeros_like, radius=hertz.radii[0], elasticity=STEEL, yaw=yaw)
    grid = creeping.grid
    yawed = wheel_on(grid, surface_of(grid), wheel, friction=0.3, force=hertz.force, drive=0.0)
    forces = [each.solve(flat(each)).force for each in (creeping, yawed)]
    assert forces[1] == pytest.approx(forces[0], abs=1e-3 * abs(forces[0][2]))
    assert 0.1 < forces[0][2] / (0.3 * hertz.force) < 0.95


def test_spin_turns_about_the_axis_of_the_wheel() -> None:
    """Away from z = 0 a wheel that spins about its own axis does not creep."""
    hertz, spin = ellipse(1.0, 1.0), 1e-3
    at_zero = pressed(hertz, 1 / 6, 1 / 5, friction=0.3, spin=spin)
    grid = at_zero.grid
    aside = PatchGrid(
        z=grid.z + 40.0, y=grid.y, angle=grid.angle, spacing=grid.spacing, ahead=grid.ahead,
        stations=grid.stations,
    )  # fmt: skip
    wheel = ProfiledWheel(
        profile=np.zeros_like, radius=hertz.radii[0], elasticity=STEEL, middle=40.0
    )
    moved = wheel_on(aside, surface_of(aside), wheel, friction=0.3, force=hertz.force, spin=spin)
    one, other = (each.solve(flat(each)) for each in (at_zero, moved))
    assert other.traction == pytest.approx(one.traction, abs=1e-6 * hertz.peak_pressure)
    assert abs(one.shear).max() > 0.01 * hertz.peak_pressure


def test_wheels_that_do_not_fit_are_refused() -> None:
    grid = pressed(ellipse(1.0, 1.0), 0.2, 0.2).grid
    with pytest.raises(ModelError, match="yaw = 1"):
        ProfiledWheel(profile=np.zeros_like, radius=460.0, elasticity=STEEL, yaw=1.0)
    ends = ProfiledWheel(
        profile=lambda z: np.where(z < 0.1, 0.0, np.inf), radius=460.0, elasticity=STEEL
    )
    with pytest.raises(ModelError, match="must be finite at every vertex"):
        ends.rolling(grid)
