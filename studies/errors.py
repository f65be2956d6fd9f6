"""What can go wrong with a study, told apart; words for what is allowed."""

from __future__ import annotations

import difflib
import reprlib
from collections.abc import Iterable, Sequence
from typing import Any


class StudyError(ValueError):
    """Bad input: which field, which value, what is allowed.

    Parameters
    ----------
    field : dotted name of the offending input (``"sweep.friction[2]"``)
    value : what was given
    allowed : what would have been accepted, in words
    """

    def __init__(self, field: str, value: object, allowed: str) -> None:
        field = field.encode("utf-8", "backslashreplace").decode()  # JSON may hold lone surrogates
        super().__init__(f"{field} = {reprlib.repr(value)}: {allowed}")
        self.field = field
        self.value = value
        self.allowed = allowed

    def __reduce__(self) -> tuple[type[StudyError], tuple[str, object, str]]:
        return type(self), (self.field, self.value, self.allowed)


class SceneError(StudyError):
    """A scene file with mistakes: all of them, each with its field, value and what is allowed.

    Parameters
    ----------
    name : of the file
    mistakes : one or more
    """

    def __init__(self, name: str, mistakes: Sequence[StudyError]) -> None:
        count = f"{len(mistakes)} mistakes" if len(mistakes) > 1 else "a mistake"
        listed = "".join(f"\n  {each}" for each in mistakes)
        super().__init__("scene", name, f"has {count}:{listed}")
        self.name = name
        self.mistakes = tuple(mistakes)

    def __reduce__(self) -> tuple[type[SceneError], tuple[str, tuple[StudyError, ...]]]:  # type: ignore[override]
        return type(self), (self.name, self.mistakes)


class Unusable(StudyError):
    """What the operator provides cannot be used now, such as a directory; no study is at fault."""


class StoreBusy(RuntimeError):
    """Another process is computing into the same directory."""


class StoreFull(RuntimeError):
    """No room is left for results: running again computes the rest, once there is some.

    Parameters
    ----------
    directory : where results were to be written
    """

    def __init__(self, directory: str) -> None:
        super().__init__(directory)
        self.directory = directory

    def __str__(self) -> str:
        return f"no room is left in {self.directory}"


class RunUnreadable(RuntimeError):
    """The file of a run is absent, damaged, or not the file of this run.

    Parameters
    ----------
    run_id : of the run
    reason : what is wrong with its file
    """

    def __init__(self, run_id: str, reason: str) -> None:
        super().__init__(run_id, reason)
        self.run_id = run_id
        self.reason = reason

    def __str__(self) -> str:
        return f"run {self.run_id} cannot be read: {self.reason}"


class CatalogueDamaged(RuntimeError):
    """The catalogue cannot be used; whoever computes next makes it anew from the runs."""


class GridLost(ConnectionError):
    """The scheduler could not be reached or forgot its tasks; running again computes the rest."""


def one_of(name: Any, names: Iterable[str]) -> str:
    """Return what is allowed in place of `name`: one of `names`, the nearest of them last."""
    known = list(dict.fromkeys(names))
    return f"must be one of {', '.join(known) or '(there is none)'}{nearest(name, known)}"


def nearest(name: Any, names: Iterable[str]) -> str:
    """Return ``"; did you mean …?"`` when one of `names` resembles `name`, else nothing."""
    matches = difflib.get_close_matches(str(name), list(names), n=1)
    return f"; did you mean {matches[0]}?" if matches else ""
