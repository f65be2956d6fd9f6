"""The oracle of passes over a prism notices a wrong answer of every kind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from solver import Status
from tests.stability.kinds import prism
from tests.stability.kinds.prism_oracle import LIMITS, Rolled, beyond_yield, judge

RACEWAY: dict[str, Any] = {
    "accuracy": "draft", "hardening": "kinematic", "load": "contact", "load_ratio": 2.4,
    "friction": 0.3, "traction": 0.5, "lateral_creepage": 0.0,
}  # fmt: skip
RAIL: dict[str, Any] = {
    "accuracy": "draft", "load": 9e4, "lateral_position": -6.0, "cant": 0.025, "friction": 0.3,
    "hardening": "isotropic", "lateral_control": "force", "given_lateral_force": 2e3,
    "traction": 0.3, "yield_stress": 300.0, "initial_stress": "roller_straightened",
    "straightening_stress": 50.0,
}  # fmt: skip


@pytest.fixture(scope="module")
def raceway() -> Rolled:
    return prism.run(RACEWAY, "mirrored")


@pytest.fixture(scope="module")
def rail() -> Rolled:
    return prism.run(RAIL, None)


def _touching(**change: Callable[[Any], Any]) -> Callable[[Rolled], Rolled]:
    """Change attributes of the contact."""

    def tamper(rolled: Rolled) -> Rolled:
        contact: Any = rolled.run.loaded.touching
        own = {name: new(getattr(contact, name).copy()) for name, new in change.items()}
        return _with(rolled, "loaded", touching=replace(contact, **own))

    return tamper


def _points(which: str, name: str, change: Callable[[Any], Any]) -> Callable[[Rolled], Rolled]:
    """Change stress, plastic_strain or accumulated of a state."""

    def tamper(rolled: Rolled) -> Rolled:
        state: Any = getattr(rolled.run, which).state
        if name == "stress":
            state = replace(state, stress=change(state.stress.copy()))
        else:
            own = {name: change(getattr(state.plastic, name).copy())}
            state = replace(state, plastic=replace(state.plastic, **own))
        return _with(rolled, which, state=state)

    return tamper


def _with(rolled: Rolled, which: str, **change: Any) -> Rolled:
    run = rolled.run
    name = getattr(run.view, which)
    points = dict(run.outcome.points) | {name: replace(getattr(run, which), **change)}
    return replace(rolled, run=replace(run, outcome=replace(run.outcome, points=points)))


def _recorded(name: str, change: Callable[[Any], Any]) -> Callable[[Rolled], Rolled]:
    """Change a field of the record, or a scalar."""

    def tamper(rolled: Rolled) -> Rolled:
        record = rolled.record
        if name in record.scalars:
            scalars = dict(record.scalars) | {name: change(record.scalars[name])}
            return replace(rolled, record=replace(record, scalars=scalars))
        dims, values = record.fields[name]
        fields = dict(record.fields) | {name: (dims, change(values.copy()))}
        return replace(rolled, record=replace(record, fields=fields))

    return tamper


def _added(at: Any, value: float) -> Callable[[Any], Any]:
    def change(values: Any) -> Any:
        values[at] += value
        return values

    return change


def _given(**change: Any) -> Callable[[Rolled], Rolled]:
    """Judge it as the answer of other parameters."""
    return lambda rolled: replace(rolled, parameters=replace(rolled.parameters, **change))


def _mirrored(rolled: Rolled) -> Rolled:
    other = _recorded("running_surface_residual", lambda v: 1.01 * v)(rolled).record
    return replace(rolled, other=other)


def _in_more_steps(rolled: Rolled) -> Rolled:
    given = replace(rolled, record=_mirrored(rolled).other)
    return replace(rolled, other=_recorded("iterations", lambda n: n + 1)(given).record)


TAMPERED: dict[str, tuple[str, Callable[[Rolled], Rolled], set[str]]] = {
    "more traction": (
        "raceway", _touching(traction=lambda t: 1.05 * t),
        {"vertical", "drive", "told forces"},
    ),
    "tension": ("raceway", _touching(traction=_added((0, 0, 1), 1.0)), {"tension", "cone"}),
    "another lateral force": ("rail", _given(given_lateral_force=2.1e3), {"lateral"}),
    "less friction": ("raceway", _given(friction=0.2), {"cone"}),
    "a locked ball": ("raceway", _given(traction=1.0), {"locked"}),
    "more pressure": (
        "raceway", _recorded("patch_pressure", lambda v: 1.05 * v), {"pressure map"},
    ),
    "more shear": ("raceway", _recorded("patch_shear_x", lambda v: 2.0 * v), {"shear map"}),
    "on one side": (
        "raceway", _recorded("running_surface_residual", _added((0, 40), 1.0)),
        {"symmetric", "other"},
    ),
    "other mirror image": ("raceway", _mirrored, {"other"}),
    "another in more steps": ("raceway", _in_more_steps, {"other steps"}),
    "stress left at a point": (
        "raceway", _points("unloaded", "stress", _added((0, 17), 1e-3)), {"along"},
    ),
    "stress across left": (
        "raceway", _points("unloaded", "stress", _added((1, 17), 100.0)), {"linear work"},
    ),
    "more stress left": (
        "raceway", _points("unloaded", "stress", lambda s: 20.0 * s), {"yield left"},
    ),
    "more stress": ("raceway", _points("loaded", "stress", lambda s: 1.05 * s), {"yield loaded"}),
    "plastic volume": (
        "raceway", _points("unloaded", "plastic_strain", _added((1,), 1e-8)), {"volume"},
    ),
    "a path too short": ("raceway", _points("unloaded", "accumulated", lambda a: a / 2), {"path"}),
    "less plastic strain": (
        "raceway", _recorded("pass_plastic_increment", lambda v: -v), {"grows"},
    ),
    "another initial stress": ("rail", _given(straightening_stress=60.0), {"initial"}),
    "a warmer rail": ("rail", _given(temperature_change=5.0), {"initial"}),
    "yielding far below the yield stress": (
        "raceway", _recorded("peak_patch_pressure", lambda v: 0.1 * v), {"elastic", "told forces"},
    ),
    "an elastic contact": ("raceway", _recorded("max_plastic_strain", lambda v: 0.0), {"hertz"}),
}  # fmt: skip


def test_right_answers_pass(raceway: Rolled, rail: Rolled) -> None:
    for each in (raceway, rail):
        assert not {name: f for name, f in judge(each).items() if not f.right}
        assert each.record.scalars["max_plastic_strain"] > 1e-4


@pytest.mark.parametrize("fault", TAMPERED)
def test_a_wrong_answer_does_not(fault: str, raceway: Rolled, rail: Rolled) -> None:
    which, tamper, noticed = TAMPERED[fault]
    judged = judge(tamper({"raceway": raceway, "rail": rail}[which]))
    assert noticed <= {name for name, f in judged.items() if not f.right}


def test_a_failed_audit_is_no_answer(raceway: Rolled) -> None:
    failed = replace(raceway, record=replace(raceway.record, status=Status.AUDIT_FAILED))
    assert not judge(failed)["audit"].right


def test_no_condition_of_the_oracle_is_idle() -> None:
    assert set().union(*(noticed for *_, noticed in TAMPERED.values())) == set(LIMITS)


def test_strength_follows_the_law() -> None:
    stress = np.zeros((6, 1))
    stress[0], ep, total = 600.0, np.zeros((6, 1)), np.array([0.01])
    for given, strength in (
        ({"hardening": "none"}, 502.0),
        ({"hardening": "voce", "saturation": 50.0, "saturation_rate": 1e4}, 552.0),
        ({"hardening": "table", "curve": ((0.0, 502.0), (0.02, 542.0))}, 522.0),
        ({"hardening": "none", "yield_condition": "tresca"}, 502.0),
    ):
        p = prism.parameters_of({"cant": 0.0, **given})
        assert beyond_yield(p, stress, ep, total)[0] == pytest.approx(600 - strength)
