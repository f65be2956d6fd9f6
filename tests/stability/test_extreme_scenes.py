"""A punch with extreme parameters gives a right answer, a collapse, or a reason; it never hangs."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest

from solver import Status
from tests.stability.collapse import collapse
from tests.stability.oracle import LIMITS
from tests.stability.scenes import COUNT
from tests.stability.trial import Trial, deadline

MESH_ALLOWANCE = 1.01
"""Coarse meshes were seen to carry up to 0.6 % more than the exact collapse load."""
LOCKING = ("tri3",)
"""Linear triangles lock in isochoric flow: how much they carry has no bound."""
RARE = 0.02

Trials = Callable[[int], Trial]


def _beyond_collapse(trial: Trial, load: float, allowance: float = 1.0) -> bool:
    """Whether no equilibrium exists at ``load`` by limit analysis."""
    p = trial.parameters
    bounds = collapse(p.state, elastic_punch=p.elastic_punch)
    return not trial.hardens and load > bounds.certain * allowance


@pytest.mark.parametrize("number", range(COUNT))
def test_an_extreme_scene_gives_a_right_answer_or_a_reason(number: int, trial: Trials) -> None:
    this = trial(number)
    p = this.parameters
    if this.status is Status.OK:
        wrong = {n: v for n, v in this.figures.items() if not v <= LIMITS[n]}
        assert not wrong
        assert p.element in LOCKING or not _beyond_collapse(this, p.load_ratio, MESH_ALLOWANCE)
        return
    assert this.status in (Status.LIMIT_LOAD, Status.NOT_CONVERGED), this.record.message
    assert this.record.message
    # the loads between which it stopped are told, to the digits printed
    told = {float(n) for n in re.findall(r"\d+(?:\.\d+)?(?:e-?\d+)?", this.record.message)}
    for load in (this.reached, this.attempted):
        assert any(abs(load - n) <= 1e-5 * load for n in told), this.record.message
    assert this.reached < this.attempted <= p.load_ratio
    if this.status is Status.LIMIT_LOAD:
        # where an equilibrium is certain to exist, "no equilibrium" is a wrong answer
        safe = collapse(p.state, elastic_punch=p.elastic_punch).safe
        assert not this.hardens
        assert this.attempted >= safe * (1 - 1e-9)


def test_hardly_any_scene_is_given_up_and_none_that_has_an_answer(trial: Trials) -> None:
    lost = [t for t in map(trial, range(COUNT)) if t.status is Status.NOT_CONVERGED]
    assert len(lost) <= RARE * COUNT
    assert [t.number for t in lost if not _beyond_collapse(t, t.parameters.load_ratio)] == []


def test_the_scenes_reach_every_extreme(trial: Trials) -> None:
    trials = [trial(number) for number in range(COUNT)]
    seen = {status: sum(t.status is status for t in trials) for status in Status}
    assert seen[Status.OK] >= 0.6 * COUNT
    assert seen[Status.LIMIT_LOAD] >= 0.1 * COUNT
    p = [t.parameters for t in trials]
    assert {q.state for q in p} == {"plane_stress", "plane_strain", "axisymmetric"}
    assert {q.hardening for q in p} == {"none", "isotropic", "kinematic", "mixed"}
    assert {q.element for q in p} == {"quad8", "quad9", "quad4", "tri6", "tri3"}
    for name, low, high in (
        ("friction", 0.0, 1.0),
        ("hardening_ratio", 0.0, 0.5),
        ("poisson_ratio", 0.0, 0.499),
        ("punch_stiffness", 1e-3, 1e3),
    ):
        values = [getattr(q, name) for q in p]
        assert min(values) == pytest.approx(low)
        assert max(values) == pytest.approx(high)
    assert min(q.load_ratio for q in p) < 0.02
    assert max(q.load_ratio for q in p) > 2.0
    assert {q.elastic_punch for q in p} == {True, False}
    assert min(q.unload_steps for q in p) == 1


def test_a_scene_that_hangs_is_stopped() -> None:
    with pytest.raises(TimeoutError), deadline(0.05):
        while True:
            pass
