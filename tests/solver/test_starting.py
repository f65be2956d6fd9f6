"""How contact begins: bodies that overlap, stand apart, or touch at one point."""

from __future__ import annotations

import math

import numpy as np
import pytest

from solver import Body, ContactPair, LimitLoad, Material, Model, NotConverged, PathControl, solve
from solver.mesh import grid, mapped
from solver.scenes.punch import PUNCH
from tests.verification.bodies import block, steel

pytestmark = pytest.mark.solves

E_MODULUS, SIDE = 2.0e5, 4.0
CONTROL = PathControl(load_step=0.5, unload_steps=2)


def bars(overlap, yield_stress=math.inf, hardening_ratio=0.0):
    """Two square bars between walls; they overlap, and their sides are free."""
    material = Material(
        youngs_modulus=E_MODULUS, poisson_ratio=0.3, yield_stress=yield_stress,
        hardening="isotropic", hardening_ratio=hardening_ratio,
    )  # fmt: skip
    x = np.linspace(0.0, SIDE, 5)
    upper = block("upper", x, x - overlap, material=material, kinematics="plane_stress",
                  supports={"left": "x", "top": "y"})  # fmt: skip
    lower = block("lower", x, x - SIDE, material=material, kinematics="plane_stress",
                  supports={"left": "x", "bottom": "y"})  # fmt: skip
    pair = ContactPair(slave=("upper", "bottom"), master=("lower", "top"))
    return Model(bodies=(upper, lower), contacts=(pair,))


def hardened(strain, yield_stress, ratio):
    """Uniaxial stress of a bar without or with linear hardening."""
    elastic = E_MODULUS * strain
    if elastic <= yield_stress:
        return elastic
    return yield_stress + ratio * (elastic - yield_stress)


@pytest.mark.parametrize("overlap", [1e-6, 1e-3, 0.0119, 0.013, 0.02, 0.1])
@pytest.mark.parametrize("ratio", [0.0, 1e-5, 0.024])
def test_an_overlap_is_pushed_apart_with_the_stress_of_a_bar(overlap, ratio):
    """Without hardening the bar has a singular tangent, and still an equilibrium."""
    solution = solve(bars(overlap, 300.0, ratio), control=CONTROL)
    expected = hardened(overlap / (2 * SIDE), 300.0, ratio)
    np.testing.assert_allclose(solution.stress("upper", "loaded")[1], -expected, rtol=1e-6)
    assert solution.audit().passed


def test_overlapping_bodies_that_nothing_loads_balance_each_other():
    solution = solve(bars(0.01), control=CONTROL)
    forces = solution.loaded.state.contacts[0].normal
    assert forces.sum() == pytest.approx(E_MODULUS * 0.01 / (2 * SIDE) * SIDE, rel=1e-9)
    assert solution.audit().figures["audit_residual"] < 1e-9


def stack(gap, direction=1.0, friction=0.0, held=None):
    """A block that nothing but contact holds in y, ``gap`` above its base."""
    x = np.linspace(0.0, SIDE, 5)
    upper = block("upper", x, gap + x, kinematics="plane_stress", supports=held or {"left": "x"},
                  pressure={"top": 100.0 * direction})  # fmt: skip
    lower = block("lower", x, x - SIDE, kinematics="plane_stress",
                  supports={"left": "x", "bottom": "y"})  # fmt: skip
    pair = ContactPair(slave=("upper", "bottom"), master=("lower", "top"), friction=friction)
    return Model(bodies=(upper, lower), contacts=(pair,))


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("gap", [0.0, 1e-9, 0.01, 0.3, 1.0, 10.0])
def test_a_body_comes_down_however_far_it_stands(gap, friction):
    solution = solve(stack(gap, friction=friction), control=CONTROL)
    np.testing.assert_allclose(solution.stress("upper", "loaded")[1], -100.0, rtol=1e-8)


def test_a_body_pulled_away_is_told_how_far_it_stands():
    with pytest.raises(NotConverged, match=r"'upper' is held by .* alone and has a gap of 0\.3 mm"):
        solve(stack(0.3, direction=-1.0))


def arc(gap, sliding):
    """A ring's lower part, free to move in every way, over a block; pushed down from its bore."""

    def to_ring(p):
        return np.stack([p[0] * np.cos(p[1]), gap + 10 + p[0] * np.sin(p[1])])

    angles = np.linspace(-np.pi / 2 - 1.2, -np.pi / 2 + 1.2, 49)
    ring = Body(name="ring", mesh=mapped(grid(np.linspace(2.0, 10.0, 9), angles), to_ring),
                material=steel(), pressure={"left": 50.0}, condense=False)  # fmt: skip
    base = block("base", np.linspace(-6.0, 6.0, 25), np.linspace(-6.0, 0.0, 13),
                 supports={"bottom": "xy"})  # fmt: skip
    pair = ContactPair(
        slave=("ring", "right"), master=("base", "top"), friction=0.3, sliding=sliding
    )
    return Model(bodies=(ring, base), contacts=(pair,))


@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.parametrize("gap", [0.0, 1e-3, 0.5])
def test_a_body_on_one_point_is_held_by_its_friction(gap, sliding):
    solution = solve(arc(gap, sliding), control=CONTROL)
    push = 50.0 * 2 * 2.0 * math.sin(1.2)  # pressure times the width of the bore's chord
    assert solution.loaded.state.contacts[0].normal.sum() == pytest.approx(push, rel=1e-3)
    # small sliding keeps the normals the arc had afar, and contact off by 2e-4 of the way down
    allowed = {"audit_contact_resolution"}  # a single vertex bears it
    if (sliding, gap) == ("small", 0.5):
        allowed |= {"audit_closed_gap", "audit_overlap"}
    assert {text.split()[0] for text in solution.audit().violations} <= allowed


# -- limits ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("ratio", "elastic_punch"), [(1e-6, False), (1e-4, True)])
def test_a_body_that_hardens_has_no_limit_load(ratio, elastic_punch):
    """Above the limit without hardening strains are huge: what fails is not equilibrium."""
    parameters = PUNCH.parameters(
        hardening="isotropic", hardening_ratio=ratio, friction=0.2, smallest_element=0.05,
        growth=3.0, half_plane_size=4.0, elastic_punch=elastic_punch, load_step=0.25,
    )  # fmt: skip
    (record,) = PUNCH.path(parameters, [1.1], lambda done: None)
    assert record.status.name != "LIMIT_LOAD", record.message


def test_a_limit_load_says_what_flows():
    with pytest.raises(LimitLoad, match=r"body 'bar' flows around x = .* mm, .* does 1\.\d+ times"):
        x = np.linspace(0.0, 4.0, 5)
        bar = block("bar", x, x, material=steel(300.0), kinematics="plane_stress",
                    supports={"left": "x", "bottom": "y"}, pressure={"right": -330.0})  # fmt: skip
        solve(Model(bodies=(bar,)), control=CONTROL)
