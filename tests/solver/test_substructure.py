"""An elastic body reduced to its contact surface gives what the meshed body gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver import ContactPair, Model, PathControl, System, solve
from solver.scenes.punch import PunchParameters
from solver.scenes.punch_setup import model

pytestmark = pytest.mark.solves

COARSE = PunchParameters(
    smallest_element=0.02, growth=2.0, elastic_punch=True, friction=0.3, load_ratio=0.6
)
CONTROL = PathControl(load_step=0.1)


def punch(condense: bool, **changes) -> Model:
    whole = model(replace(COARSE, **changes))
    first, second = whole.bodies
    return replace(whole, bodies=(replace(first, condense=condense), second))


@pytest.mark.parametrize("state", ["plane_stress", "plane_strain", "axisymmetric"])
def test_condensed_punch_gives_what_the_meshed_punch_gives(state):
    reduced = solve(punch(True, state=state), load=0.6, control=CONTROL)
    meshed = solve(punch(False, state=state), load=0.6, control=CONTROL)
    assert reduced.system.parts[0].n < meshed.system.parts[0].n / 4
    assert meshed.plastic_strain("half_plane").max() > 3e-4
    for stage in ("loaded", "unloaded"):
        for body in ("punch", "half_plane"):
            a, b = reduced.stress(body, stage), meshed.stress(body, stage)
            # both stop at a relative residual of 1e-8; corner stresses amplify it
            assert np.abs(a - b).max() < 1e-4
    assert np.abs(reduced.contact().pressure - meshed.contact().pressure).max() < 1e-4


def test_equal_elastic_bodies_share_one_condensation():
    first = System(punch(True))
    second = System(punch(True, friction=0.1, hardening="isotropic"))
    stiffer = System(punch(True, punch_stiffness=2.0))
    assert first.parts[0]._condensed is second.parts[0]._condensed
    assert first.parts[0]._condensed is not stiffer.parts[0]._condensed


def test_elastic_body_keeps_no_residual_stress():
    solution = solve(punch(True), load=0.6, control=CONTROL)
    assert np.abs(solution.stress("punch", "loaded")).max() > 100
    assert np.abs(solution.stress("punch", "unloaded")).max() < 1e-6


def test_two_elastic_bodies_need_one_increment_and_leave_nothing():
    whole = punch(True)
    first, second = whole.bodies
    elastic = replace(second, material=first.material, supports={"left": "x", "bottom": "xy"})
    both = Model(
        bodies=(first, elastic),
        contacts=(
            ContactPair(slave=("punch", "bottom"), master=("half_plane", "top"), friction=0.3),
        ),
    )
    solution = solve(both)
    assert len(solution.tally.iterations) == 1
    assert np.abs(solution.stress("half_plane")).max() == 0.0
