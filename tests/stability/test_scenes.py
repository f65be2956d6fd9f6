"""Every scene gives a right answer, a clear refusal, a right limit, or a declared reason."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.stability.families import NAMES
from tests.stability.table import describe
from tests.stability.trial import Trial

Trials = Callable[[str], Trial]


def test_there_are_three_hundred_scenes() -> None:
    assert len(NAMES) == len(set(NAMES)) == 300


@pytest.mark.parametrize("name", NAMES)
def test_every_scene_ends_as_it_must(name: str, trial: Trials) -> None:
    this = trial(name)
    assert this.right, describe(this)
