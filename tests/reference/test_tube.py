"""Tubes, press fits and heated bars against the equations that they must satisfy."""

from __future__ import annotations

from math import log

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.reference.bar import ConstrainedBar
from tests.reference.tube import Ends, PressFit, Tube

Array = NDArray[np.float64]

E, NU, EXPANSION = 2e5, 0.3, 1.2e-5
A, B = 10.0, 25.0
R = np.linspace(A, B, 16)
STEP = 1e-4
ENDS: tuple[Ends, ...] = ("fixed", "free")


def tube(ends: Ends, inner: float = A, outer: float = B) -> Tube:
    return Tube(inner=inner, outer=outer, youngs_modulus=E, poisson_ratio=NU, ends=ends)


def slope(values: Array, r: Array) -> Array:
    """Central difference of values at r - STEP and r + STEP, side by side."""
    low, high = np.split(values, 2, axis=-1)
    return (high - low) / (2 * STEP)


def assert_balanced(stress: Array, pair: Array) -> None:
    """Assert d(radial)/dr = (hoop - radial) / r."""
    assert slope(pair[0], R) == pytest.approx((stress[1] - stress[0]) / R, rel=1e-6, abs=1e-6)


def assert_compatible(stress: Array, pair: Array, warm: Array, warm_pair: Array) -> None:
    """Assert that radial strain is the slope of the displacement, r times hoop strain."""
    r_pair = np.r_[R - STEP, R + STEP]
    hoop = (pair[1] - NU * (pair[0] + pair[2])) / E + EXPANSION * warm_pair
    radial = (stress[0] - NU * (stress[1] + stress[2])) / E + EXPANSION * warm
    assert slope(r_pair * hoop, R) == pytest.approx(radial, rel=1e-6, abs=1e-10)


def axial_force(stress: Array, r: Array) -> float:
    return float(np.trapezoid(stress[2] * r, r))


@pytest.mark.parametrize("ends", ENDS)
def test_pressed_tube_is_balanced_and_compatible(ends: Ends) -> None:
    wall, pair = tube(ends), np.r_[R - STEP, R + STEP]
    stress, near = wall.pressed(R, 80.0, 30.0), wall.pressed(pair, 80.0, 30.0)
    assert (stress[0, 0], stress[0, -1]) == pytest.approx((-80.0, -30.0))
    assert_balanced(stress, near)
    assert_compatible(stress, near, 0 * R, 0 * pair)
    strain = (stress[2] - NU * (stress[0] + stress[1])) / E
    assert np.ptp(strain) < 1e-15  # cross sections stay plane
    assert ends == "free" or strain == pytest.approx(0.0, abs=1e-15)


def test_thin_tube_is_a_ring_and_a_shaft_is_pressed_evenly() -> None:
    ring = tube("free", 100.0, 100.1)
    assert ring.pressed(np.array(100.05), inside=1.0)[1] == pytest.approx(1000.5, rel=1e-3)
    shaft = tube("free", 0.0).pressed(np.array([0.0, 5.0]), outside=7.0)
    assert shaft[:2] == pytest.approx(-7.0)


@pytest.mark.parametrize("ends", ENDS)
def test_heated_tube_is_free_of_load_balanced_and_compatible(ends: Ends) -> None:
    wall, pair = tube(ends), np.r_[R - STEP, R + STEP]
    stress, near = (wall.heated(r, 150.0, 20.0, EXPANSION) for r in (R, pair))
    assert (stress[0, 0], stress[0, -1]) == pytest.approx((0.0, 0.0), abs=1e-11)
    assert_balanced(stress, near)
    warm, warm_near = (wall.temperature(r, 150.0, 20.0) for r in (R, pair))
    assert (warm[0], warm[-1]) == pytest.approx((150.0, 20.0))
    assert R * slope(warm_near, R) == pytest.approx(-130 / log(B / A), rel=1e-6)  # steady
    assert_compatible(stress, near, warm, warm_near)
    strain = (stress[2] - NU * (stress[0] + stress[1])) / E + EXPANSION * warm
    assert np.ptp(strain) < 1e-14
    if ends == "fixed":
        assert strain == pytest.approx(0.0, abs=1e-14)
    else:
        r = np.linspace(A, B, 20001)
        force = axial_force(wall.heated(r, 150.0, 20.0, EXPANSION), r)
        assert abs(force) < 1e-6 * abs(stress[2, 0]) * B**2


