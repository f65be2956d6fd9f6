"""What tests cost, and may cost: ``make check`` runs those that need none of the marks.

``solves`` is for tests that compute a state of a model, ``processes`` for those that start another
process, ``pages`` for those that run what a page or an example shows, which may do both.
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
        "verification/test_punch.py",
        "verification/test_rolling.py",
        "verification/test_rolling_elastic.py",
        "verification/test_rolling_endless.py",
        "verification/test_rolling_table.py",
        "verification/test_shakedown.py",
        "verification/test_track_ends.py",
    )
}
"""Files of more than 30 s of CPU: begun first, or one core would wait for them at the end."""

DEAR = {
    "solves": ("solver.loading.increment.Increment.solve", "solver.steady.search.passing"),
    "processes": (
        "subprocess.Popen.__init__",
        "multiprocessing.process.BaseProcess.start",
        "studies.execution.run._Work.compute",
    ),
}
"""Functions that only tests with a mark may call. Workers start in a thread, which would hang."""

ASKED = ("git", "uname")
"""Commands that tell in milliseconds what the project and this machine are."""

_START = subprocess.Popen.__init__


def of_folder(path: Path) -> tuple[str, ...]:
    """Return the marks that a test file has by its folder."""
    return FOLDERS.get(path.relative_to(HERE).parts[0], ())


@contextmanager
def allowed(marks: set[str]) -> Iterator[None]:
    """Refuse to solve and to start processes, but for what the marks of a test allow."""
    with pytest.MonkeyPatch.context() as patch:
        for mark in DEAR.keys() - marks if "pages" not in marks else ():
            for name in DEAR[mark]:
                patch.setattr(name, refusal(mark))
        yield


def refusal(mark: str) -> Callable[..., None]:
    """Return a function that fails the test in which it is called, but for `ASKED`."""

    def refuse(*arguments: Any, **named: Any) -> None:
        if isinstance(arguments[0], subprocess.Popen) and arguments[1][0] in ASKED:
            _START(*arguments, **named)
        else:
            pytest.fail(f"only tests with the mark `{mark}` may do this")

    return refuse
