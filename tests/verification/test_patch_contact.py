"""Rolling contact in space against closed forms: Hertz, Kalker, Carter, full slip."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from solver.errors import LimitLoad, ModelError, Spins, WindowTooSmall
from solver.prism.friction_cone import OPEN, SLIP, STICK
from solver.prism.given_patch import EllipticPatch
from solver.prism.half_space import half_space
from solver.prism.patch import RollingPatch
from solver.prism.patch_contact import PatchContact
from solver.prism.patch_grid import PatchGrid
from solver.prism.profiled_wheel import ProfiledWheel
from tests.verification.hertz_ellipse import STEEL, ellipse, flat, pressed
from tests.verification.rolling_cases import moved, random_case, worst

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
                         (2, (-creep * grid.z, -grid.spacing * np.cumsum(x, axis=0)))):  # fmt: skip
        u = np.stack([change[0], 0 * x, change[1]], axis=-1)
        force = (contact.along(u) * grid.area[:, None]).sum(axis=(0, 1))
        found.append(force[axis] / size)
    return np.array(found) / [1.0, 1.0, np.sqrt(a * b)]


@pytest.mark.parametrize("axes", KALKER)
def test_creep_coefficients_of_kalker_are_approached_with_the_distance_of_stations(
    axes: tuple[float, float],
) -> None:
    """The difference of slip has an error of first order in the distance h of stations.

    On one grid the contact ends where its stations and vertices allow: up to 2 % of a coefficient,
    less where they are not symmetric about the middle. Twenty grids, with a / h from 6 to 18, tell
    the line of errors over h / a: 0.4 h / a for C11 and C22, less for C23. It meets the table.
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
    assert slope[:2] == pytest.approx([0.4, 0.4], abs=0.1)
    assert abs(slope[2]) < 0.2


@cache
def carter(ratio: float) -> tuple[float, float, float]:
    """Return errors of a wide ellipse against Carter's strip: shear, stick length, force."""
    hertz, less = ellipse(1.0, ratio), 0.3
    rolling, peak = hertz.radii[0], hertz.peak_pressure
    patch = pressed(
        hertz, 1 / 16.5, ratio / 5, friction=FRICTION, creepage=FRICTION * less / rolling
    )
    contact = patch.solve(flat(patch))
    middle, x = len(contact.grid.z) // 2, contact.grid.x

    def root(share: np.ndarray) -> np.ndarray:
        return np.sqrt(np.maximum(0.0, 1 - share**2))

    shear = FRICTION * peak * (root(x) - (1 - less) * root((x - less) / (1 - less)))
    width = root(np.linspace(-1.0, 1.0, 2001))
    held = 1 - np.divide(np.maximum(width - less, 0), width, out=0 * width, where=width > 0) ** 2
    force = FRICTION * np.pi / 2 * peak * ratio * np.trapezoid(width**2 * held, dx=1e-3)
    stick = (contact.status[:, middle] == STICK).sum() * contact.grid.spacing / 2
    return (
        float(np.abs(contact.shear[:, middle, 0] - shear).max() / (FRICTION * peak)),
        float(stick / (1 - less) - 1),
        float(contact.force[0] / force - 1),
    )


def test_the_middle_of_a_wide_ellipse_is_the_strip_of_carter() -> None:
    """Creepage reduces the half-length a of each strip's stick zone by the same amount.

    F.W. Carter (1926), in K.L. Johnson, Contact Mechanics (1985), 8.3.
    """
    near, far = carter(4.0), carter(16.0)
    assert far[0] < 0.04
    assert far[0] < 0.5 * near[0]
    assert far[1] == pytest.approx(0.0, abs=0.05)
    assert far[2] == pytest.approx(0.0, abs=0.01)


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
    assert patch.moment == pytest.approx(-0.75 * FRICTION * hertz.force)
    assert contact.force[2] == pytest.approx(lateral, rel=1e-8)
    assert contact.force[0] == pytest.approx(patch.moment, rel=1e-6)  # the wheel is a cylinder
    assert contact.creepage < 0
    given = pressed(
        hertz, 1 / 6, 1 / 3, friction=FRICTION, creepage=contact.creepage,
        lateral_creepage=contact.lateral_creepage,
    )  # fmt: skip
    assert given.solve(flat(given)).traction == pytest.approx(contact.traction, abs=1e-6)


