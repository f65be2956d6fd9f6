"""Errors of studies, a class for each kind, and texts that say what is allowed."""

from __future__ import annotations

import difflib
import re
import reprlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import PurePath
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
    """A resource of the operator, such as a directory, cannot be used."""


class StoreBusy(RuntimeError):
    """Another process is computing into the same directory."""


class StoreFull(RuntimeError):
    """The disk is full: with free space, running again computes the rest.

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


class FileDiffers(RuntimeError):
    """The file of a run would differ from the computed and audited results.

    Parameters
    ----------
    run_id : of the run
    differences : what is wrong with the file, in words
    """

    def __init__(self, run_id: str, differences: Sequence[str]) -> None:
        super().__init__(run_id, differences)
        self.run_id = run_id
        self.differences = tuple(differences)

    def __str__(self) -> str:
        first, more = "; ".join(self.differences[:3]), len(self.differences) - 3
        listed = first + (f"; and {more} more differences" if more > 0 else "")
        return f"the file would differ from the computed results, and is not kept: {listed}"


class CatalogueDamaged(RuntimeError):
    """The catalogue cannot be used; the next computation makes it again from the runs."""


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


_PATH = re.compile(r"""(?<![^\s'"(\[<=,])(?:(?<=')/[^']+|(?<=")/[^"]+|/[\w.][^\s'",;:)\]>]*)""")


def without_folders(text: str) -> str:
    """Return a text with the last part of each absolute path in place of the path.

    Messages of runs and studies go to others, who need not know the folders of this machine.
    """
    return _PATH.sub(lambda path: PurePath(path[0]).name, text)


_WORDS = {
    "missing": "must be given",
    "float_type": "must be a number",
    "float_parsing": "must be a number",
    "int_type": "must be an integer",
    "int_from_float": "must be an integer",
    "int_parsing": "must be an integer",
    "bool_type": "must be true or false",
    "string_type": "must be a text",
    "finite_number": "must be finite",
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "dict_type": "must be a table",
    "tuple_type": "must be a list",
    "literal_error": "must be {expected}",
    "enum": "must be {expected}",
    "extra_forbidden": "is not known here",
    "greater_than": "must be greater than {gt:g}",
    "greater_than_equal": "must be at least {ge:g}",
    "less_than": "must be less than {lt:g}",
    "less_than_equal": "must be at most {le:g}",
    "string_too_long": "must have at most {max_length} characters",
    "too_short": "must have {min_length} or more",
    "too_long": "must have at most {max_length}",
    "string_pattern_mismatch": "must match {pattern}",
}
"""Type of a pydantic error -> what is allowed."""


def worded(error: Mapping[str, Any]) -> str:
    """Return what is allowed for the input of a pydantic error."""
    words = _WORDS.get(error["type"])
    return words.format(**error.get("ctx", {})) if words else str(error["msg"])
