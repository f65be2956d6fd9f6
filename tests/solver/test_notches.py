"""Lines that grow from several points, and cells taken out of a mesh."""

from __future__ import annotations

import math

import numpy as np
import pytest

from solver import Body, Material, Model, ModelError, solve
from solver.mesh import graded, grid, refined, without

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3)


def test_lines_grow_from_every_point_and_meet():
    lines = refined([0.0, 25.0, 50.0], [0.1, 0.5, 0.006], 1.3, [1.0, 1.0])
    sides = np.diff(lines)
    assert {0.0, 25.0, 50.0} <= set(lines)
    at = int(np.flatnonzero(lines == 25.0)[0])
    for side, most in ((sides[0], 0.1), (sides[at - 1], 0.5), (sides[at], 0.5), (sides[-1], 0.006)):
        assert 0.7 * most < side <= most
    # each half of a span is scaled to fill it: where two halves meet, by a little more than 1.3
    assert np.abs(np.log(sides[1:] / sides[:-1])).max() < np.log(1.6)
    assert sides.max() <= 1.0


@pytest.mark.parametrize(("sizes", "turned"), [((0.01, math.inf), False), ((math.inf, 0.01), True)])
def test_one_point_alone_gives_graded_lines(sizes, turned):
    lines = refined([0.0, 10.0], sizes, 1.4, [2.0])
    alone = graded(10.0, 0.01, 1.4, 2.0)
    assert np.array_equal(lines, 10.0 - alone[::-1] if turned else alone)


def test_neighbouring_sides_differ_by_the_ratio_or_a_factor_of_two():
    """Also where the two gradings meet within rounding of a point, or close to it."""
    rng = np.random.default_rng(1917)
    offsets = [0.0, 1e-16, -1e-16, 1e-12, 1e-6, 1e-3, 0.1, 1.0]
    cases = [(5.0, (2.0, 0.5), 1.3, math.inf)]  # (5 + (0.5 - 2) / 0.3) / 2 = 4e-16
    for _ in range(500):
        sizes, ratio = 10 ** rng.uniform(-1, 1, 2), rng.uniform(1.05, 2)
        length = np.ptp(sizes) / (ratio - 1) * (1 + rng.choice(offsets))
        cases.append(
            (length, tuple(sizes), ratio, rng.choice([math.inf, 10 ** rng.uniform(-1, 1)]))
        )
    for length, sizes, ratio, most in cases:
        sides = np.diff(refined([0.0, length], sizes, ratio, [most]))
        assert sides.sum() == pytest.approx(length)
        assert (sides[[0, -1]] <= np.minimum(sizes, most) * (1 + 1e-9)).all()
        assert np.abs(np.log(sides[1:] / sides[:-1])).max(initial=0.0) < np.log(2) + 1e-9


def test_lines_that_do_not_grow_are_refused():
    with pytest.raises(ModelError, match="ratio"):
        refined([0.0, 1.0], [0.1, 0.1], 1.0, [1.0])


def plate(cells="quad"):
    return grid(np.linspace(0, 4, 9), np.linspace(0, 3, 7), cells)


def lengths(mesh):
    """Length of each boundary."""
    ends = {name: mesh.p[:, mesh.facets[:, which]] for name, which in mesh.boundaries.items()}
    return {name: float(np.hypot(*(x[:, 1] - x[:, 0])).sum()) for name, x in ends.items()}


@pytest.mark.parametrize("cells", ["quad", "tri"])
def test_a_notch_opens_the_side_it_is_cut_from(cells):
    cut = without(plate(cells), "groove", (2.0, 9.0), (1.0, 2.0))
    expected = {"left": 3.0, "right": 2.0, "bottom": 4.0, "top": 4.0, "groove": 5.0}
    assert lengths(cut) == pytest.approx(expected)
    assert cut.nelements == 40 * plate(cells).nelements // 48
    x, y = cut.p[:, cut.facets[:, cut.boundaries["groove"]]].mean(axis=1)
    assert ((x >= 2.0) & (y >= 1.0) & (y <= 2.0)).all()


def test_a_hole_has_a_boundary_of_its_own_and_leaves_the_others():
    before = plate()
    cut = without(before, "hole", (1.0, 2.0), (1.0, 2.5))
    assert lengths(cut) == pytest.approx(lengths(before) | {"hole": 5.0})
    outside = np.unique(np.concatenate(list(cut.boundaries.values())))
    assert np.array_equal(outside, cut.boundary_facets())


def test_a_second_groove_keeps_the_first():
    cut = without(plate(), "one", (0.0, 1.0), (1.0, 2.0))
    both = lengths(without(cut, "other", (3.0, 4.0), (1.0, 2.0)))
    assert (both["one"], both["other"], both["left"]) == pytest.approx((3.0, 3.0, 2.0))


@pytest.mark.parametrize(
    ("x", "y", "why"),
    [
        ((1.0, 2.2), (1.0, 2.0), "along lines"),
        ((5.0, 6.0), (1.0, 2.0), "hold some cells"),
        ((-1.0, 9.0), (-1.0, 9.0), "leave some"),
    ],
)
def test_a_rectangle_that_does_not_fit_is_refused(x, y, why):
    with pytest.raises(ModelError, match=why):
        without(plate(), "groove", x, y)


@pytest.mark.solves
def test_a_notched_bar_carries_the_stress_of_what_is_left():
    """Two notches, one on either side: far inside the neck the force is that of the ends."""
    mesh = without(plate(), "one", (1.5, 2.5), (2.0, 3.0))
    mesh = without(mesh, "other", (1.5, 2.5), (0.0, 1.0))
    body = Body(
        name="bar",
        mesh=mesh,
        material=STEEL,
        supports={"left": "x", "bottom": "y"},
        pressure={"right": 30.0},
    )
    found = solve(Model(bodies=(body,)))
    points = found.system.positions("bar")
    stress = found.system.state("bar", found.loaded).stress[0]
    neck = (points[0] > 2.0) & (points[0] < 2.5)
    volumes = found.system.full("bar").volumes
    mean = (stress * volumes)[neck].sum() / volumes[neck].sum()
    assert mean == pytest.approx(-90.0, rel=1e-6)