def test_more_than_friction_is_a_clear_error() -> None:
    hertz = ellipse(1.0, 1.0)
    for drive in (1.02, -1.3):
        patch = pressed(hertz, 1 / 6, 1 / 5, friction=FRICTION, drive=drive)
        share = f"{1 / abs(drive):.1%}"[:3]
        with pytest.raises(Spins, match=rf"spins: all of its contact slips at {share}"):
            patch.solve(flat(patch))
        below = patch.driven(0.99 / abs(drive))
        assert abs(below.solve(flat(patch)).force[0]) < FRICTION * hertz.force
        slipping = patch.slipping.solve(flat(patch))
        assert slipping.force[0] == pytest.approx(np.sign(drive) * FRICTION * hertz.force, rel=1e-4)
    patch = pressed(hertz, 1 / 6, 1 / 5, friction=FRICTION, lateral_force=0.31 * hertz.force)
    with pytest.raises(LimitLoad, match=r"slides off: all of its contact slips at 96\.77%"):
        patch.solve(flat(patch))


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
    rail = half_space(grid.hats.s, grid.spacing, grid.stations, STEEL)
    wheel = ProfiledWheel(profile=np.zeros_like, radius=rolling, elasticity=STEEL)
    contact = RollingPatch(grid, rail, wheel, friction=FRICTION, force=2 * hertz.force,
                           creepage=1e-5).solve(np.zeros((19, len(z), 3)))  # fmt: skip
    touching = (contact.status != OPEN).any(axis=0)
    assert np.diff(touching.astype(int)).tolist().count(1) == 2
    for side in (z < 0, z > 0):
        assert contact.pressure[:, side].max() == pytest.approx(hertz.peak_pressure, rel=0.01)
        force = (contact.pressure * grid.area)[:, side].sum()
        assert force == pytest.approx(hertz.force, rel=1e-6)


@pytest.mark.parametrize("seed", range(100))
def test_random_contacts_are_found_and_meet_every_condition(seed: int) -> None:
    """Gap and slip of every tenth are summed up here anew; those of all meet the conditions."""
    patch, compliance, wheel, given = random_case(seed)
    contact = patch.solve(flat(patch))
    assert contact.steps <= 20
    gap, slip = contact.gap, contact.slip[1:]
    if seed % 10 == 0:
        gap, slip = moved(contact, compliance, wheel)
        assert contact.gap == pytest.approx(gap, abs=1e-10)
        assert contact.slip[1:] == pytest.approx(slip, abs=1e-10)
    assert worst(contact, given["friction"], gap, slip) < 1e-7
    assert contact.force[1] == pytest.approx(-given["force"], rel=1e-8)
    if "lateral_force" in given:
        assert contact.force[2] == pytest.approx(given["lateral_force"], rel=1e-8)


def wave(patch: RollingPatch, size: float) -> np.ndarray:
    """Return smooth displacements (n, m, 3) of a surface, of a size [mm]."""
    x, z = patch.grid.x[:, None], patch.grid.z
    parts = [0.1 * np.sin(2 * x + z), np.cos(1.5 * x - z), 0.1 * np.sin(x + 3 * z)]
    return size * np.stack(np.broadcast_arrays(*parts), axis=-1)


