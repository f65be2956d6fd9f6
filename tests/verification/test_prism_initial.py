"""Stress in a prism before the first pass, and by heat: against closed forms, and by passes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.errors import ModelError
from solver.linear.solvers import one_thread
from solver.mesh import grid
from solver.rolling.audit.rail import audit_prism
from solver.rolling.passing import passing
from solver.rolling.rail.profiles.rail import rail_60e1
from solver.rolling.rail.profiles.zone import Zone, rail_mesh
from solver.rolling.rail.section import Section
from solver.rolling.rail.straight import StraightPrism, straight_motions
from solver.rolling.scenes.initial_stress import NoStress, OverHeight, RollerStraightened
from solver.rolling.scenes.wheel_rail import WheelRailParameters
from solver.rolling.scenes.wheel_rail_track import settled
from tests.verification.prism_blocks import PERFECT, RE, block, ellipse, residual, stressed
from tests.verification.stepped_prism import SteppedPrism

Array = NDArray[np.float64]
HEIGHT, WIDTH, E, NU = 60.0, 30.0, 2e5, 0.3
SPRINGS = {"bottom": (0.01, 0.01, 0.01)}


def bar() -> Section:
    """A bar of rectangular section on soft springs."""
    z, y = np.linspace(-WIDTH / 2, WIDTH / 2, 7), np.linspace(-HEIGHT, 0.0, 13)
    return Section(grid(z, y), PERFECT.elasticity, springs=SPRINGS)


def stress_of(section: Section, **components: Array | float) -> Array:
    """Stress (n, 6) with some components, Mandel [MPa]."""
    stress = np.zeros((section.weights.size, 6))
    for name, value in components.items():
        stress[:, ("xx", "yy", "zz", "xy", "yz", "zx").index(name)] = value
    return stress


def test_of_a_given_stress_along_x_force_and_moments_go() -> None:
    """What is left of (y/c)^2 + y/c + z/b + 1 on a rectangle is (y/c)^2 - 1/3."""
    section = bar()
    z, y = section.points.reshape(2, -1)
    high, wide = (y + HEIGHT / 2) / (HEIGHT / 2), z / (WIDTH / 2)
    given = stress_of(section, xx=100.0 * (high**2 + high + wide + 1.0))
    found = StraightPrism(section).settled(given, np.zeros_like(given))
    wanted = stress_of(section, xx=100.0 * (high**2 - 1 / 3))
    # soft springs and straight edges between 2 x 2 points leave less than 0.1 MPa
    np.testing.assert_allclose(found.stress, wanted, atol=0.1)
    assert found.change == pytest.approx(np.abs(given - wanted).max(), abs=0.1)


def test_of_the_stress_of_a_longer_bent_or_turned_prism_nothing_is_left() -> None:
    section = bar()
    straight, C = StraightPrism(section), PERFECT.stiffness(6)
    for k in range(4):
        given = straight_motions(section.points.reshape(2, -1))[..., k] @ C
        left = straight.settled(given, np.zeros_like(given)).stress
        assert np.abs(left).max() < 1e-9 * np.abs(given).max()


def test_heat_in_a_prism_held_along_x_presses_it_along_x_only() -> None:
    """sigma_xx is -E times the thermal strain."""
    section, thermal = bar(), 1.2e-5 * 40
    held = stress_of(section, **dict.fromkeys(("xx", "yy", "zz"), -E * thermal / (1 - 2 * NU)))
    found = StraightPrism(section).settled(np.zeros_like(held), held)
    np.testing.assert_allclose(found.stress, stress_of(section, xx=-E * thermal), atol=0.1)


def test_a_pass_over_initial_stress_is_the_second_pass_over_plastic_strain() -> None:
    """Without hardening the state after a pass is its residual stress, and nothing else."""
    track = block()
    load = ellipse(track, 1360.0)
    with one_thread():
        first = passing(track, PERFECT, load, track.virgin(PERFECT))
        second = passing(track, PERFECT, load, first.after)
        held = np.zeros((track.section.weights.size, 6))
        stiff = 2 * PERFECT.elasticity.shear_modulus
        held[track.modes.points] = -stiff * first.after.plastic_strain
        after = track.stressed(track.straight.settled(np.zeros_like(held), held))
        virgin = after.virgin(PERFECT)
        np.testing.assert_allclose(
            residual(PERFECT, virgin), residual(PERFECT, first.after), atol=1e-6 * RE
        )
        found = passing(after, PERFECT, load, virgin)
    stresses = [residual(PERFECT, each.after) for each in (second, found)]
    np.testing.assert_allclose(*stresses, atol=2e-4 * RE)
    assert found.after.accumulated.max() > 5e-4
    audit = audit_prism(after, PERFECT, found, None)
    assert audit.passed, audit.violations


def test_an_initial_stress_that_is_not_in_equilibrium_breaks_the_audit() -> None:
    track = block()
    given = stress_of(track.section, yy=50.0 * np.sin(track.section.points[1].ravel()))
    found = track.stressed(track.straight.settled(given, np.zeros_like(given)))
    assert found.initial is not None
    found.initial.strain[:] = given @ np.linalg.inv(PERFECT.stiffness(6))
    with one_thread():
        left = passing(found, PERFECT, ellipse(found, 1360.0), found.virgin(PERFECT))
    names = [each.split(" = ")[0] for each in audit_prism(found, PERFECT, left, None).violations]
    assert names == ["audit_history"]


def test_residual_stress_beyond_yield_outside_the_zone_breaks_the_audit() -> None:
    track = block()
    nothing = np.zeros((track.section.weights.size, 6))
    found = track.stressed(track.straight.settled(nothing, nothing))
    with one_thread():
        left = passing(found, PERFECT, ellipse(found, 1360.0), found.virgin(PERFECT))
    assert found.initial is not None
    outside = np.setdiff1d(np.arange(len(nothing)), track.modes.points)[:1]
    found.initial.strain[outside, 0] = 2 * RE / E
    told = dict(each.split(" = ") for each in audit_prism(found, PERFECT, left, None).violations)
    assert told.keys() == {"audit_history", "audit_yield"}
    assert float(told["audit_yield"].split()[0]) > 0.1


def test_a_stress_beyond_yield_is_refused() -> None:
    track = block()
    stress = OverHeight(stress_over_height=((-10.0, -100.0), (0.0, 700.0)))
    high = stressed(track, stress)
    told = (
        r"initial_stress = '60\d.* MPa at z = .*, y = -0\.\d+ mm': must be below the yield "
        "stress of 502 MPa before the first pass"
    )
    for body in (high.virgin, lambda law: SteppedPrism(high, law).virgin):
        with pytest.raises(ModelError, match=told):
            body(PERFECT)


# -- a rail ---------------------------------------------------------------------------------------


def rail() -> Section:
    """A coarse 60E1."""
    mesh = rail_mesh(rail_60e1(), Zone(at=0.0, half_width=12.0, depth=8.0, size=4.0))
    return Section(mesh, PERFECT.elasticity, springs={"foot": (0.14, 0.14, 0.14)})


def test_straightening_leaves_tension_in_head_and_foot_and_compression_in_the_web() -> None:
    section = rail()
    points, area = section.points.reshape(2, -1), section.weights.ravel()
    stress = RollerStraightened(straightening_stress=180.0).stress(points, area)
    z, y = points
    for arm in (1.0, y, z):
        assert abs((stress[0] * arm * area).sum()) < 1e-9 * (np.abs(stress[0] * arm) * area).sum()
    top, web = stress[0, y.argmax()], stress[0, np.abs(y + 90).argmin()]
    assert top == pytest.approx(180.0, abs=8.0)  # at a point 1 mm below the top
    assert -200.0 < web < -50.0
    # EN 13674-1 permits 250 MPa in the foot
    assert 100.0 < stress[0, y.argmin()] < 250.0
    assert not stress[1:].any()


@pytest.mark.parametrize(
    "table", [(), ((0.0, 1.0), (-10.0, 2.0)), ((0.0, 1.0), (0.0, 2.0)), ((0.0, float("nan")),)]
)
def test_a_table_that_does_not_rise_is_refused(table: Any) -> None:
    with pytest.raises(ModelError, match="stress_over_height"):
        WheelRailParameters(initial_stress="over_height", stress_over_height=table)


def test_without_stress_there_is_none_to_settle() -> None:
    assert settled(block().section, NoStress(), 0.0) is None
