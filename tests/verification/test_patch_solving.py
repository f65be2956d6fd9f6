"""How a rolling contact is found: in all random cases, from any start, with its derivative."""

from __future__ import annotations

import gc
import re
import weakref
from dataclasses import dataclass, replace

import numpy as np
import pytest

from solver.errors import LimitLoad, ModelError, Spins, WindowTooSmall
from solver.materials import Elasticity
from solver.model.friction import ContactPlaces, Coulomb, FrictionLaw, Value, through
from solver.rolling.rail.friction_cone import OPEN, SLIP, STICK
from solver.rolling.rail.patch import RollingPatch
from solver.rolling.rail.profiled_wheel import ProfiledWheel
from solver.typing import Array
from tests.verification.hertz_ellipse import STEEL, ellipse, flat, pressed, surface_of, wheel_on
from tests.verification.rolling_cases import moved, random_case, worst

FRICTION = 0.3
LIMITED = Coulomb(friction=FRICTION, shear_limit=0.5)


@dataclass(frozen=True)
class Worn(FrictionLaw):
    """Friction that falls with slip."""

    def bound(self, at: ContactPlaces) -> list[tuple[Value, Value]]:
        return [(0.3 * np.exp(-at.slip), 0.0)]


@dataclass(frozen=True)
class Knees(FrictionLaw):
    """A coefficient that falls from 0.4 to 0.1 above 100 MPa."""

    def bound(self, at: ContactPlaces) -> list[tuple[Value, Value]]:
        return through([0.0, 100.0, 1e4], [0.0, 40.0, 1030.0])


@pytest.mark.parametrize("law", [
    LIMITED, Coulomb(friction=FRICTION, cohesion=50.0), Coulomb(cohesion=50.0), Knees(),
])  # fmt: skip
def test_shear_follows_a_law_of_pressure(law: FrictionLaw) -> None:
    """With a small creepage some points stick below the bound, with a large one all are at it."""
    strength, share = 200.0, {}
    for creepage in (2e-4, 0.1):
        patch = pressed(ellipse(1.0, 1.0), 1 / 8, 1 / 6, friction=law, strength=strength,
                        lateral_creepage=creepage)  # fmt: skip
        contact = patch.solve(flat(patch))
        local = np.einsum("jab,cjb->cja", patch.grid.axes, contact.traction)
        p, shear = -local[..., 1], np.hypot(local[..., 0], local[..., 2])
        bound = lines_of_own(law, p, strength)
        assert (shear <= bound + 1e-6 * p.max()).all()
        assert shear[contact.status == SLIP] == pytest.approx(bound[contact.status == SLIP])
        share[creepage] = (contact.status == STICK).sum() / (contact.status != OPEN).sum()
    assert share[2e-4] > 0.05
    assert share[0.1] == 0.0


def lines_of_own(law: FrictionLaw, p: Array, strength: float) -> Array:
    """Return the bound at pressures (n, m), written out."""
    if isinstance(law, Knees):
        return np.where(p < 100.0, 0.4 * p, 40.0 + 0.1 * (p - 100.0))
    assert isinstance(law, Coulomb)
    bound = law.friction * p + np.minimum(law.cohesion, p)
    return np.minimum(bound, law.shear_limit * strength or np.inf)


@pytest.mark.parametrize("seed", range(60))
def test_random_contacts_are_found_and_meet_every_condition(seed: int) -> None:
    """Gap and slip of every tenth are summed up here anew; those of all meet the conditions."""
    patch, compliance, wheel, given = random_case(seed)
    contact = patch.solve(flat(patch))
    assert contact.steps <= 30
    gap, slip = contact.gap, contact.slip[2:]
    if seed % 10 == 0:
        gap, slip = moved(contact, compliance, wheel)
        assert contact.gap == pytest.approx(gap, abs=1e-10)
        assert contact.slip[2:] == pytest.approx(slip, abs=1e-10)
    assert worst(contact, given["friction"], gap, slip) < 1e-7
    assert contact.force[1] == pytest.approx(-given["force"], rel=1e-8)
    if "lateral_force" in given:
        assert contact.force[2] == pytest.approx(given["lateral_force"], rel=1e-8)


def test_a_surface_that_repeats_itself_has_every_distance_once() -> None:
    """Its length, in stations, may be less than twice that of the grid."""
    patch, compliance, wheel, given = random_case(3)
    n = patch.grid.stations
    length = n + n // 2
    distances = np.fft.ifftshift(np.arange(-n, n))
    folded = np.zeros((length, *compliance.shape[1:]))
    np.add.at(folded, distances % length, compliance)
    repeated = wheel_on(patch.grid, folded, wheel, **given)
    contact = repeated.solve(flat(repeated))
    gap, slip = moved(contact, folded, wheel)
    assert contact.gap == pytest.approx(gap, abs=1e-10)
    assert contact.slip[2:] == pytest.approx(slip, abs=1e-10)


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


