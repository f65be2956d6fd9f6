"""Marks of expensive tests; ``make check`` runs the tests without a mark.

``solves`` is for tests that compute a state of a model, ``processes`` for tests that start another
process, ``pages`` for tests that run the code of a page or an example, which may do both.
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).parent
FOLDERS = {
    "benchmarks": ("solves", "processes"),
    "service": ("solves", "processes"),
    "stability": ("solves",),
    "verification": ("solves",),
}
"""Marks of all tests of a folder."""

LONG = {
    HERE / name
    for name in (
        "test_docs.py",
        "test_examples.py",
        "service/test_durability.py",
        "service/test_scenes.py",
        "service/test_together.py",
        "benchmarks/test_benchmarks.py",
        "stability/test_scenes.py",
        "studies/test_kill.py",
        "studies/test_own_parts.py",
        "studies/test_run.py",
        "verification/test_ball.py",
        "verification/test_coarser.py",
        "verification/test_contact_in_time.py",
        "verification/test_mutations.py",
        "verification/test_punch.py",
        "verification/test_rolling.py",
        "verification/test_rolling_elastic.py",
        "verification/test_rolling_endless.py",
        "verification/test_rolling_table.py",
        "verification/test_shakedown.py",
        "verification/test_steady_laws.py",
        "verification/test_track_ends.py",
    )
}
"""Files of more than 20 s of CPU; they start first, so that no core waits for them at the end."""

WAITING = HERE / "service"
"""A folder whose tests share processes that wait; its files start before all others, so that these
end with the last of them."""

EXPENSIVE = {
    "solves": ("solver.loading.increment.Increment.solve", "solver.steady.search.passing"),
    "processes": (
        "subprocess.Popen.__init__",
        "multiprocessing.process.BaseProcess.start",
        "studies.execution.run._Work.compute",
    ),
}
"""Functions that only tests with a mark may call, by mark. `_Work.compute` is among them because
workers start in a thread, where a refusal would hang."""

CHEAP = ("git", "uname")
"""Commands that any test may run: they report on project and machine in milliseconds."""

_START = subprocess.Popen.__init__


def of_folder(path: Path) -> tuple[str, ...]:
    """Return the marks that a test file has by its folder."""
    return FOLDERS.get(path.relative_to(HERE).parts[0], ())


def place(path: Path) -> tuple[bool, bool]:
    """Return by what the files of the test run are sorted."""
    return WAITING not in path.parents, path not in LONG


@contextmanager
def allowed(marks: set[str]) -> Iterator[None]:
    """Refuse to solve and to start processes, except as the marks of a test allow."""
    with pytest.MonkeyPatch.context() as patch:
        for mark in EXPENSIVE.keys() - marks if "pages" not in marks else ():
            for name in EXPENSIVE[mark]:
                patch.setattr(name, refusal(mark))
        yield


def refusal(mark: str) -> Callable[..., None]:
    """Return a function that fails the calling test, except for the commands `CHEAP`."""

    def refuse(*arguments: Any, **named: Any) -> None:
        if isinstance(arguments[0], subprocess.Popen) and arguments[1][0] in CHEAP:
            _START(*arguments, **named)
        else:
            pytest.fail(f"only tests with the mark `{mark}` may do this")

    return refuse
