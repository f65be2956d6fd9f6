"""The section of the rail 60E1, against its standard: EN 13674-1:2011, annex A."""

from __future__ import annotations

import math

import numpy as np
import pytest

from solver import ModelError
from solver.rolling.rail.profiles.outline import Outline, RoundedCorner
from solver.rolling.rail.profiles.points import read_points
from solver.rolling.rail.profiles.rail import rail_60e1

RAIL = rail_60e1()
OUTLINE = RAIL.outline


def surface(z):
    """Points of the running surface at positions z."""
    s = [RAIL.place(each) for each in z]
    return OUTLINE.at(np.array(s))


def radius_at(section, z):
    s = section.place(z)
    return 1 / float(section.outline.curvature(np.array(s)))


def test_a_rounded_square_has_the_area_and_moments_of_its_closed_form():
    a, r = 6.0, 2.0
    corners = [(1, -1), (1, 1), (-1, 1), (-1, -1)]
    square = Outline.rounded([RoundedCorner((a / 2 * x, a / 2 * y), (r,)) for x, y in corners])
    sharp = Outline.rounded([RoundedCorner((a / 2 * x, a / 2 * y)) for x, y in corners])
    assert sharp.area == pytest.approx(a**2, rel=1e-14)
    missing = (4 - math.pi) * r**2
    assert square.area == pytest.approx(a**2 - missing, rel=1e-14)
    assert square.length == pytest.approx(4 * (a - 2 * r) + 2 * math.pi * r, rel=1e-14)
    # square less its corners, and quarter discs about their own centres, moved by Steiner's rule
    b, d = a / 2 - r, 4 * r / (3 * math.pi)
    discs = math.pi * r**4 / 4 + math.pi * r**2 * ((b + d) ** 2 - d**2)
    strips = a * (2 * b) ** 3 / 12 + 2 * (2 * b * r**3 / 12 + 2 * b * r * (b + r / 2) ** 2)
    assert square.second_moments == pytest.approx((strips + discs) * np.eye(2), abs=1e-11)


def test_area_and_second_moments_are_the_published_ones():
    """To the digits in which they are published; the centroid follows from the section moduli."""
    assert OUTLINE.area / 100 == pytest.approx(76.70, abs=0.005)
    across, up = np.diag(OUTLINE.second_moments) / 1e4
    assert up == pytest.approx(3038.3, abs=0.05)
    assert across == pytest.approx(512.3, abs=0.05)
    z, y = OUTLINE.at(np.linspace(0, OUTLINE.length, 20_001))
    cross = z[:-1] * y[1:] - z[1:] * y[:-1]
    head = -((y[:-1] + y[1:]) @ cross) / (3 * cross.sum())  # depth of the centroid below the top
    assert up / (head / 10) == pytest.approx(333.6, abs=0.05)
    assert up / ((172 - head) / 10) == pytest.approx(375.5, abs=0.05)


def test_the_section_has_its_main_dimensions():
    z, y = OUTLINE.at(np.linspace(0, OUTLINE.length, 20_001))
    assert (y.min(), y.max()) == pytest.approx((-172.0, 0.0), abs=1e-6)
    assert (z.min(), z.max()) == pytest.approx((-75.0, 75.0), abs=1e-6)
    assert z[(y < -80) & (y > -110)].max() == pytest.approx(8.25, abs=1e-12)
    assert surface([36.0])[1] == pytest.approx(-14.3, abs=0.01)


def test_the_outline_has_no_kinks_and_is_symmetric():
    ends = np.cumsum(OUTLINE.lengths)
    before, after = OUTLINE.direction(ends - 1e-9), OUTLINE.direction(ends + 1e-9)
    assert abs(before - after).max() < 1e-8
    s = np.linspace(0, OUTLINE.length, 1001)
    left, right = RAIL.places["heads"]
    mirrored = OUTLINE.at(left + right - s)
    assert OUTLINE.at(s) == pytest.approx(np.array([[-1.0], [1.0]]) * mirrored, abs=1e-9)


@pytest.mark.parametrize(
    ("z", "radius"), [(0.0, 300), (10.2, 300), (10.3, 80), (26.0, 80), (26.1, 13), (35.9, 13)]
)
def test_the_running_surface_has_its_radii(z, radius):
    for side in (-z, z):
        assert radius_at(RAIL, side) == pytest.approx(radius)


