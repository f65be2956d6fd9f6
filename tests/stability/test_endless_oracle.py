"""The oracle of steady passes notices a wrong answer of every kind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from solver import Status
from solver.rolling.scenes.rolling import RollingParameters
from tests.stability.kinds import bearing, endless
from tests.stability.kinds.endless_oracle import LIMITS, Passed, judge, never_yields

A = RollingParameters().half_width
PARAMETERS = RollingParameters(
    element_size=A / 5, growth=1.8, traction=0.5, passes=2, direction="back_and_forth",
    hardening="mixed",
)  # fmt: skip


@pytest.fixture(scope="module")
def passed() -> Passed:
    return endless.roll(PARAMETERS, mirror=True, scale=True)


def _points(which: str, **change: Callable[[np.ndarray], np.ndarray]) -> Callable[..., Passed]:
    """Change stress, plastic_strain or accumulated of a state."""

    def tamper(passed: Passed) -> Passed:
        outcome = passed.run.outcome
        standing = outcome.points[which]
        state, plastic = standing.state, standing.state.plastic
        if "stress" in change:
            state = replace(state, stress=change["stress"](state.stress.copy()))
        own = {n: f(getattr(plastic, n).copy()) for n, f in change.items() if n != "stress"}
        state = replace(state, plastic=replace(plastic, **own))
        points = dict(outcome.points) | {which: replace(standing, state=state)}
        run = replace(passed.run, outcome=replace(outcome, points=points))
        return replace(passed, run=run)

    return tamper


def _recorded(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Callable[..., Passed]:
    """Change a field of the record, or a scalar."""

    def tamper(passed: Passed) -> Passed:
        record = passed.record
        if name in record.scalars:
            scalars = dict(record.scalars) | {name: change(record.scalars[name])}
            return replace(passed, record=replace(record, scalars=scalars))
        dims, values = record.fields[name]
        fields = dict(record.fields) | {name: (dims, change(values.copy()))}
        return replace(passed, record=replace(record, fields=fields))

    return tamper


def _added(at: tuple, value: float) -> Callable[[np.ndarray], np.ndarray]:
    def change(values: np.ndarray) -> np.ndarray:
        values[at] += value
        return values

    return change


FAR_ALONG = (0, 17)
TAMPERED: dict[str, tuple[Callable[[Passed], Passed], set[str]]] = {
    "more stress": (_points("loaded", stress=lambda s: 1.01 * s), {"vertical", "yield loaded"}),
    "stress at a point": (_points("loaded", stress=_added(FAR_ALONG, 1.0)), {"free nodes"}),
    "stress left at a point": (
        _points("unloaded", stress=_added(FAR_ALONG, 1e-3)),
        {"uniform", "left stress"},
    ),
    "more stress left": (_points("unloaded", stress=lambda s: 3.0 * s), {"yield left"}),
    "plastic volume": (
        _points("loaded", plastic_strain=_added((0,), 1e-8)),
        {"volume"},
    ),
    "a path too short": (_points("unloaded", accumulated=lambda a: 0.5 * a), {"path"}),
    "stress across": (_recorded("residual_profile", _added((..., 1, 5), 1e-3)), {"free layers"}),
    "less plastic strain": (_recorded("pass_plastic_increment", lambda v: -v), {"profile"}),
    "more pressure": (_recorded("contact_pressure", lambda v: 1.05 * v), {"pressure"}),
    "pulling pressure": (_recorded("contact_pressure", _added((0, 0), -1.0)), {"tension"}),
    "more shear": (_recorded("contact_shear", lambda v: 4.0 * v), {"shear", "cone"}),
    "another force": (_recorded("longitudinal_force", lambda v: 1.5 * v), {"across", "shear"}),
    "no audit": (
        lambda p: replace(p, record=replace(p.record, status=Status.AUDIT_FAILED)),
        {"audit"},
    ),
    "other mirror image": (
        lambda p: replace(p, mirrored=_recorded("residual_profile", lambda v: 1.01 * v)(p).record),
        {"mirrored"},
    ),
    "other units": (lambda p: replace(p, stresses=7.01), {"scaled"}),
}


def test_a_right_answer_passes(passed: Passed) -> None:
    figures = judge(passed)
    assert figures.keys() == {*LIMITS, "mirrored", "scaled"}
    assert not {name: f for name, f in figures.items() if not f.right}
    assert passed.record.scalars["max_plastic_strain"] > 1e-3


@pytest.mark.parametrize("fault", TAMPERED)
def test_a_wrong_answer_does_not(fault: str, passed: Passed) -> None:
    tamper, noticed = TAMPERED[fault]
    assert noticed <= {name for name, f in judge(tamper(passed)).items() if not f.right}


def test_plastic_strain_far_below_yield_is_wrong(passed: Passed) -> None:
    light = replace(PARAMETERS, load_ratio=0.3, element_size=A / 20, friction=0.05)
    assert never_yields(light)
    assert not never_yields(PARAMETERS)
    assert not judge(replace(passed, parameters=light))["elastic"].right


def test_no_condition_of_the_oracle_is_idle() -> None:
    noticed = set().union(*(noticed for _, noticed in TAMPERED.values()))
    assert noticed | {"elastic"} == {*LIMITS, "mirrored", "scaled"}


@pytest.mark.parametrize(
    ("fields", "certain"),
    [
        ({"load": "hertz", "friction": 0.0, "load_ratio": 2.0}, True),
        # L. Prandtl's (2 + pi) k is 2.97 times the yield stress
        ({"load": "hertz", "friction": 0.0, "load_ratio": 2.98}, False),
        ({"load": "hertz", "traction": 0.9, "load_ratio": 2.2}, False),
        ({"load": "hertz", "traction": 0.9, "load_ratio": 2.2, "hardening": "mixed"}, True),
        ({"traction": 0.9, "friction": 0.3}, True),
        ({"traction": 0.9, "friction": 0.5}, False),
        ({"traction": 0.9, "friction": 0.5, "shear_limit": 0.3}, False),
        ({"traction": 0.2, "friction": 1.0, "sequence": ({}, {"traction": 0.9})}, False),
        # endless-160 and endless-174 of the thousand scenes, which were once taken as certain
        ({"traction": 0.95, "load_ratio": 2.82, "poisson_ratio": 0.49, "radius": 33.492,
          "wheel_stiffness": 2.2735}, False),
        ({"traction": -0.5, "friction": 1.0, "load_ratio": 3.178, "radius": 33.492,
          "wheel_stiffness": 0.07828, "hardening": "mixed", "hardening_ratio": 0.01}, False),
    ],
)  # fmt: skip
def test_what_is_certainly_borne_is_known(fields: dict, certain: bool) -> None:
    assert bearing.bears(RollingParameters(**fields)) is certain
