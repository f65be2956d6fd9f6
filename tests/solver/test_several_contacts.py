"""Several contacts on one surface, and bodies that overlap before anything is loaded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver import Body, ContactPair, Material, Model, solve
from solver.mesh import grid

pytestmark = pytest.mark.solves

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=1e6)


def pad(name: str, left: float, pressure: float) -> Body:
    return Body(
        name=name,
        mesh=grid(np.linspace(left, left + 5, 6), np.linspace(0, 4, 5)),
        material=STEEL,
        supports={"top": "x"},
        pressure={"top": pressure},
    )


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_two_pads_on_one_plate_both_press_on_it(order):
    plate = Body(
        name="plate",
        mesh=grid(np.linspace(-10, 20, 31), np.linspace(-10, 0, 11)),
        material=STEEL,
        supports={"bottom": "xy"},
    )
    pads = (pad("one", -5.0, 100.0), pad("two", 10.0, 100.0))
    pairs = [ContactPair(slave=(p.name, "bottom"), master=("plate", "top")) for p in pads]
    solution = solve(Model(bodies=(*pads, plate), contacts=tuple(pairs[k] for k in order)))
    whole = solution.system.full("plate")
    response = solution.system.state("plate", solution.loaded)
    nodes = whole.boundary_nodes("bottom")
    reaction = whole.undeformed.internal_force(response.stress)[2 * nodes + 1].sum()
    assert reaction == pytest.approx(1000.0, rel=1e-6)


def test_bodies_that_overlap_before_loading_press_on_each_other():
    """Two blocks, 4 and 10 high, 0.01 too high together: sigma_y = -E 0.01 / 14 (plane stress)."""
    make = {"material": STEEL, "kinematics": "plane_stress"}
    upper = Body(
        name="upper",
        mesh=grid(np.linspace(0, 5, 6), np.linspace(-0.01, 4, 5)),
        supports={"left": "x", "top": "y"},
        **make,
    )
    lower = Body(
        name="lower",
        mesh=grid(np.linspace(0, 5, 6), np.linspace(-10, 0, 11)),
        supports={"left": "x", "bottom": "y"},
        **make,
    )
    pair = ContactPair(slave=("upper", "bottom"), master=("lower", "top"))
    solution = solve(Model(bodies=(upper, lower), contacts=(pair,)))
    expected = -2e5 * 0.01 / 14.01
    assert solution.stress("lower", "loaded")[1] == pytest.approx(
        np.full(solution.nodes("lower").shape[1], expected), rel=1e-3
    )


def test_a_state_is_paired_once_and_another_anew():
    plate = Body(
        name="plate",
        mesh=grid(np.linspace(-10, 20, 31), np.linspace(-10, 0, 11)),
        material=STEEL,
        supports={"bottom": "xy"},
    )
    pads = (pad("one", -5.0, 100.0), pad("two", 10.0, 100.0))
    pairs = tuple(ContactPair(slave=(p.name, "bottom"), master=("plate", "top")) for p in pads)
    solution = solve(Model(bodies=(*pads, plate), contacts=pairs))
    system, state = solution.system, solution.loaded.state
    found = [system.pairing(state, k) for k in range(2)]
    assert all(system.pairing(state, k) is each for k, each in enumerate(found))
    assert all(np.array_equal(each.gap, state.contacts[k].gap) for k, each in enumerate(found))
    raised = replace(state, u=tuple(u + 0.1 for u in state.u[:2]) + state.u[2:])
    for k, each in enumerate(found):
        assert system.pairing(raised, k).gap == pytest.approx(each.gap + 0.1)
        assert np.array_equal(system.pairing(state, k).gap, each.gap)