@pytest.mark.parametrize(
    "given", [{}, {"friction": FRICTION, "drive": -0.5, "lateral_force": 10.0}]
)
def test_along_is_the_derivative_by_displacements_of_the_surface(given: dict[str, float]) -> None:
    hertz = ellipse(1.0, 1.0)
    patch = pressed(hertz, 1 / 8, 1 / 6, **given)
    contact = patch.solve(flat(patch))
    size = 1e-4 * hertz.approach
    ahead, behind = (patch.solve(wave(patch, sign * size), contact) for sign in (1, -1))
    assert max(ahead.steps, behind.steps) <= 4
    assert (ahead.status == behind.status).all()
    change = contact.along(wave(patch, 1.0))
    central = (ahead.traction - behind.traction) / (2 * size)
    assert central == pytest.approx(change, abs=1e-4 * np.abs(change).max())


def test_a_contact_is_its_own_start() -> None:
    """Its derivative is that of the last Newton step, a step of 1e-4 away; here it is made anew."""
    patch = pressed(ellipse(1.0, 1.0), 1 / 6, 1 / 5, friction=FRICTION, drive=0.6)
    contact = patch.solve(flat(patch))
    again = patch.solve(flat(patch), contact)
    assert again.steps == 0
    change = again.along(wave(patch, 1.0))
    assert contact.along(wave(patch, 1.0)) == pytest.approx(change, abs=1e-3 * np.abs(change).max())


def test_moving_the_whole_surface_moves_the_wheel() -> None:
    patch = pressed(ellipse(1.0, 1.0), 1 / 6, 1 / 5, friction=FRICTION, drive=0.6)
    contact, down = patch.solve(flat(patch)), flat(patch)
    down[..., 1] = -30.0
    lower = patch.solve(down)
    assert lower.height == pytest.approx(contact.height - 30.0, abs=1e-9)
    assert lower.traction == pytest.approx(contact.traction, abs=1e-4)


def test_a_contact_at_the_end_of_the_grid_is_refused() -> None:
    patch = pressed(ellipse(1.0, 1.0), 1 / 6, 1 / 5, margin=0.6)
    with pytest.raises(WindowTooSmall, match="outermost"):
        patch.solve(flat(patch))


def test_bad_input_is_named() -> None:
    hertz = ellipse(1.0, 1.0)
    for name, value, allowed in (("friction", 1.2, "between 0 and 1"), ("force", 0.0, "positive")):
        with pytest.raises(ModelError, match=rf"{name} = {value}.*{allowed}"):
            grid = pressed(hertz, 0.2, 0.2).grid
            wheel = ProfiledWheel(profile=np.zeros_like, radius=1.0, elasticity=STEEL)
            rail = half_space(grid.hats.s, 0.2, grid.stations, STEEL)
            RollingPatch(grid, rail, wheel, **{"friction": 0.1, "force": 1.0, name: value})
    with pytest.raises(ModelError, match=r"compliance = .*15, 3, 15, 3"):
        RollingPatch(grid, rail[:5], wheel, friction=0.1, force=1.0)
    with pytest.raises(ModelError, match="must increase, 3 positions or more"):
        PatchGrid(z=grid.z[::-1], y=grid.y, angle=grid.angle, spacing=0.2, ahead=1.0, stations=9)


def test_a_given_ellipse_has_its_resultants() -> None:
    grid = pressed(ellipse(1.0, 2.0), 1 / 8, 1 / 4).grid
    load = EllipticPatch(grid=grid, force=1000.0, a=1.0, b=2.0, centre=0.1, shear=(0.2, -0.1))
    contact = load.solve(np.zeros((grid.stations, len(grid.z), 3)))
    assert contact.pressure.max() == pytest.approx(1500 / (2 * np.pi), rel=0.01)
    assert contact.force == pytest.approx([200.0, -1000.0, -100.0], rel=1e-3)  # the crown's slope
    assert second_moments(contact)[0] == pytest.approx(1.0, rel=5e-3)
    assert not contact.along(contact.traction).any()
    assert load.scaled(0.5).solve(contact.traction).force == pytest.approx(contact.force / 2)
    assert load.driven(0.5) is load.slipping is load
    assert load.moment == 0
    with pytest.raises(WindowTooSmall):
        EllipticPatch(grid=grid, force=1.0, a=1.3, b=2.0)
