"""The closed forms themselves: limits, equilibrium, one against another."""

from __future__ import annotations

from math import log, pi, sqrt

import numpy as np
import pytest

from tests.verification.closed_forms import (
    HertzLine,
    ThickCylinder,
    ThickSphere,
    corner_power,
    dundurs_lee_power,
    flat_punch_pressure,
    log_slope,
    plane_strain_modulus,
    prandtl_pressure,
)

SPHERE = ThickSphere(inner=1.0, outer=2.0, yield_stress=300.0, front=1.4)
CYLINDER = ThickCylinder(inner=1.0, outer=2.0, yield_stress=300.0, front=1.4)


def test_hertz_pressure_carries_the_force():
    hertz = HertzLine(force=500.0, radius=100.0, modulus=1e5)
    angle = np.linspace(-pi / 2, pi / 2, 2001)  # x = a sin(angle) removes the root
    x = hertz.half_width * np.sin(angle)
    force = np.trapezoid(hertz.pressure(x) * hertz.half_width * np.cos(angle), angle)
    assert force == pytest.approx(500.0, rel=1e-6)  # trapezoids: (pi/2000)^2


def test_hertz_half_width_matches_the_gap_of_its_own_displacements():
    """The slope of the surface under p0 sqrt(1 - x²/a²) is -2 p0 x / (E* a), the parabola's."""
    hertz = HertzLine(force=500.0, radius=100.0, modulus=1e5)
    slope = 2 * hertz.peak_pressure / (hertz.modulus * hertz.half_width)
    assert slope == pytest.approx(1 / hertz.radius, rel=1e-12)


def test_flat_punch_pressure_has_mean_one_and_the_square_root_singularity():
    angle = np.linspace(-pi / 2, pi / 2, 1001)[1:-1]
    x = 3.0 * np.sin(angle)
    smooth = flat_punch_pressure(x, 3.0) * 3.0 * np.cos(angle)  # constant: 6/pi
    assert smooth == pytest.approx(np.full_like(smooth, 6 / pi), rel=1e-9)
    r = np.geomspace(1e-6, 1e-5, 5)
    assert log_slope(r, flat_punch_pressure(3.0 - r, 3.0)) == pytest.approx(-0.5, abs=1e-5)


@pytest.mark.parametrize(("wall", "exponent"), [(SPHERE, 2), (CYLINDER, 1)])
@pytest.mark.parametrize("stage", ["loaded", "residual"])
def test_thick_walls_are_in_equilibrium(wall, exponent, stage):
    """d(r^n sigma_r)/dr = n r^(n-1) sigma_hoop, integrated over the wall."""
    r = np.concatenate([np.linspace(1.0, 1.4, 4001), np.linspace(1.4, 2.0, 4001)[1:]])
    radial, hoop = getattr(wall, stage)(r)
    resultant = np.trapezoid(exponent * r ** (exponent - 1) * hoop, r)
    ends = r[-1] ** exponent * radial[-1] - r[0] ** exponent * radial[0]
    assert resultant == pytest.approx(ends, abs=1e-4)  # one cell straddles the kink of hoop
    inner = {"loaded": -wall.pressure, "residual": 0.0}[stage]
    assert radial[0] == pytest.approx(inner, abs=1e-9)
    assert radial[-1] == pytest.approx(0.0, abs=1e-9)


def test_thick_sphere_yields_inside_the_front_only():
    radial, hoop = SPHERE.loaded(np.linspace(1.0, 2.0, 101))
    assert (hoop - radial <= 300.0 * (1 + 1e-12)).all()
    assert (hoop - radial)[:40] == pytest.approx(np.full(40, 300.0))
    assert (hoop - radial)[41:].max() < 300.0
    assert SPHERE.pressure < SPHERE.reverse_yield_pressure
    assert np.abs(np.subtract(*SPHERE.residual(np.linspace(1.0, 2.0, 101)))).max() < 300.0


def test_thick_walls_collapse_and_begin_to_yield_where_known():
    def sphere(front):
        return ThickSphere(inner=1.0, outer=2.0, yield_stress=300.0, front=front).pressure

    def cylinder(front):
        return ThickCylinder(inner=1.0, outer=2.0, yield_stress=300.0, front=front).pressure

    assert sphere(2.0) == pytest.approx(2 * 300 * log(2))
    assert sphere(1.0) == pytest.approx(2 / 3 * 300 * (1 - 1 / 8))
    assert cylinder(2.0) == pytest.approx(2 * 300 / sqrt(3) * log(2))
    assert cylinder(1.0) == pytest.approx(300 / sqrt(3) * (1 - 1 / 4))


def test_prandtl_pressure_in_tresca_terms():
    assert prandtl_pressure(sqrt(3)) == pytest.approx(5.14159, abs=1e-5)


def test_plane_strain_modulus_stiffens():
    assert plane_strain_modulus(2e5, 0.0) == 2e5
    assert plane_strain_modulus(2e5, 0.3) == pytest.approx(219780.2, abs=0.1)


@pytest.mark.parametrize("poisson_ratio", [0.0, 0.3, 0.49])
def test_frictionless_corner_power_is_dundurs_and_lee(poisson_ratio):
    """Two derivations of the same power; for equal materials it does not depend on Poisson."""
    assert dundurs_lee_power() == pytest.approx(0.7740, abs=5e-5)
    assert corner_power(0.0, poisson_ratio) == pytest.approx(dundurs_lee_power(), abs=1e-9)


def test_outward_slip_strengthens_the_corner_singularity():
    powers = [corner_power(friction) for friction in (0.0, 0.1, 0.2, 0.3, 0.4)]
    assert (np.diff(powers) < -0.01).all()
