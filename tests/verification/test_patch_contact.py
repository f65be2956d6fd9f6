"""Rolling contact in space against closed forms: Hertz, Kalker, Carter, full slip."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from solver.errors import WindowTooSmall
from solver.materials import Elasticity
from solver.rolling.load import RollingLoad
from solver.rolling.rail.friction_cone import OPEN, SLIP, STICK
from solver.rolling.rail.patch_contact import EllipticPatch, PatchContact
from solver.rolling.rail.patch_grid import PatchGrid
from solver.rolling.rail.profiled_wheel import ProfiledWheel
from tests.verification.hertz_ellipse import STEEL, ellipse, flat, pressed, surface_of, wheel_on
from tests.verification.stepped_patch import SteppedPatch
from tests.verification.stepped_prism import Bare

FRICTION = 0.3


def second_moments(contact: PatchContact) -> tuple[float, float]:
    """Return the semi-axes that an ellipse with these second moments of pressure has [mm]."""
    P, grid = contact.pressure * contact.grid.area, contact.grid
    along, across = (P * grid.x[:, None] ** 2).sum(), (P * grid.z**2).sum()
    return float(np.sqrt(5 * along / P.sum())), float(np.sqrt(5 * across / P.sum()))


@pytest.mark.parametrize(("a", "b"), [(1.0, 1.0), (1.0, 2.0), (2.0, 1.0)])
def test_hertz_holds_and_the_axes_converge_with_the_square_of_the_distance(
    a: float, b: float
) -> None:
    hertz = ellipse(a, b)
    """At a/16 axes, approach and largest pressure err by 0.16, 0.007 and 0.05 %."""
    misses = []
    for n in (4, 8, 16):
        patch = pressed(hertz, a / n, b / n)
        contact = patch.solve(flat(patch))
        axes = second_moments(contact)
        misses.append([axes[0] / a - 1, axes[1] / b - 1])
        assert -contact.height == pytest.approx(hertz.approach, rel=5e-4)
        assert contact.pressure.max() == pytest.approx(hertz.peak_pressure, rel=5e-3)
        assert contact.force == pytest.approx([0.0, -hertz.force, 0.0], abs=1e-9 * hertz.force)
    orders = np.log2(np.abs(misses[0]) / np.abs(misses[2])) / 2
    assert np.abs(misses[2]).max() < 2e-3
    assert (orders > 1.5).all()


KALKER = {(1.0, 1.0): (4.12, 3.67, 1.47), (1.0, 2.0): (3.62, 3.01, 0.929),
          (2.0, 1.0): (5.10, 4.90, 2.62)}  # fmt: skip
"""C11, C22, C23 for nu = 0.25 over semi-axes along and across, to three digits: J.J. Kalker,
Three-Dimensional Elastic Bodies in Rolling Contact (1990), table of creepage coefficients."""


def creep_forces(a: float, b: float, along: float, across: float, shift: float = 0.0) -> np.ndarray:
    """Return C11, C22, C23 of a contact that sticks.

    Its response is linear: a displacement of the surface that grows from station to station acts
    as a creepage, one whose growth is proportional to x or z as spin.
    """
    patch = pressed(ellipse(a, b, 1e-5), along, across, friction=1.0, shift=shift)
    contact = patch.solve(flat(patch))
    assert not (contact.status == SLIP).any()
    grid, steps = contact.grid, np.arange(contact.grid.stations)[:, None]
    x, size = np.broadcast_arrays(grid.x[:, None], contact.pressure)[0], STEEL.shear_modulus * a * b
    creep = -grid.spacing * (steps + 0 * x)
    found = []
    for axis, change in ((0, (creep, 0 * x)), (2, (0 * x, creep)),
                         (2, (-creep * grid.z, x**2 / 2))):  # fmt: skip
        u = np.stack([change[0], 0 * x, change[1]], axis=-1)
        force = (contact.along(u) * grid.area[:, None]).sum(axis=(0, 1))
        found.append(force[axis] / size)
    return np.array(found) / [1.0, 1.0, np.sqrt(a * b)]


@pytest.mark.parametrize("axes", KALKER)
def test_creep_coefficients_of_kalker_are_met_on_one_grid(axes: tuple[float, float]) -> None:
    """a/16 along, b/8 across: C11 and C22 within 1 %, C23 within 2 %.

    On a grid the contact ends where its stations and vertices allow, which is what is left.
    """
    a, b = axes
    errors = creep_forces(a, b, a / 16, b / 8) / KALKER[axes] - 1
    assert np.abs(errors[:2]).max() < 0.01
    assert abs(errors[2]) < 0.02


@pytest.mark.long
@pytest.mark.parametrize("axes", KALKER)
def test_creep_coefficients_have_hardly_an_error_of_first_order(axes: tuple[float, float]) -> None:
    """Errors of twenty grids, with a / h from 6 to 18: 0.05 h / a in the mean, 0.1 h / a for C23.

    A slip from the difference of two stations makes 0.4 h / a. The mean meets the table.
    """
    a, b = axes
    along = np.linspace(6, 18, 20)
    across = 5 + 3 * (np.arange(20) * 7 % 20) / 20
    errors = [
        creep_forces(a, b, a / n, b / m, shift=0.3) / KALKER[axes] - 1
        for n, m in zip(along, across, strict=True)
    ]
    line = np.stack([np.ones(20), 1 / along], axis=1)
    limit, slope = np.linalg.lstsq(line, np.array(errors))[0]
    assert limit[:2] == pytest.approx([0.0, 0.0], abs=0.01)
    assert limit[2] == pytest.approx(0.0, abs=0.02)
    assert np.abs(slope[:2]).max() < 0.12
    assert abs(slope[2]) < 0.2


@cache
def carter(ratio: float, n: float, shift: float = 0.0) -> tuple[float, float, float]:
    """Return errors of a wide ellipse against Carter's strip: shear, stick length, force.

    Stations are a / n apart. The shear, root mean square over friction times p0, and the
    stick length, in distances of stations, are those near the middle.
    """
    hertz, less = ellipse(1.0, ratio), 0.3
    rolling, peak = hertz.radii[0], hertz.peak_pressure
    patch = pressed(
        hertz, 1 / n, ratio / 5, friction=FRICTION, creepage=FRICTION * less / rolling, shift=shift
    )
    contact = patch.solve(flat(patch))
    middle, x = len(contact.grid.z) // 2, contact.grid.x
    half = np.sqrt(1 - (contact.grid.z[middle] / ratio) ** 2)

    def root(square: np.ndarray) -> np.ndarray:
        return np.sqrt(np.maximum(0.0, square))

    shear = FRICTION * peak * (root(half**2 - x**2) - root((half - less) ** 2 - (x - less) ** 2))
    width = root(1 - np.linspace(-1.0, 1.0, 2001) ** 2)
    held = 1 - np.divide(np.maximum(width - less, 0), width, out=0 * width, where=width > 0) ** 2
    force = FRICTION * np.pi / 2 * peak * ratio * np.trapezoid(width**2 * held, dx=1e-3)
    sticks, off = contact.status[:, middle] == STICK, contact.shear[:, middle, 0] - shear
    assert (np.diff(sticks.astype(int)) == 1).sum() == 1  # one zone, at the leading edge
    return (
        float(np.sqrt(np.mean(off[np.abs(x) < half] ** 2)) / (FRICTION * peak)),
        float(sticks.sum() - 2 * (half - less) * n),
        float(contact.force[0] / force - 1),
    )


def test_the_middle_of_a_wide_ellipse_is_the_strip_of_carter() -> None:
    """Creepage reduces the half-length a of each strip's stick zone by the same amount.

    The force is met within 1 % in the mean over places of the stations; a single grid of a/8.5 is
    within 1.5 %. F.W. Carter (1926), in K.L. Johnson, Contact Mechanics (1985), 8.3.
    """
    errors = np.array([carter(64.0, 8.5, shift) for shift in (0.0, 0.25, 0.5, 0.75)])
    assert errors[:, 0].max() < 0.02
    assert np.abs(errors[:, 1]).max() < 1.0
    assert np.abs(errors[:, 2]).max() < 0.015
    assert abs(errors[:, 2].mean()) < 0.006
    shear, stick, force = carter(64.0, 17.0)
    assert shear < 0.02
    assert abs(stick) < 1.0
    assert abs(force) < 0.006


@pytest.mark.parametrize("share", [0.3, 0.6, 0.85])
def test_a_ball_that_is_moved_aside_slips_as_cattaneo_and_mindlin_say(share: float) -> None:
    """Pressed and moved along x, by its only increment: from the rim inwards.

    K.L. Johnson, Contact Mechanics (1985), (7.40) and (7.42). Shear across, a twentieth of that
    along, is left out there.
    """
    hertz, n, G, nu = ellipse(1.0, 1.0), 8, STEEL.shear_modulus, STEEL.poisson_ratio
    most = 3 * (2 - nu) * FRICTION * hertz.force / (8 * G)
    aside = most * (1 - (1 - share) ** (2 / 3))
    like = pressed(hertz, 1 / n, 1 / n)
    ball = wheel_on(
        like.grid, surface_of(like.grid), like.wheel, kind=SteppedPatch, friction=FRICTION,
        force=hertz.force, drive=share,
    )  # fmt: skip
    contact = ball.following([Bare(flat(ball))], 0).solve(flat(ball))
    assert contact.force[0] == pytest.approx(share * FRICTION * hertz.force, rel=1e-6)
    assert contact.creepage / n == pytest.approx(aside, rel=2e-3)
    stick = np.sqrt(((contact.status == STICK) * contact.grid.area).sum() / np.pi)
    assert stick == pytest.approx((1 - share) ** (1 / 3), rel=0.02)


def test_force_grows_with_creepage_up_to_friction_times_load() -> None:
    hertz = ellipse(1.0, 1.0)
    full, start, forces = FRICTION / hertz.radii[0], None, []
    for share in (0.05, 0.2, 0.5, 1.0, 3.0, 10.0):
        patch = pressed(hertz, 1 / 8, 1 / 6, friction=FRICTION, creepage=share * full)
        start = patch.solve(flat(patch), start)
        forces.append(float(start.force[0]) / (FRICTION * hertz.force))
    assert (np.diff(forces) > 0).all()
    assert forces[-1] == pytest.approx(1.0, abs=2e-5)  # shear across, from the crown, is the rest
    assert not (start.status == STICK).any()


def test_lateral_slip_and_spin_act_as_kalker_defines_them() -> None:
    """Full slip: friction drags the surface the way the wheel moves; spin turns it about -y."""
    hertz = ellipse(1.0, 1.0)
    sliding = pressed(hertz, 1 / 8, 1 / 6, friction=FRICTION, lateral_creepage=0.1)
    assert sliding.solve(flat(sliding)).force[2] == pytest.approx(FRICTION * hertz.force, rel=1e-4)
    turning = pressed(hertz, 1 / 8, 1 / 6, friction=FRICTION, spin=1.0)
    contact = turning.solve(flat(turning))
    # the mean distance from the centre under Hertz's pressure is 3 pi a / 16
    moment = FRICTION * hertz.force * 3 * np.pi / 16
    assert contact.spin_moment == pytest.approx(moment, rel=0.01)


def test_a_given_moment_and_lateral_force_are_carried() -> None:
    hertz = ellipse(1.0, 2.0)
    lateral = -0.4 * FRICTION * hertz.force
    patch = pressed(hertz, 1 / 6, 1 / 3, friction=FRICTION, drive=-0.75, lateral_force=lateral)
    contact = patch.solve(flat(patch))
    assert contact.moment == pytest.approx(-0.75 * FRICTION * hertz.force)
    assert contact.force[2] == pytest.approx(lateral, rel=1e-8)
    assert contact.force[0] == pytest.approx(contact.moment, rel=1e-6)  # the wheel is a cylinder
    assert contact.creepage < 0
    given = pressed(
        hertz, 1 / 6, 1 / 3, friction=FRICTION, creepage=contact.creepage,
        lateral_creepage=contact.lateral_creepage,
    )  # fmt: skip
    assert given.solve(flat(given)).traction == pytest.approx(contact.traction, abs=1e-6)


@pytest.mark.parametrize("elastic", ["surface", "wheel"])
def test_pressure_draws_the_surface_of_the_elastic_body_to_the_middle(elastic: str) -> None:
    """Near the middle its strain is -p0 (1 - 2 nu)(1 + nu) / 2E: K.L. Johnson (1985), 3.41."""
    hertz, rigid = ellipse(1.0, 1.0), Elasticity(youngs_modulus=np.inf, poisson_ratio=0.3)
    grid = pressed(hertz, 1 / 8, 1 / 6).grid
    bodies = (STEEL, rigid) if elastic == "surface" else (rigid, STEEL)
    wheel = ProfiledWheel(profile=np.zeros_like, radius=hertz.radii[0], elasticity=bodies[1])
    patch = wheel_on(grid, surface_of(grid, bodies[0]), wheel, friction=0.0, force=hertz.force)
    contact = patch.solve(flat(patch))
    middle = grid.stations // 2, len(grid.z) // 2
    nu, sign = STEEL.poisson_ratio, 1 if elastic == "surface" else -1
    strain = (1 - 2 * nu) * (1 + nu) * contact.pressure.max() / (2 * STEEL.youngs_modulus)
    assert contact.slip[middle][0] == pytest.approx(sign * strain * grid.spacing, rel=0.02)


def test_a_cone_that_rolls_spins() -> None:
    """A slope turns the wheel's rotation out of the surface, as a spin of -sin(slope) / R does."""
    hertz, slope = ellipse(1.0, 1.0, 1e-5), 0.05
    level = pressed(hertz, 1 / 8, 1 / 6, friction=1.0)
    grid, radius = level.grid, hertz.radii[0]
    cone = ProfiledWheel(profile=lambda z: slope * z, radius=radius, elasticity=STEEL)
    tilted = replace(grid, y=grid.y + slope * grid.z, angle=grid.angle + np.arctan(slope))
    rolled = wheel_on(tilted, surface_of(tilted), cone, friction=1.0, force=hertz.force, drive=0.0)
    spun = pressed(hertz, 1 / 8, 1 / 6, friction=1.0, drive=0.0, spin=-np.sin(slope) / radius)
    across = [
        (contact.shear[..., 1] * contact.grid.area).sum()
        for contact in (rolled.solve(flat(rolled)), spun.solve(flat(spun)))
    ]
    assert across[0] == pytest.approx(across[1], rel=0.02)
    assert across[1] == pytest.approx(
        -STEEL.shear_modulus * KALKER[1.0, 1.0][2] * np.sin(slope) / radius, rel=0.05
    )