def test_thin_heated_tube_bends_as_a_plate() -> None:
    # E alpha dT / (2 (1 - nu)) at the faces of a wall that cannot bend (Timoshenko, 135)
    wall = tube("free", 1000.0, 1001.0)
    faces = wall.heated(np.array([1000.0, 1001.0]), 50.0, 0.0, EXPANSION)[1]
    level = E * EXPANSION * 50 / (2 * (1 - NU))
    assert faces == pytest.approx([-level, level], rel=1e-3)


@pytest.mark.parametrize("ends", ENDS)
@pytest.mark.parametrize("bore", [0.0, 4.0])
def test_press_fit_takes_up_its_interference(ends: Ends, bore: float) -> None:
    shaft = Tube(inner=bore, outer=A, youngs_modulus=1e5, poisson_ratio=0.25, ends=ends)
    fit = PressFit(shaft=shaft, hub=tube(ends), interference=0.02)
    gap = fit.hub.widening(A, inside=fit.pressure) - shaft.widening(A, outside=fit.pressure)
    assert gap == pytest.approx(0.02, rel=1e-12)
    at = np.array([A])
    assert fit.shaft_stress(at)[0] == pytest.approx(-fit.pressure)
    assert fit.hub_stress(at)[0] == pytest.approx(-fit.pressure)


@pytest.mark.parametrize(("ends", "modulus"), [("free", E), ("fixed", E / (1 - NU**2))])
def test_press_fit_of_one_material_is_lames(ends: Ends, modulus: float) -> None:
    c, b, a = B, A, 4.0
    fit = PressFit(shaft=tube(ends, a, b), hub=tube(ends, b, c), interference=0.02)
    shape = (b**2 - a**2) * (c**2 - b**2) / (2 * b**2 * (c**2 - a**2))
    assert fit.pressure == pytest.approx(modulus * 0.02 / b * shape, rel=1e-12)


def bar(tangent_modulus: float = 0.0, share: float = 1.0) -> ConstrainedBar:
    return ConstrainedBar(
        youngs_modulus=E,
        expansion=EXPANSION,
        yield_stress=300.0,
        tangent_modulus=tangent_modulus,
        kinematic_share=share,
    )


def test_perfectly_plastic_bar_keeps_tension_after_heating() -> None:
    T = bar().yield_temperature
    assert bar().stresses([T, 1.5 * T, 0.0]) == pytest.approx([-300, -300, 150])
    assert bar().stresses([3 * T, 0.0]) == pytest.approx([-300, 300])


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_hardening_bar_follows_its_curve_of_tension(share: float) -> None:
    hot = bar(4800.0, share)
    T = hot.yield_temperature
    top = -300 - 4800 * EXPANSION * 3 * T
    elastic_range = 600 + (1 - share) * 2 * (-top - 300)
    turn = top + elastic_range
    end = turn + (4 * T - elastic_range / (E * EXPANSION)) * 4800 * EXPANSION
    assert hot.stresses([4 * T, 0.0]) == pytest.approx([top, end])


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_stress_of_a_bar_does_not_depend_on_steps(share: float) -> None:
    hot, T = bar(4800.0, share), 1000.0
    fine = np.r_[np.linspace(0, T, 78), np.linspace(T, -T / 3, 99)]
    assert hot.stresses(fine)[-1] == pytest.approx(hot.stresses([T, -T / 3])[-1])


def test_kinematic_bar_cycles_and_isotropic_bar_shakes_down() -> None:
    T = 4 * bar().yield_temperature
    kinematic = bar(4800.0, 1.0).stresses([T, 0.0] * 30)
    assert kinematic[2:4] == pytest.approx(kinematic[-2:])
    isotropic = bar(4800.0, 0.0).stresses([T, 0.0] * 300)
    assert np.ptp(isotropic[:2]) < 0.6 * E * EXPANSION * T
    assert np.ptp(isotropic[-2:]) == pytest.approx(E * EXPANSION * T, rel=1e-3)  # elastic
