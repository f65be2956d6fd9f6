"""Profiles of wheels: S1002 of EN 13715, cones, crowned cylinders, measured ones."""

from __future__ import annotations

import math

import numpy as np
import pytest

from solver import ModelError
from solver.rolling.rail.profiles.points import read_points
from solver.rolling.rail.profiles.rail import rail_60e1
from solver.rolling.rail.profiles.wheel_profile import conical, crowned, measured, s1002

PROFILE = s1002()
PROFILES = {
    "s1002": PROFILE,
    "cone": conical(1 / 40),
    "crown": crowned(300.0),
    "measured": measured(np.stack([np.linspace(-40, 40, 41), np.linspace(-40, 40, 41) ** 2 / 600])),
}


def at(function, *z):
    return function(np.array(z, dtype=float))


def test_pieces_of_s1002_meet_in_height_slope_and_on_the_tread_curvature():
    """The coefficients of the standard have ten digits; zone C loses four of them."""
    inner = np.array(PROFILE.bounds[1:-1])
    for z, one, other in zip(inner, PROFILE.pieces[:-1], PROFILE.pieces[1:], strict=True):
        height, slope = (abs(one(z, order) - other(z, order)) for order in (0, 1))
        assert height < 2e-4
        assert slope < 1e-5
    for z in (-35.0, -26.0):
        one, other = (PROFILE.curvature(np.array(z + side)) for side in (-1e-9, 1e-9))
        assert other == pytest.approx(one, abs=1e-5)


def test_s1002_has_its_published_dimensions():
    """Flange 28 mm high, 10 mm below the running circle 32.5 thick; qR; tread 1/15 outside."""
    assert at(PROFILE.height, 0.0) == 0.0
    z = np.linspace(-70, 60, 13_001)
    assert PROFILE.height(z).min() == pytest.approx(-28.0, abs=1e-6)
    assert z[PROFILE.height(z).argmin()] == pytest.approx(-55.0, abs=0.01)
    face = np.interp(-10.0, PROFILE.height(z)[(z > -50)], z[z > -50])
    assert face + 70 == pytest.approx(32.5, abs=0.01)
    upper = np.interp(-26.0, PROFILE.height(z)[(z > -55)], z[z > -55])
    assert face - upper == pytest.approx(10.8, abs=0.1)
    assert at(PROFILE.slope, 40.0, 59.0) == pytest.approx([1 / 15] * 2)


@pytest.mark.parametrize(("z", "radius"), [(-66, 20.5), (-57, 12), (-45, 20), (-36, -13)])
def test_arcs_of_the_flange_have_their_radii(z, radius):
    assert 1 / at(PROFILE.curvature, z)[0] == pytest.approx(radius)


@pytest.mark.parametrize("name", PROFILES)
def test_slope_and_curvature_are_derivatives_of_the_height(name):
    profile = PROFILES[name]
    z, h = np.linspace(profile.bounds[0] + 1, profile.bounds[-1] - 1, 400), 1e-3
    near = [profile.height(z + k * h) for k in (-1, 0, 1)]
    away = abs(z[:, None] - np.array(profile.bounds)).min(axis=1) > 2 * h
    slope, bend = (near[2] - near[0]) / (2 * h), (near[2] - 2 * near[1] + near[0]) / h**2
    assert profile.slope(z)[away] == pytest.approx(slope[away], abs=1e-4)
    curvature = bend / (1 + slope**2) ** 1.5
    assert profile.curvature(z)[away] == pytest.approx(curvature[away], abs=1e-4)


@pytest.mark.parametrize("name", PROFILES)
def test_there_is_no_wheel_beyond_the_ends(name):
    profile = PROFILES[name]
    first, last = profile.bounds[0], profile.bounds[-1]
    assert np.isinf(at(profile.height, first - 0.1, last + 0.1)).all()
    assert not at(profile.slope, first - 0.1, last + 0.1).any()
    assert np.isfinite(at(profile.height, first, last)).all()


def test_crowns_and_cones_are_their_closed_forms():
    z = np.linspace(-20, 20, 9)
    assert crowned(300.0).height(z) == pytest.approx(300 - np.sqrt(300**2 - z**2), abs=1e-12)
    assert crowned(300.0).curvature(z) == pytest.approx(np.full(9, 1 / 300))
    assert crowned(math.inf).height(z) == pytest.approx(np.zeros(9))
    assert conical(1 / 20).height(z) == pytest.approx(z / 20)
    assert crowned(10.0).bounds == (-9.0, 9.0)


def test_points_of_s1002_give_s1002(tmp_path):
    z = np.linspace(-30, 45, 301)
    file = tmp_path / "wheel.csv"
    file.write_text(
        "\n".join(f"{a:.9f}, {b:.9f}" for a, b in zip(z, PROFILE.height(z), strict=True))
    )
    same, z = measured(read_points(file)), np.linspace(-24, 30, 500)
    assert same.height(z) == pytest.approx(PROFILE.height(z), abs=1e-5)
    assert same.slope(z) == pytest.approx(PROFILE.slope(z), abs=1e-4)
    assert same.curvature(z) == pytest.approx(PROFILE.curvature(z), abs=1e-3)


@pytest.mark.parametrize(
    ("heading", "factor"), [("z y", 1), ("z [mm], y [mm]", 1), ("z[m] y[m]", 1e3)]
)
def test_the_heading_of_a_file_of_points_has_their_unit(tmp_path, heading, factor):
    file = tmp_path / "wheel.csv"
    file.write_text(f"{heading}\n-1, 0\n0, 0.5\n1, 0.5\n2, 0\n")
    assert read_points(file).tolist() == [
        [-factor, 0, factor, 2 * factor], [0, factor / 2, factor / 2, 0],
    ]  # fmt: skip
    for other in ("[feet]", "z [m], y [mm]"):
        file.write_text(file.read_text().replace(heading, other))
        with pytest.raises(ModelError, match="one unit in its heading, of mm, m, um, in"):
            read_points(file)
        file.write_text(file.read_text().replace(other, heading))


def test_a_centred_wheelset_touches_rails_canted_by_1_in_40_on_their_crown():
    """S1002 was made for them: running circles 1500 mm apart, gauge 1435 mm 14 mm below the top."""
    for slope, low, high in ((1 / 40, -2.0, 5.0), (1 / 20, 10.0, 12.0)):
        rail = rail_60e1().canted(slope)
        right, left = rail.running
        z, y = rail.outline.at(np.linspace(right, left, 20_001))
        inner = np.interp(-14.0, y[z < -30][::-1], z[z < -30][::-1])
        inside = 1435 / 2 - inner - 1500 / 2
        assert 2.5 < inside < 3.2  # of the axis of the rail
        gap = PROFILE.height(z + inside) - y
        assert low < z[gap.argmin()] < high


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: crowned(-1.0), "radius"),
        (lambda: conical(0.05, 0.0), "half_width"),
        (lambda: measured(np.zeros((2, 5))), "points"),
    ],
)
def test_bad_profiles_are_refused(make, field):
    with pytest.raises(ModelError, match=field):
        make()
