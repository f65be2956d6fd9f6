"""Marks of expensive tests; ``make check`` runs the tests without a mark.

``solves`` is for tests that compute a state of a model, ``processes`` for tests that start another
process, ``pages`` for tests that run the code of a page or an example, which may do both.

``long`` is for tests of a figure that take more than 4 s of CPU, make the claim of a neighbour for
one more case, or start services and wait for more than 10 s, and have a quicker neighbour which
runs the same code: ``make test`` and ``make check`` leave them out, ``make stress`` runs them.

In the folders `UNDIVIDED` a test without the mark ``divides`` solves in the increments that it
gives, which takes half the time. In all others the program divides them as for its users.
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path
from pkgutil import resolve_name
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

UNDIVIDED = ("solver", "studies", "verification")
"""Folders whose tests need the mark ``divides``; all other tests have it."""

EXPENSIVE = {
    "solves": ("solver.loading.increment.Increment.solve", "solver.rolling.search.passing"),
    "processes": (
        "subprocess.Popen.__init__",
        "multiprocessing.process.BaseProcess.start",
        "tests.programs.Programs.run",
        "studies.execution.run._Work.compute",
    ),
}
"""Functions that only tests with a mark may call, by mark. `_Work.compute` is among them because
workers start in a thread, where a refusal would hang."""

CHEAP = ("git", "uname")
"""Commands that any test may run: they report on project and machine in milliseconds."""

ANY = 1.0
"""Error of an increment, over the yield stress, that none has."""

_START = subprocess.Popen.__init__


def of_folder(path: Path) -> tuple[str, ...]:
    """Return the marks that a test file has by its folder."""
    folder = path.relative_to(HERE).parts[0]
    return (*FOLDERS.get(folder, ()), *(() if folder in UNDIVIDED else ("divides",)))


@contextmanager
def allowed(marks: set[str]) -> Iterator[None]:
    """Refuse to solve, to divide increments and to start processes, except as marks allow."""
    with pytest.MonkeyPatch.context() as patch:
        if "divides" not in marks and "solves" in marks:
            undivided(patch)
        for mark in EXPENSIVE.keys() - marks if "pages" not in marks else ():
            for owner, name in owners(mark):
                patch.setattr(owner, name, refusal(mark))
        yield


@cache
def owners(mark: str) -> list[tuple[Any, str]]:
    """Return the modules and classes that have the functions of a mark, with their names."""
    parted = (name.rpartition(".") for name in EXPENSIVE[mark])
    return [(resolve_name(owner), name) for owner, _, name in parted]


def undivided(patch: pytest.MonkeyPatch) -> None:
    """Take the limit of the error of an increment from all that is solved."""
    from solver.loading import stepper  # loads the solver

    make = stepper.Stepper.__init__

    def given(own: Any, system: Any, control: Any, *arguments: Any) -> None:
        error = max(control.increment_error, ANY)
        make(own, system, replace(control, increment_error=error), *arguments)

    patch.setattr(stepper, "INCREMENT_ERROR", ANY)
    patch.setattr(stepper.Stepper, "__init__", given)


def refusal(mark: str) -> Callable[..., None]:
    """Return a function that fails the calling test, except for the commands `CHEAP`."""

    def refuse(*arguments: Any, **named: Any) -> None:
        if isinstance(arguments[0], subprocess.Popen) and arguments[1][0] in CHEAP:
            _START(*arguments, **named)
        else:
            pytest.fail(f"only tests with the mark `{mark}` may do this")

    return refuse