def test_a_wheel_that_touches_at_a_smaller_radius_turns_faster() -> None:
    """Free rolling at R - 3 mm: (1 - creepage) (R - 3) = R, beyond the creepage of full slip."""
    hertz = ellipse(1.0, 1.0)
    patch = pressed(hertz, 1 / 6, 1 / 5)
    grid, radius = patch.grid, hertz.radii[0]
    wheel = ProfiledWheel(profile=lambda z: 0 * z + 3.0, radius=radius, elasticity=STEEL)
    rolled = wheel_on(
        grid, surface_of(grid), wheel, friction=FRICTION, force=hertz.force, drive=0.0
    )
    contact = rolled.solve(flat(rolled))
    assert contact.creepage == pytest.approx(1 - radius / (radius - 3.0), rel=1e-4)
    assert np.linalg.norm(contact.shear, axis=-1).max() < 0.01 * contact.pressure.max()


def test_two_crowns_share_the_load() -> None:
    """Each is the contact of a ball with half the load, 10 contact radii apart."""
    hertz = ellipse(1.0, 1.0)
    rolling, crown = hertz.radii
    z = np.arange(-6.5, 6.6, 1 / 5)
    nearest = np.abs(z) - 5.0
    grid = PatchGrid(
        z=z, y=-(nearest**2) / (2 * crown), angle=-np.arctan(np.sign(z) * nearest / crown),
        spacing=1 / 6, ahead=1.5, stations=19,
    )  # fmt: skip
    wheel = ProfiledWheel(profile=np.zeros_like, radius=rolling, elasticity=STEEL)
    contact = wheel_on(grid, surface_of(grid), wheel, friction=FRICTION, force=2 * hertz.force,
                           creepage=1e-5).solve(np.zeros((19, len(z), 3)))  # fmt: skip
    touching = (contact.status != OPEN).any(axis=0)
    assert np.diff(touching.astype(int)).tolist().count(1) == 2
    for side in (z < 0, z > 0):
        assert contact.pressure[:, side].max() == pytest.approx(hertz.peak_pressure, rel=0.01)
        force = (contact.pressure * grid.area)[:, side].sum()
        assert force == pytest.approx(hertz.force, rel=1e-6)


def test_a_given_ellipse_has_its_resultants() -> None:
    grid = pressed(ellipse(1.0, 2.0), 1 / 8, 1 / 4).grid
    load = EllipticPatch(
        grid=grid, load=RollingLoad(force=1000.0), a=1.0, b=2.0, centre=0.1, shear=(0.2, -0.1)
    )
    contact = load.solve(np.zeros((grid.stations, len(grid.z), 3)))
    assert contact.pressure.max() == pytest.approx(1500 / (2 * np.pi), rel=0.01)
    assert contact.force == pytest.approx([200.0, -1000.0, -100.0], rel=1e-3)  # the crown's slope
    assert second_moments(contact)[0] == pytest.approx(1.0, rel=5e-3)
    assert not contact.along(contact.traction).any()
    half = load.changed(load=load.load.scaled(0.5))
    assert half.solve(contact.traction).force == pytest.approx(contact.force / 2)
    assert load.load.driven(0.5) == load.load.slipping == load.load
    with pytest.raises(WindowTooSmall):
        EllipticPatch(grid=grid, load=RollingLoad(force=1.0), a=1.3, b=2.0)
