"""Steady passes of an elastic wheel: Hertz, Carter, balance, and the derivative of the contact.

F.W. Carter, Proc. R. Soc. A 112 (1926) 151-157; K.L. Johnson, Contact Mechanics (1985), section
8.3: a wheel that carries the longitudinal force Q on a track of the same material has the creepage
mu a / R (1 - sqrt(1 - Q / (mu P))).
"""

from __future__ import annotations

from functools import cache
from math import sqrt

import numpy as np
import pytest

from solver.contact.problem import OPEN, STICK
from solver.errors import LimitLoad
from solver.model.friction import Coulomb
from solver.rolling.audit.plane import audit_pass
from solver.rolling.load import RollingLoad
from solver.rolling.plane.rolling import rolling
from solver.rolling.plane.track import track_of
from solver.rolling.plane.wheel import RollingWheel
from solver.rolling.scenes.rolling import RollingParameters
from solver.rolling.scenes.rolling_endless import rim_of
from tests.verification.closed_forms import carter_creepage

A, YIELD, FRICTION = 8.0, 502.0, 0.3
MODULUS = 2e5 / (2 * (1 - 0.3**2))


@cache
def wheel(pressure=4.7, size=2.0, share=0.0, friction=FRICTION, creepage=None, hardening="none"):
    """A wheel of p0 / k = ``pressure`` with half-width 8 mm, its track and the material of that.

    ``share`` is its longitudinal force over that of full slip.
    """
    p0 = pressure * YIELD / sqrt(3)
    parameters = RollingParameters(
        load_ratio=p0 / YIELD,
        radius=A * MODULUS / (2 * p0),
        element_size=size,
        friction=friction,
        hardening=hardening,
    )
    material = parameters.material()
    place = track_of(A, size, 1.15, material.elasticity)
    drive = share * friction * parameters.force if creepage is None and friction else None
    load = RollingWheel(
        track=place,
        rim=rim_of(parameters),
        friction=Coulomb(friction=friction),
        load=RollingLoad(force=parameters.force, drive=drive, creepage=creepage or 0.0),
    )
    return parameters, place, material, load


def elastic(**fields):
    """The wheel on an elastic track."""
    parameters, place, _, load = wheel(**fields)
    return parameters, load.on(np.zeros(len(place.operator.kept)), None)


def test_an_elastic_track_is_touched_as_hertz_says():
    parameters, touching = elastic(size=1.0)
    closed = touching.status != OPEN
    pressure = touching.normal[closed] / touching.area[closed]
    hertz = parameters.peak_pressure * np.sqrt(np.maximum(1 - (touching.x[closed] / A) ** 2, 0))
    assert pressure.max() == pytest.approx(parameters.peak_pressure, rel=0.01)
    inside = abs(touching.x[closed]) < 0.7 * A
    np.testing.assert_allclose(pressure[inside], hertz[inside], rtol=0.03)
    assert np.ptp(touching.x[closed]) == pytest.approx(2 * A, abs=2.0)


def test_without_friction_nothing_pulls():
    parameters, touching = elastic(friction=0.0)
    assert not touching.tangential.any()
    assert touching.normal.sum() == pytest.approx(parameters.force, rel=1e-4)


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_creepage_is_carters(share):
    """Braking and driving are averaged: a wheel without a force creeps by 1e-4 of its own."""
    parameters, brakes = elastic(size=0.5, share=share)
    _, drives = elastic(size=0.5, share=-share)
    carter = carter_creepage(FRICTION, A, parameters.radius, share)
    assert (brakes.creepage - drives.creepage) / 2 == pytest.approx(carter, rel=0.05)
    for touching in (brakes, drives):
        sticks = touching.x[touching.status == STICK]
        assert sticks.min() > -A * (2 * sqrt(1 - share) - 1) - 1.5, (
            "the slip is at the trailing end"
        )


def test_given_creepage_makes_the_force_that_creeps_so():
    _, moved = elastic(share=0.5)
    _, turned = elastic(creepage=moved.creepage)
    np.testing.assert_allclose(turned.tangential, moved.tangential, atol=1e-3)


