"""Runs each scene once, and prints what all of them came to."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.stability.families import scene
from tests.stability.table import describe, summary
from tests.stability.trial import Trial, Verdict, attempt

_TRIALS = pytest.StashKey[dict[str, Trial]]()


@pytest.fixture(scope="session")
def trial(request: pytest.FixtureRequest) -> Callable[[str], Trial]:
    """Return the end of a scene by its name, ``family-number``."""
    done = request.config.stash.setdefault(_TRIALS, {})

    def of(name: str) -> Trial:
        if name not in done:
            done[name] = attempt(name, scene(name))
        return done[name]

    return of


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """Print the table, and every scene that did not end as it must or did not converge."""
    trials = list(config.stash.get(_TRIALS, {}).values())
    if not trials:
        return
    terminalreporter.section("extreme scenes")
    told = [t for t in trials if not t.right or t.verdict is Verdict.HONEST]
    for line in summary(trials) + [describe(t) for t in told]:
        terminalreporter.write_line(line)
