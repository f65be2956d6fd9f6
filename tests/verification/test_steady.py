"""Steady passes of a Hertz pressure, against closed forms and the law and forces of increments.

K.L. Johnson, Contact Mechanics (1985), sections 4.2 and 9.2: a line contact without friction yields
first at p0 = 3.10 k and shakes down up to p0 = 4 k.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest

from solver import LimitLoad, Material, ModelError, NotConverged
from solver.fem.operators import operators_of
from solver.materials import PlasticState
from solver.results.sliding_limits import melan_limit
from solver.rolling.plane.rolling import rolling
from solver.rolling.plane.rows import RowFlow
from solver.rolling.plane.track import track_of, under_load
from tests.verification.interleaved import InterleavedTrack

YIELD = 502.0
K = YIELD / sqrt(3)
A = 8.0


def steel(**hardening):
    return Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=YIELD, **hardening)


def passes(pressure, count, *, shear=0.0, size=2.0, directions=None, material=None):
    """Passes of p0 / k = ``pressure`` with half-width 8 mm."""
    material = material or steel()
    place = track_of(A, size, 1.15, material.elasticity)
    load = place.hertz(pressure * K, shear)
    return list(rolling(place, material, load, directions or [1] * count))


def flow(one):
    """Plastic strain a pass has accumulated, by depth, over the yield strain."""
    return (one.after.accumulated - one.before.accumulated) / (YIELD / 2e5)


def test_a_load_below_first_yield_leaves_nothing():
    (one,) = passes(3.05, 1)
    assert one.solves == 1
    assert not one.after.accumulated.any()
    assert not one.after.plastic_strain.any()


def test_yield_begins_where_the_closed_form_says():
    (one,) = passes(3.15, 1, size=0.5)
    assert 0.0 < flow(one).max() < 0.1
    depth = one.after.depth[one.after.accumulated.argmax()]
    assert depth == pytest.approx(0.70 * A, rel=0.06)


@pytest.mark.parametrize("shear", [0.0, 0.15])
def test_the_shakedown_limit_lies_between_two_loads(shear):
    limit = 4.0 if shear == 0 else melan_limit(shear, 0.3)
    below, above = (passes(share * limit, 25, shear=shear) for share in (0.97, 1.03))
    assert flow(below[-1]).max() < 1e-3
    assert flow(above[-1]).max() > 0.02
    net = abs(above[-1].after.plastic_strain - above[-1].before.plastic_strain).max()
    assert net > 0.1 * flow(above[-1]).max() * YIELD / 2e5, "it ratchets: the cycle stays open"


def test_kinematic_hardening_ends_in_a_closed_cycle():
    last = passes(4.7, 30, material=steel(hardening="kinematic", hardening_ratio=0.024))[-1]
    assert flow(last).max() > 0.1
    net = abs(last.after.plastic_strain - last.before.plastic_strain).max()
    assert net < 1e-3 * flow(last).max() * YIELD / 2e5


def test_isotropic_hardening_shakes_down():
    several = passes(4.7, 30, material=steel(hardening="isotropic", hardening_ratio=0.024))
    assert flow(several[0]).max() > 1.0
    assert flow(several[-1]).max() < 1e-2


@pytest.mark.parametrize("hardening", ["none", "isotropic", "kinematic", "mixed"])
@pytest.mark.parametrize("shear", [0.0, 0.09, -0.09])
def test_a_steady_pass_is_a_fixed_point_of_one_increment(hardening, shear):
    """By the forces of the discretised body and the law of increments, at every point.

    An increment of one element takes each point to the place of the one two columns before.
    """
    material = steel(hardening=hardening, hardening_ratio=0.024)
    place = InterleavedTrack(A, 2.0, 1.15, material.elasticity)
    load = place.hertz(4.7 * K, shear)
    (one,) = rolling(place, material, load, [1], parts=1)
    forces = load.force
    rows, part = place.rows, place.part
    before = one.before.plastic_strain
    whole = operators_of(part, [place.surface], "auto").elastic
    state = under_load(place, one).plastic.at(np.arange(part.weights.size))
    stands_for = part.undeformed.internal_force(material.stiffness(4) @ state.plastic_strain)
    u = whole.begin(forces + stands_for).finish(np.zeros_like(forces))
    np.testing.assert_allclose(under_load(place, one).u, u, atol=1e-9)

    upstream = np.concatenate([before[:, None], one.plastic_strain[:, :-1]], axis=1)
    gathered = np.concatenate([one.before.accumulated[:, None], one.accumulated[:, :-1]], axis=1)
    state.plastic_strain[:, rows.points] = np.moveaxis(upstream, 2, 0)
    state.accumulated[rows.points] = gathered
    found = material.respond(part.strain(u), state)
    stiff = 2 * material.elasticity.shear_modulus
    now = np.moveaxis(found.state.plastic_strain[:, rows.points], 0, 2)
    assert stiff * abs(now - one.plastic_strain).max() < 0.1

    state.plastic_strain[:, rows.points] = np.moveaxis(one.plastic_strain, 2, 0)
    stress = material.stiffness(4) @ (part.strain(u) - state.plastic_strain)
    residual = forces - part.undeformed.internal_force(stress)
    correction = part.strain(whole.begin(residual).finish(np.zeros(part.n)))
    assert stiff * abs(correction).max() < 1e-6


def test_the_derivative_of_the_flow_is_that_of_differences():
    material = steel(hardening="mixed", hardening_ratio=0.05)
    place = track_of(A, 1.0, 1.15, material.elasticity)
    rows = place.rows
    loaded = rows.strain(place.hertz(4.7 * K, 0.1).u)
    change = loaded * np.random.default_rng(3).normal(size=loaded.shape)
    step = 1e-6

    def force(strain):
        return RowFlow(rows, material, rows.virgin(material), strain, 4).force

    differences = (force(loaded + step * change) - force(loaded - step * change)) / (2 * step)
    exact = RowFlow(rows, material, rows.virgin(material), loaded, 4).along(change)
    assert np.linalg.norm(exact - differences) < 1e-4 * np.linalg.norm(differences)


@pytest.mark.parametrize("where", ["rows", "surface"])
def test_material_at_rest_behind_the_load_carries_no_stress_across(where):
    after = passes(5.0, 1, shear=0.09)[0].after
    after = after.top if where == "surface" else after
    material = steel()
    state = PlasticState(after.plastic_strain.T, after.accumulated)
    found = material.respond(after.strain(material.elasticity).T, state)
    assert abs(found.stress[[1, 3]]).max() < 1e-6 * YIELD
    np.testing.assert_allclose(found.stress.T, after.stress(material.elasticity), atol=1e-6)
    assert not found.yielding.any() or material.yield_value(found.stress, state).max() < 1e-6


def test_a_pass_back_undoes_the_advance_of_the_surface():
    back_and_forth = [one.left.advance for one in passes(4.7, 8, directions=[1, -1] * 4)]
    one_way = [one.left.advance for one in passes(4.7, 8)]
    assert one_way[-1] - one_way[-3] == pytest.approx(-0.06, abs=0.005)
    assert abs(back_and_forth[-1] - back_and_forth[-3]) < 1e-3
    kinematic = steel(hardening="kinematic", hardening_ratio=0.024)
    first, second = (
        passes(4.7, 2, directions=ways, material=kinematic) for ways in ([1, 1], [-1, -1])
    )
    seen, left = second[-1].left.mirrored, first[-1].left
    for one, other in ((seen, left), (seen.top, left.top)):
        np.testing.assert_allclose(one.plastic_strain, other.plastic_strain, atol=1e-12)


def test_at_the_surface_stress_has_settled_where_the_first_row_has_not():
    elasticity = steel().elasticity
    coarse, usual, fine = (passes(4.7, 1, size=size)[0].after for size in (2.0, 1.0, 0.5))
    rows, tops = (
        np.array([each.stress(elasticity)[0, 0] for each in found])
        for found in ((coarse, usual, fine), (coarse.top, usual.top, fine.top))
    )
    assert abs(tops - tops[-1]).max() < 2.0
    assert abs(rows - tops[-1]).min() > 3.0


def test_more_elements_change_little_below_the_surface():
    coarse, fine = (passes(4.7, 1, size=size)[0].after for size in (1.0, 0.5))
    elasticity = steel().elasticity
    depth = np.linspace(2.0, 3 * A, 50)
    for component in (0, 2):
        stress = [
            np.interp(depth, each.depth, each.stress(elasticity)[:, component])
            for each in (coarse, fine)
        ]
        assert abs(stress[0] - stress[1]).max() < 15.0


def test_shear_beyond_the_strength_is_a_limit():
    with pytest.raises(LimitLoad, match="more than 30%"):
        passes(4.7, 1, shear=0.5)


def test_a_load_that_yields_beyond_the_window_is_told():
    with pytest.raises((NotConverged, LimitLoad)):
        passes(9.0, 1)


@pytest.mark.parametrize(("size", "allowed"), [(0.0, "half the half-width"), (1e-3, "at most")])
def test_elements_too_large_or_too_many_are_refused(size, allowed):
    with pytest.raises(ModelError, match=allowed):
        track_of(A, size, 1.15, steel().elasticity)
