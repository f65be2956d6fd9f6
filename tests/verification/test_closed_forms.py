"""The closed forms themselves: limits, equilibrium, one against another."""

from __future__ import annotations

from math import log, pi, sqrt

import numpy as np
import pytest

from tests.verification.closed_forms import (
    HertzEllipse,
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


def test_stress_under_a_circle_is_hubers_on_the_axis():
    """K.L. Johnson, Contact Mechanics (1985), (3.45): closed forms on the axis."""
    circle, nu = HertzEllipse(a=2.0, b=2.0, peak_pressure=1.0), 0.3
    depth = np.array([0.4, 1.0, 3.0])
    zeta, on_axis = depth / 2.0, np.full(3, 1e-9)
    down = -1 / (1 + zeta**2)
    radial = -(1 + nu) * (1 - zeta * np.arctan(1 / zeta)) - down / 2
    xx, yy, zz, *shear = circle.stress(on_axis, depth, on_axis, nu)
    for found, exact in ((xx, radial), (zz, radial), (yy, down), (np.array(shear), 0.0)):
        assert found == pytest.approx(exact, abs=1e-6)


def test_stress_under_an_ellipse_is_in_equilibrium():
    """Central differences of step 0.01; their truncation is 1e-4 of the slopes."""
    ellipse, step = HertzEllipse(a=2.0, b=1.0, peak_pressure=1.0), 0.01
    place, root = np.array([0.7, 0.8, 0.3]), sqrt(2.0)

    def slope(axis):
        moved = place[:, None] + step * np.outer(np.eye(3)[axis], [1.0, -1.0])
        ahead, behind = ellipse.stress(*moved, 0.3).T
        return (ahead - behind) / (2 * step) * (-1.0 if axis == 1 else 1.0)  # y is up

    dx, dy, dz = (slope(axis) for axis in range(3))
    balance = [
        dx[0] + (dy[3] + dz[5]) / root,
        dy[1] + (dx[3] + dz[4]) / root,
        dz[2] + (dx[5] + dy[4]) / root,
    ]
    assert balance == pytest.approx([0.0] * 3, abs=1e-4)


def test_hertz_half_width_matches_the_gap_of_its_own_displacements():
    """The slope of the surface under p0 sqrt(1 - x²/a²) is -2 p0 x / (E* a), the parabola's."""
    hertz = HertzLine(force=500.0, radius=100.0, modulus=1e5)
    slope = 2 * hertz.peak_pressure / (hertz.modulus * hertz.half_width)
    assert slope == pytest.approx(1 / hertz.radius, rel=1e-12)


def test_hertz_stress_meets_the_surface_and_balances_inside():
    """No shear at the surface, and minus the pressure across it; div sigma = 0 by differences."""
    hertz = HertzLine(force=500.0, radius=100.0, modulus=1e5)
    a, p0 = hertz.half_width, hertz.peak_pressure
    x = a * np.array([0.0, 0.3, -0.7, 1.5, -3.0])
    xx, yy, xy = hertz.stress(x, np.full_like(x, 1e-9 * a))
    assert yy == pytest.approx(-hertz.pressure(x), abs=1e-8 * p0)
    assert xx == pytest.approx(yy, abs=1e-8 * p0)
    assert np.abs(xy).max() < 1e-8 * p0
    h, depth = 1e-4 * a, a * np.array([0.5, 0.2, 1.0, 2.0, 0.7])
    along = (hertz.stress(x + h, depth) - hertz.stress(x - h, depth)) / (2 * h)
    up = (hertz.stress(x, depth - h) - hertz.stress(x, depth + h)) / (2 * h)
    for balance in (along[0] + up[2], along[2] + up[1]):
        assert np.abs(balance).max() < 1e-6 * p0 / a  # differences: (h / a)^2


def test_hertz_shear_is_largest_below_the_middle():
    """0.300 p0 at 0.786 a (Johnson, section 4.2)."""
    hertz = HertzLine(force=500.0, radius=100.0, modulus=1e5)
    depth = hertz.half_width * np.linspace(0.01, 3.0, 3000)
    xx, yy, _ = hertz.stress(np.zeros_like(depth), depth)
    shear = (xx - yy) / 2
    assert shear.max() == pytest.approx(0.300 * hertz.peak_pressure, rel=2e-3)
    assert depth[shear.argmax()] == pytest.approx(0.786 * hertz.half_width, rel=2e-3)


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
