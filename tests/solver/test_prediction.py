"""Increments under a moving load, predicted by earlier ones: same results, fewer iterations."""

from __future__ import annotations

import numpy as np
import pytest

from solver.contact.system import System
from solver.loading.prediction import Following, Predictor
from solver.loading.program import Control
from solver.loading.walker import Walker
from solver.rolling.scenes.rolling import ROLLING, RollingParameters

pytestmark = pytest.mark.solves

COARSE = {"track": 18.0, "element_size": 3.0, "growth": 1.8, "press_steps": 2, "unload_steps": 1}


def walked(passes=(1,), **changed):
    """The system, and the outcomes of coarse runs of so many passes, walked together."""
    runs = [RollingParameters(**(COARSE | changed), passes=count) for count in passes]
    system = System(ROLLING.model(runs[-1]))
    return system, list(
        Walker(system, Control(increment_error=np.inf)).walk([ROLLING.program(run) for run in runs])
    )


def stress(system, outcome):
    return system.state("half_space", outcome.points["unloaded"]).stress


@pytest.mark.parametrize(
    ("share", "changed"),
    [
        (0.85, {"advance_step": 3.0, "track": 24.0}),
        (0.85, {"advance_step": 1.5, "traction": 0.75}),
        (0.85, {"advance_step": 1.5, "heading": "backward", "traction": -0.5}),
    ],
    ids=str,
)
def test_what_is_carried_along_saves_iterations_and_changes_no_result(share, changed, monkeypatch):
    """Both end at the same tolerance, 1e-8 of the force; measured 70 to 80 % of the iterations."""
    system, (predicted,) = walked(**changed)
    monkeypatch.setattr(Predictor, "predicted", lambda self, past, now, time: None)
    _, (plain,) = walked(**changed)
    assert sum(predicted.tally.iterations) < share * sum(plain.tally.iterations)
    assert np.abs(stress(system, predicted) - stress(system, plain)).max() < 0.01


def test_a_branch_with_predictions_is_bit_for_bit_a_run_by_itself():
    both = {"track": 6.0, "advance_step": 1.5, "direction": "back_and_forth"}
    system, (one, two) = walked((1, 2), **both)
    for passes, together in ((1, one), (2, two)):
        own, (alone,) = walked((passes,), **both)
        assert np.array_equal(stress(own, alone), stress(system, together))
        assert alone.tally.iterations == together.tally.iterations


def test_a_change_of_the_track_moves_by_whole_elements_and_tears_none():
    """On the fine track exactly; beyond, the energy stays that of the change itself."""
    system, (outcome,) = walked(advance_step=3.0)
    number = system.part("half_space")
    part, side = system.parts[number], system.interfaces[0].slave_surface.shortest_edge
    middle = outcome.points["mid_track"]
    change = middle.state.u[number] - middle.start.u[number]
    moved = Following(part, side).carried(change)
    fine = np.abs(part.X[0]) < 20
    behind = np.flatnonzero(fine)
    places = part.X[:, behind] - [[side], [0.0]]
    for node, place in zip(behind[::50], places.T[::50], strict=True):
        (at,) = np.flatnonzero(np.abs(part.X - place[:, None]).max(axis=0) < 1e-9)
        assert np.array_equal(moved[2 * node : 2 * node + 2], change[2 * at : 2 * at + 2])
    K = part.elastic_matrix()
    assert moved @ K @ moved == pytest.approx(change @ K @ change, rel=0.02)


def test_nothing_is_carried_along_where_no_earlier_increment_is_like_the_next():
    system, (outcome,) = walked(advance_step=3.0)
    middle, last = outcome.points["mid_track"], outcome.points["loaded"]
    assert Predictor(system).predicted((), middle.state, last.state.time) is None
    past = (middle.start,)
    state = middle.state
    on = 2 * state.time - middle.start.time
    assert Predictor(system).predicted(past, state, on) is not None
    assert Predictor(system).predicted(past, state, on + 1.0) is None
