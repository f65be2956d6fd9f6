"""Hertz's ball by quadrature, and the fits against their own limits, joints and each other."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
import pytest
from scipy.integrate import quad

from tests.reference.flattening import (
    HertzBall,
    PlasticBall,
    axis_stress,
    first_yield,
    jackson_green_hardness,
    kogut_etsion_ratios,
)

NU = 0.3
BALL = PlasticBall(radius=5.0, youngs_modulus=2e5, poisson_ratio=NU, yield_stress=410.0)


def pressure(r: float) -> float:
    return sqrt(1 - r**2)


@pytest.mark.parametrize("depth", [0.1, 0.48, 1.0, 3.0])
@pytest.mark.parametrize("poisson_ratio", [0.0, 0.3, 0.5])
def test_axis_stress_is_the_sum_of_point_forces(depth: float, poisson_ratio: float) -> None:
    # Boussinesq's stresses below a point force, with the plane's two horizontal ones averaged
    # (Johnson, 3.19)
    def axial(r: float) -> float:
        return -3 * depth**3 / np.hypot(r, depth) ** 5 * pressure(r) * r

    def radial(r: float) -> float:
        rho = np.hypot(r, depth)
        sum_ = (1 - 2 * poisson_ratio) * depth / rho**3 - 3 * depth * r**2 / rho**5
        return sum_ / 2 * pressure(r) * r

    expected = [quad(f, 0, 1, epsabs=1e-11)[0] for f in (radial, axial)]
    assert axis_stress(np.array(depth), poisson_ratio) == pytest.approx(expected, abs=1e-8)


def test_hertz_ball_carries_its_force_and_comes_as_near_as_it_must() -> None:
    ball = HertzBall(interference=0.01, radius=5.0, modulus=2.2e5)
    a, p0 = ball.contact_radius, ball.peak_pressure
    assert ball.force == pytest.approx(2 / 3 * p0 * pi * a**2, rel=1e-12)
    # u(0) = (2 / E*) int p dr
    middle = 2 / ball.modulus * p0 * a * quad(pressure, 0, 1)[0]
    assert middle == pytest.approx(ball.interference, rel=1e-8)


@pytest.mark.parametrize("nu", [0.1, 0.2, 0.3, 0.4, 0.5])
def test_yielding_begins_as_deep_and_as_late_as_published(nu: float) -> None:
    # I. Green, Int. J. Appl. Mech. Eng. 10 (2005) 451-462: fits of the same maximum
    expected = 1.30075 + 0.87825 * nu + 0.54373 * nu**2, 0.38167 + 0.33136 * nu
    assert first_yield(nu) == pytest.approx(expected, rel=2e-3)


def test_yielding_of_steel_begins_half_a_radius_deep() -> None:
    # Johnson, 6.9: p0 = 1.60 yield stresses, 0.48 a deep, at nu = 0.3
    assert first_yield(0.3) == pytest.approx((1.6128, 0.4809), abs=1e-4)


@pytest.mark.parametrize("poisson_ratio", [0.2, 0.25, 0.3, 0.35, 0.4])
def test_both_fits_let_yielding_begin_where_it_does(poisson_ratio: float) -> None:
    ball = PlasticBall(
        radius=5.0, youngs_modulus=2e5, poisson_ratio=poisson_ratio, yield_stress=410.0
    )
    exact = ball.yielding().peak_pressure
    assert exact == pytest.approx(410 * first_yield(poisson_ratio)[0], rel=1e-12)
    assert ball.kogut_etsion_critical().peak_pressure == pytest.approx(exact, rel=0.01)
    assert ball.jackson_green_critical().peak_pressure == pytest.approx(exact, rel=0.01)


def test_yielding_begins_at_a_mean_pressure_of_eleven_tenths() -> None:
    start = BALL.yielding()
    mean = start.force / (pi * start.contact_radius**2)
    assert mean / BALL.yield_stress == pytest.approx(1.1, abs=0.03)


def test_kogut_and_etsion_agree_with_their_own_mean_pressure() -> None:
    # their third formula: p / Re = 1.19 w^0.289 up to 6, 1.61 w^0.117 beyond
    critical = BALL.kogut_etsion_critical()
    for w, mean in ((1.0001, 1.19), (3, 1.19 * 3**0.289), (20, 1.61 * 20**0.117)):
        force, area = BALL.kogut_etsion(w * critical.interference)
        assert force / area / BALL.yield_stress == pytest.approx(mean, rel=6e-3)


def test_kogut_and_etsion_end_at_full_plasticity() -> None:
    critical = BALL.kogut_etsion_critical()
    force, area = BALL.kogut_etsion(110 * critical.interference)
    assert force / area == pytest.approx(2.8 * BALL.yield_stress, rel=0.01)
    with pytest.raises(ValueError, match="more than 110"):
        kogut_etsion_ratios(111)


def test_branches_of_kogut_and_etsion_nearly_meet() -> None:
    for joint, gap in ((1, 0.08), (6, 0.031)):
        below, above = kogut_etsion_ratios(joint), kogut_etsion_ratios(joint * (1 + 1e-9))
        assert above == pytest.approx(below, rel=gap)


def test_jackson_and_green_leave_hertz_with_hardly_a_jump() -> None:
    critical = BALL.jackson_green_critical().interference
    below, above = (BALL.jackson_green(critical * w) for w in (1.9, 1.9 * (1 + 1e-9)))
    assert above == pytest.approx(below, rel=5e-3)
    hertz = HertzBall(interference=critical, radius=5.0, modulus=BALL.modulus)
    assert BALL.jackson_green(critical) == pytest.approx(
        (hertz.force, pi * hertz.contact_radius**2), rel=1e-12
    )


def test_jackson_and_green_tend_to_their_hardness() -> None:
    critical = BALL.jackson_green_critical().interference
    force, area = BALL.jackson_green(800 * critical)
    contact_ratio = sqrt(area / pi) / BALL.radius
    assert force / area == pytest.approx(
        jackson_green_hardness(contact_ratio) * BALL.yield_stress, rel=0.05
    )
    assert jackson_green_hardness(1e-3) == pytest.approx(2.84)
    # the mean pressure on a flat end of a bar is its yield stress
    assert jackson_green_hardness(1.0) < 2.0


@pytest.mark.parametrize("ratio", [2, 5, 10, 30, 60, 100])
def test_the_two_fits_agree(ratio: float) -> None:
    interference = ratio * BALL.kogut_etsion_critical().interference
    one, other = BALL.kogut_etsion(interference), BALL.jackson_green(interference)
    assert one[0] == pytest.approx(other[0], rel=0.08)
    assert one[1] == pytest.approx(other[1], rel=0.15)
