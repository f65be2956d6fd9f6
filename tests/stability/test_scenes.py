"""Every scene gives a right answer, a clear refusal, a right limit, or a declared reason."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.stability.families import EVERY, FAMILIES, NAMES
from tests.stability.table import describe
from tests.stability.trial import Trial, Verdict

Trials = Callable[[str], Trial]
RARE = 0.02


def test_there_are_a_thousand_scenes_of_which_the_test_suite_runs_each_kind() -> None:
    assert len(EVERY) == len(set(EVERY)) >= 1000
    assert {name.rpartition("-")[0] for name in NAMES} == set(FAMILIES)
    assert len(NAMES) <= 350
    assert set(NAMES) <= set(EVERY)


@pytest.mark.parametrize("family", [f for f, own in FAMILIES.items() if own.long > len(own.short)])
def test_a_scene_is_the_same_however_many_there_are(family: str) -> None:
    few, many = map(FAMILIES[family].make, (3, FAMILIES[family].short[-1] + 1))
    assert [s.what for s in few] == [s.what for s in many[:3]]
    assert len({s.what for s in many}) == len(many)


@pytest.mark.parametrize("name", NAMES)
def test_every_scene_ends_as_it_must(name: str, trial: Trials) -> None:
    this = trial(name)
    assert this.right, describe(this)


def test_the_punches_are_carried_collapse_and_are_hardly_ever_given_up(trial: Trials) -> None:
    """Here, for the process that has run them."""
    punches = [name for name in NAMES if name.startswith("punch-")]
    count = {v: sum(trial(name).verdict is v for name in punches) for v in Verdict}
    assert count[Verdict.ANSWER] >= 0.6 * len(punches)
    assert count[Verdict.LIMIT] >= 0.1 * len(punches)
    assert count[Verdict.HONEST] + count[Verdict.NOT_CONVERGED] <= RARE * len(punches)
