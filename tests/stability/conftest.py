"""Runs each scene once, and prints what all of them came to."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from tests.stability.families import scene
from tests.stability.table import describe, summary
from tests.stability.trial import Trial, Verdict, attempt

_TRIALS = pytest.StashKey[dict[str, Trial]]()
_HANDED = pytest.StashKey[list[str]]()


@pytest.fixture(scope="session")
def trial(request: pytest.FixtureRequest) -> Callable[[str], Trial]:
    """Return the end of a scene by its name, ``family-number``."""
    done = request.config.stash.setdefault(_TRIALS, {})

    def of(name: str) -> Trial:
        if name not in done:
            done[name] = attempt(name, scene(name))
        return done[name]

    return of


def _lines(config: pytest.Config) -> list[str]:
    """Return the table, and every scene that did not end as it must or did not converge."""
    trials = list(config.stash.get(_TRIALS, {}).values())
    told = [t for t in trials if not t.right or t.verdict is Verdict.HONEST]
    return summary(trials) + [describe(t) for t in told] if trials else []


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Hand the lines of a worker to the process that prints."""
    output = getattr(session.config, "workeroutput", None)
    if output is not None:
        output["extreme scenes"] = _lines(session.config)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Keep what a worker that had scenes handed over."""
    lines = getattr(node, "workeroutput", {}).get("extreme scenes", [])
    node.config.stash.setdefault(_HANDED, []).extend(lines)


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """Print the lines."""
    lines = _lines(config) + config.stash.get(_HANDED, [])
    if lines:
        terminalreporter.section("extreme scenes")
    for line in lines:
        terminalreporter.write_line(line)