def test_the_crown_is_that_of_three_tangent_circles():
    z = np.array([0.0, 5.0, 20.0, 30.0])
    first, second = math.asin(10.228 / 300), math.asin((26.0265 - 220 * 10.228 / 300) / 80)
    centres = np.cumsum(
        [(0.0, -300.0)]
        + [(d * math.sin(t), d * math.cos(t)) for d, t in ((220, first), (67, second))],
        axis=0,
    )
    circle = centres[[0, 0, 1, 2]], np.array([300, 300, 80, 13])
    expected = circle[0][:, 1] + np.sqrt(circle[1] ** 2 - (z - circle[0][:, 0]) ** 2)
    assert surface(z)[1] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("slope", "centre"),
    [(1 / 40, (0, -300)), (-1 / 40, (0, -300)), (1 / 20, (7.500533, -80.127902))],
)
def test_a_canted_rail_touches_zero_above_the_centre_of_an_arc(slope, centre):
    canted = RAIL.canted(slope)
    assert canted.outline.area == pytest.approx(OUTLINE.area)
    highest = canted.outline.at(np.array(canted.outline.highest(canted.running)))
    z = (centre[0] - slope * centre[1]) / math.hypot(1, slope)
    assert highest == pytest.approx([z, 0.0], abs=1e-5)
    left, right = canted.outline.at(np.array(canted.places["soles"])).T
    assert (right - left)[1] / (right - left)[0] == pytest.approx(slope)


def test_points_of_the_new_surface_give_the_new_rail():
    z = 36 * np.sin(np.linspace(-1.5, 1.5, 400))
    same = RAIL.worn(surface(z))
    assert same.outline.area == pytest.approx(OUTLINE.area, abs=1.0)  # the sides are cut short
    for at, radius in ((2.0, 300), (-18.0, 80), (32.0, 13)):
        assert radius_at(same, at) == pytest.approx(radius, rel=0.01)
    for name, ends in RAIL.places.items():
        X, Y = (each.outline.at(np.array(ends)) for each in (RAIL, same))
        assert Y - X == pytest.approx(np.zeros((2, 2)), abs=1e-3), name


def test_a_worn_rail_loses_area_and_keeps_its_top_at_zero(tmp_path):
    z, y = surface(36 * np.sin(np.linspace(-1.5, 1.5, 100)))
    file = tmp_path / "worn.csv"
    lines = [f"{a:.6f},{b - 2.0:.6f}" for a, b in zip(z, y, strict=True)]
    file.write_text("z,y\n" + "\n".join(lines))
    worn = RAIL.worn(read_points(file))
    assert OUTLINE.area - worn.outline.area == pytest.approx(2.0 * 72, rel=0.1)
    z, y = worn.outline.at(np.linspace(0, worn.outline.length, 2001))
    assert y.max() == pytest.approx(0.0, abs=1e-3)
    assert y.min() == pytest.approx(-170.0, abs=1e-6)


@pytest.mark.parametrize(
    ("points", "said"),
    [
        (np.zeros((2, 3)), "at least 4 points"),
        (
            np.array([[0.0, 1.0, 1.0, 2.0], [0.0] * 4]),
            "whose z increases; these are number 1 and 2",
        ),
        (np.array([[0.0, 1.0, np.nan, 2.0], [0.0] * 4]), "finite"),
    ],
)
def test_points_that_are_no_curve_are_refused(points, said):
    with pytest.raises(ModelError, match=said):
        RAIL.worn(points)


@pytest.mark.parametrize("text", ["z,y\n1,2\n3\n", "0,0\n1,a\n"])
def test_a_file_with_a_bad_line_is_refused_by_its_number(tmp_path, text):
    file = tmp_path / "bad.csv"
    file.write_text(text)
    with pytest.raises(ModelError, match=r"line [23]"):
        read_points(file)
    with pytest.raises(ModelError, match="readable"):
        read_points(tmp_path / "none.csv")


def test_a_place_beside_the_head_is_refused():
    with pytest.raises(ModelError, match="at = 40"):
        RAIL.place(40.0)