def test_near_is_the_contact_to_first_order_in_tractions_and_motions() -> None:
    hertz = ellipse(1.0, 1.0)
    patch = pressed(hertz, 1 / 8, 1 / 6, friction=FRICTION, drive=-0.5, lateral_force=10.0)
    contact = patch.solve(flat(patch))
    assert contact.near is not None
    other = wave(patch, 1e-4 * hertz.approach)
    near, exact = contact.near(other), patch.solve(other, contact)
    for name in ("traction", "height", "creepage", "lateral_creepage"):
        first, then, known = (np.array(getattr(c, name)) for c in (contact, exact, near))
        change = np.abs(then - first).max()
        assert change > 0
        assert np.abs(then - known).max() < 0.01 * change, name
    assert patch.solve(other, near).steps < exact.steps


def test_the_equations_of_a_contact_are_freed_with_it() -> None:
    """They are dense: a pass solves many contacts, and must not wait for the garbage collector."""
    patch = pressed(ellipse(1.0, 1.0), 1 / 6, 1 / 5)
    gc.collect()
    gc.disable()
    try:
        contact = patch.solve(flat(patch))
        traction = weakref.ref(contact.traction)
        del contact
        assert traction() is None
    finally:
        gc.enable()


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
    grid = pressed(ellipse(1.0, 1.0), 0.2, 0.2).grid
    wheel = ProfiledWheel(profile=np.zeros_like, radius=1e3, elasticity=STEEL)
    rigid = Elasticity(youngs_modulus=np.inf, poisson_ratio=0.3)
    usual = {
        "grid": grid, "compliance": surface_of(grid), "wheel": wheel, "friction": 0.1, "force": 1.0,
    }  # fmt: skip
    cases = (
        ({"friction": 11.0}, "friction = 11.0: must be at least 0 and at most 10"),
        ({"friction": Worn()}, "must not depend on slip or plastic strain on a track without ends"),
        ({"force": 0.0}, "force = 0.0: must be greater than 0"),
        ({"compliance": np.ones((5, 15, 3, 15, 3))}, "must be (15 or more, 15, 3, 15, 3)"),
        ({"compliance": 0 * surface_of(grid), "wheel": replace(wheel, elasticity=rigid)},
         "surface and wheel must not both be rigid"),
        ({"wheel": replace(wheel, profile=lambda z: np.where(z < 0, np.nan, 0))},
         "must be finite at every vertex"),
        ({"grid": replace(grid, ahead=2e3)},
         "ahead = 2000.0: stations must lie within 1000 of x = 0"),
    )  # fmt: skip
    for change, message in cases:
        with pytest.raises(ModelError, match=re.escape(message)):
            wheel_on(**{**usual, **change}).solve(np.zeros((grid.stations, len(grid.z), 3)))
    for name, value, message in (
        ("z", grid.z[::-1], "must increase, 3 positions or more"),
        ("y", grid.y[1:], "must have 15 values, as z"),
        ("angle", grid.angle + 2.0, "must lie between -pi/2 and pi/2"),
        ("spacing", 0.0, "spacing = 0.0: must be greater than 0"),
        ("stations", 2, "stations = 2: must be at least 3"),
    ):
        with pytest.raises(ModelError, match=re.escape(message)):
            replace(grid, **{name: value})
    with pytest.raises(ModelError, match=re.escape("radius = -1.0: must be greater than 0")):
        replace(wheel, radius=-1.0)


def test_more_than_friction_is_a_clear_error() -> None:
    hertz = ellipse(1.0, 1.0)
    for drive in (1.02, -1.3):
        patch = pressed(hertz, 1 / 6, 1 / 5, friction=FRICTION, drive=drive)
        share = f"{1 / abs(drive):.1%}"[:3]
        with pytest.raises(Spins, match=rf"spins: all of its contact slips at {share}"):
            patch.solve(flat(patch))
        below = patch.changed(load=patch.load.driven(0.99 / abs(drive)))
        assert abs(below.solve(flat(patch)).force[0]) < FRICTION * hertz.force
        slipping = patch.changed(load=patch.load.slipping).solve(flat(patch))
        assert slipping.force[0] == pytest.approx(np.sign(drive) * FRICTION * hertz.force, rel=1e-4)
    patch = pressed(hertz, 1 / 6, 1 / 5, friction=FRICTION, lateral_force=0.31 * hertz.force)
    most = rf"is {FRICTION * hertz.force:.0f} N, not {0.31 * hertz.force:.0f}:"
    with pytest.raises(LimitLoad, match=f"slides off: .* lateral force {most}") as caught:
        patch.solve(flat(patch))
    assert caught.value.reached == pytest.approx(0.9677, abs=1e-4)
