"""The audit notices what is wrong with a solution."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver import PathControl, solve
from solver.audit import audit
from solver.scenes.punch import PunchParameters, model


@pytest.fixture(scope="module")
def solution():
    parameters = PunchParameters(
        smallest_element=0.02, growth=2.0, half_plane_size=8.0, friction=0.3
    )
    return solve(model(parameters), load=0.6, control=PathControl(load_step=0.1))


def judged(solution, loaded, dissipation=0.0):
    return audit(solution.system, loaded, solution.unloaded, dissipation)


def test_a_converged_solution_passes(solution):
    assert judged(solution, solution.loaded).passed


@pytest.mark.parametrize("factor", [0.5, np.nan])
def test_wrong_stress_is_noticed(solution, factor):
    responses = tuple(r._replace(stress=factor * r.stress) for r in solution.loaded.responses)
    check = judged(solution, replace(solution.loaded, responses=responses))
    assert any("audit_residual" in text for text in check.violations)


@pytest.mark.parametrize("factor", [0.5, np.nan])
def test_wrong_contact_forces_are_noticed(solution, factor):
    state = solution.loaded.state
    contacts = tuple(replace(c, normal=factor * c.normal) for c in state.contacts)
    check = judged(solution, replace(solution.loaded, state=replace(state, contacts=contacts)))
    assert any("audit_residual" in text for text in check.violations)


@pytest.mark.parametrize("dissipation", [-1.0, np.nan])
def test_wrong_dissipation_is_noticed(solution, dissipation):
    assert not judged(solution, solution.loaded, dissipation).passed


def test_a_body_that_sinks_into_the_other_is_noticed(solution):
    state = solution.loaded.state
    u = tuple(ui + (0.01 if k == 1 else 0.0) for k, ui in enumerate(state.u))
    check = judged(solution, replace(solution.loaded, state=replace(state, u=u)))
    assert any("audit_overlap" in text for text in check.violations)
