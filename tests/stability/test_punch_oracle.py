"""The oracle of the extreme scenes notices a wrong answer of every kind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from solver import Outcome, PathControl, System, Walker
from solver.contact.state import Converged
from solver.scenes.punch import PunchParameters
from solver.scenes.punch_setup import model
from tests.stability.kinds.punch_oracle import LIMITS, judge

PARAMETERS = PunchParameters(
    friction=0.4, load_ratio=0.7, smallest_element=0.03, growth=2.0, half_plane_size=4.0
)


@pytest.fixture(scope="module")
def solved() -> tuple[System, Outcome]:
    system = System(model(PARAMETERS))
    control = PathControl(load_step=0.1, unload_steps=2)
    (outcome,) = Walker(system, control).walk([control.program(PARAMETERS.load_ratio)])
    return system, outcome


def _contact(converged: Converged, normal=1.0, tangential=1.0, least=None) -> Converged:
    (contact,) = converged.state.contacts
    forces = contact.normal * normal
    if least is not None:
        forces[forces.argmin()] = least
    contact = replace(contact, normal=forces, tangential=contact.tangential * tangential)
    return replace(converged, state=replace(converged.state, contacts=(contact,)))


def _moved(converged: Converged, dy: float) -> Converged:
    punch, half_plane = converged.state.u
    punch = punch.copy()
    punch[1::2] += dy
    return replace(converged, state=replace(converged.state, u=(punch, half_plane)))


def _stressed(converged: Converged, factor=1.0, out_of_plane=0.0) -> Converged:
    first, *others = converged.responses
    stress = first.stress * factor
    stress[2] += out_of_plane
    return replace(converged, responses=(first._replace(stress=stress), *others))


def _swollen(converged: Converged) -> Converged:
    first, *others = converged.responses
    strain = first.state.plastic_strain + 1e-6
    changed = first._replace(state=replace(first.state, plastic_strain=strain))
    return replace(converged, responses=(changed, *others))


def _with(outcome: Outcome, **points: Converged) -> Outcome:
    return replace(outcome, points={**outcome.points, **points})


def _under_load(change: Callable[..., Converged], *args: float, **options: float):
    """Return what replaces the state under load of an outcome by a changed one."""
    return lambda outcome: _with(outcome, loaded=change(outcome.points["loaded"], *args, **options))


TAMPERED = {
    "more contact force": (_under_load(_contact, normal=1.001), {"force"}),
    "friction the other way": (_under_load(_contact, tangential=-1), {"work_x"}),
    "more friction": (_under_load(_contact, tangential=1.01), {"cone"}),
    "a point pulls": (_under_load(_contact, least=-1e-6), {"tension"}),
    "punch too low": (_under_load(_moved, -1e-6), {"overlap"}),
    "punch too high": (_under_load(_moved, 1e-6), {"complementarity"}),
    "more stress": (_under_load(_stressed, factor=1.001), {"work_y", "law", "yield"}),
    "stress out of plane": (_under_load(_stressed, out_of_plane=1e-3), {"state"}),
    "plastic volume": (_under_load(_swollen), {"state", "law"}),
    "not unloaded": (
        lambda outcome: _with(outcome, unloaded=outcome.points["loaded"]),
        {"residual_work", "left_over"},
    ),
    "energy for nothing": (
        lambda outcome: replace(outcome, tally=replace(outcome.tally, plastic_work=-1.0)),
        {"dissipation"},
    ),
}


def test_a_right_answer_passes(solved: tuple[System, Outcome]) -> None:
    figures = judge(PARAMETERS, *solved)
    assert figures.keys() == LIMITS.keys()
    assert not {name: value for name, value in figures.items() if not value <= LIMITS[name]}
    assert np.abs(solved[1].points["loaded"].state.contacts[0].tangential).max() > 0
    assert solved[1].tally.plastic_work > 0


@pytest.mark.parametrize("fault", TAMPERED)
def test_a_wrong_answer_does_not(fault: str, solved: tuple[System, Outcome]) -> None:
    system, outcome = solved
    tamper, noticed = TAMPERED[fault]
    figures = judge(PARAMETERS, system, tamper(outcome))
    assert noticed <= {name for name, value in figures.items() if not value <= LIMITS[name]}


def test_no_condition_of_the_oracle_is_idle() -> None:
    assert set().union(*(noticed for _, noticed in TAMPERED.values())) == LIMITS.keys()