@pytest.mark.parametrize(
    ("share", "hardening"), [(0.0, "none"), (0.5, "none"), (-0.5, "kinematic")]
)
def test_contact_forces_balance_the_axle_and_obey_coulomb(share, hardening):
    parameters, place, material, load = wheel(share=share, hardening=hardening)
    (one,) = rolling(place, material, load, [1])
    touching = one.loading
    drive = share * FRICTION * parameters.force
    assert touching.force[1::2].sum() == pytest.approx(-parameters.force, rel=1e-3)
    assert touching.force[::2].sum() == pytest.approx(drive, rel=0.02, abs=0.02 * parameters.force)
    assert touching.normal.min() > -1e-6 * parameters.force
    bound = FRICTION * touching.normal
    assert (abs(touching.tangential) <= bound + 1e-6 * parameters.force).all()
    slides = touching.status > STICK
    np.testing.assert_allclose(abs(touching.tangential[slides]), bound[slides], atol=1e-3)


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_the_derivative_of_the_contact_is_that_of_differences(share):
    _, place, material, load = wheel(share=share)
    (one,) = rolling(place, material, load, [1])
    u, change = (
        place.operator.solve(place.rows.force(*strains))
        for strains in (
            (one.plastic_strain, one.after.plastic_strain),
            (one.plastic_strain**2 * 50, one.after.plastic_strain**2 * 50),
        )
    )
    step = 1e-4
    here = load.on(u, one.before)
    after, before = (load.on(u + sign * step * change, one.before, here).u for sign in (1, -1))
    differences = (after - before) / (2 * step) - change
    exact = here.along(change) - change
    # as forces on the surface, which make these displacements
    forces = [np.linalg.solve(place.compliance, d[place.at_surface]) for d in (exact, differences)]
    level = 1e-9 * abs(exact).max()
    rounding = 4 * np.finfo(float).eps * abs(after).max() / step  # of the differences
    each = zip(forces, (exact, differences), (level, level + rounding), strict=True)
    for made, displacements, most in each:
        np.testing.assert_allclose(place.under(made), displacements, atol=most)
    exact, differences = forces
    # but for the turning of the normals
    assert np.linalg.norm(exact - differences) < 0.1 * np.linalg.norm(differences)


def test_passes_of_a_wheel_shake_down_below_the_limit_and_ratchet_above():
    below, above = (list(rolling(*wheel(pressure=p)[1:], [1] * 12))[-1] for p in (3.8, 4.4))
    grown = [
        (e.after.accumulated - e.before.accumulated).max() / (YIELD / 2e5) for e in (below, above)
    ]
    assert grown[0] < 2e-3
    assert grown[1] > 0.05


# -- more shear than the material bears ------------------------------------------------------------


def locked(pressure, friction, size):
    """The first pass of a locked wheel, coarsely, without hardening."""
    _, place, material, load = wheel(pressure=pressure, size=size, friction=friction, creepage=1.0)
    return next(iter(rolling(place, material, load, [1]))), material, place


@pytest.mark.long
def test_a_locked_wheel_flattens_its_contact_until_the_surface_bears_the_shear():
    found, material, place = locked(2.3, 0.5, 2.0)  # 1.15 times what the surface bears
    touching = found.loading
    assert touching.tangential.sum() == pytest.approx(-0.5 * touching.normal.sum(), rel=1e-9)
    assert not audit_pass(place, material, found, None, 1).violations
    assert found.most_added > 0.05  # far beyond what elastic strains would make


def test_without_hardening_a_locked_wheel_has_its_limit():
    with pytest.raises(LimitLoad, match="a steady pass adds more than 30%"):
        locked(4.3, 0.5, 4.0)


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_a_lighter_load_is_one_of_less_force(share):
    parameters, place, _, load = wheel(share=share)
    nothing = np.zeros(len(place.operator.kept))
    touching = load.changed(load=load.load.scaled(0.8)).on(nothing, None)
    whole = load.on(nothing, None)
    # normals are tilted by up to a / R = 0.03, a little more under more force
    one, other = (t.normal.sum() / parameters.force for t in (touching, whole))
    assert (one, other) == (pytest.approx(0.8, rel=1e-3), pytest.approx(1.0, rel=1e-3))
    drive = share * FRICTION * parameters.force
    assert -touching.tangential.sum() == pytest.approx(0.8 * drive, abs=1e-3 * parameters.force)
    given = place.hertz(500.0, 0.1)
    lighter = given.changed(load=given.load.scaled(0.8))
    np.testing.assert_allclose(lighter.on(nothing, None).u, 0.8 * given.u, rtol=1e-12)
