"""Runs each extreme scene once, and prints what all of them came to."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from solver import Status
from tests.stability.scenes import extreme_scenes
from tests.stability.table import describe, summary
from tests.stability.trial import Trial, attempt

_TRIALS = pytest.StashKey[dict[int, Trial]]()


@pytest.fixture(scope="session")
def trial(request: pytest.FixtureRequest) -> Callable[[int], Trial]:
    """Return the outcome of a scene by its number."""
    done = request.config.stash.setdefault(_TRIALS, {})
    scenes = extreme_scenes()

    def of(number: int) -> Trial:
        if number not in done:
            done[number] = attempt(number, scenes[number])
        return done[number]

    return of


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """Print the table, and every scene without a usable answer that was not a collapse."""
    trials = list(config.stash.get(_TRIALS, {}).values())
    if not trials:
        return
    terminalreporter.section("extreme scenes")
    lost = [t for t in trials if t.status not in (Status.OK, Status.LIMIT_LOAD)]
    for line in summary(trials) + [describe(t) for t in lost]:
        terminalreporter.write_line(line)
