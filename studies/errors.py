"""Errors of studies, a class for each kind, and texts that say what is allowed."""

from __future__ import annotations

import difflib
import re
import reprlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePath
from typing import Any

from solver.errors import plain
from studies.units import is_quantity

MOST_MISTAKES, MOST_NAMES, COMPARED = 20, 10, 500
"""Number of mistakes and of names that a message lists, and of names compared with a wrong one."""

LONGEST_FIELD, LONGEST_TEXT = 200, 2000
"""Number of characters of a field, and of what is allowed, in a message."""


def cut(text: str, longest: int) -> str:
    """Return a text, or its beginning of this length."""
    return text if len(text) <= longest else f"{text[:longest]}…"


def encodable(text: str) -> str:
    """Return a text that UTF-8 can hold: lone surrogates, which JSON may have, are written out."""
    return text.encode("utf-8", "backslashreplace").decode()


class StudyError(ValueError):
    """Bad input: which field, which value, what is allowed.

    Parameters
    ----------
    field : dotted name of the offending input (``"sweep.friction[2]"``)
    value : what was given
    allowed : what would have been accepted, in words
    others : further mistakes of the same input, each in a line of its own of the text
    count : number of all mistakes, if there are more
    """

    others: tuple[StudyError, ...] = ()

    def __init__(
        self,
        field: str,
        value: object,
        allowed: str,
        others: Sequence[StudyError] = (),
        count: int = 0,
    ) -> None:
        field, allowed = cut(encodable(field), LONGEST_FIELD), cut(allowed, LONGEST_TEXT)
        value = plain(value)
        self.field, self.value, self.allowed = field, value, allowed
        self.others, self.count = tuple(others[: MOST_MISTAKES - 1]), max(count, 1 + len(others))
        super().__init__("\n".join(self.listed))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.field, self.value, self.allowed, self.others, self.count)

    @property
    def each(self) -> list[StudyError]:
        """The mistakes, this one first."""
        return [self, *self.others]

    @property
    def listed(self) -> list[str]:
        """The mistakes as text; the last one tells how many more there are."""
        more = self.count - len(self.each)
        given = ("" if e.value is None else f" = {reprlib.repr(e.value)}" for e in self.each)
        every = zip(self.each, given, strict=True)
        texts = [f"{each.field}{value}: {each.allowed}" for each, value in every]
        return [*texts, *([f"and {more} more"] if more else [])]

    def renamed(self, rename: Callable[[str], str]) -> StudyError:
        """Return the same mistakes of other fields."""
        every = [StudyError(rename(each.field), each.value, each.allowed) for each in self.each]
        return StudyError.of(every, self.count)

    def under(self, field: str) -> StudyError:
        """Return the same mistakes, of entries of a field."""
        return self.renamed(lambda own: joined(field, own)) if field else self

    @staticmethod
    def of(mistakes: Sequence[StudyError], count: int = 0) -> StudyError:
        """Return the first of one or more mistakes with the others."""
        first, *others = mistakes
        return StudyError(first.field, first.value, first.allowed, others, count)


def joined(field: str, entry: str) -> str:
    """Return the name of an entry of a field: ``sweep.friction`` or ``tags[0]``."""
    return f"{field}{'.' if field and entry and entry[0] != '[' else ''}{entry}"


class Mistakes:
    """Collects the mistakes of an input, so that all are reported."""

    def __init__(self) -> None:
        self.found: list[StudyError] = []
        self.count, self.failed = 0, False

    def add(self, field: str, error: StudyError) -> None:
        """Keep the mistakes of an entry, but for those that another mistake causes."""
        self.failed = True
        if not isinstance(error, Unchecked):
            self.found += error.under(field).each[: MOST_MISTAKES - len(self.found)]
            self.count += error.count

    @contextmanager
    def at(self, field: str = "") -> Iterator[None]:
        """Keep the mistakes of an entry that are raised."""
        try:
            yield
        except StudyError as error:
            self.add(field, error)

    @property
    def error(self) -> StudyError:
        """All of them."""
        return StudyError.of(self.found, self.count) if self.found else Unchecked()

    def report(self) -> None:
        """Raise `StudyError` if there are mistakes."""
        if self.failed:
            raise self.error


class SceneError(StudyError):
    """A scene file with mistakes: the first 20 of them, each with field, value, what is allowed.

    Parameters
    ----------
    name : of the file
    mistakes : one or more
    count : number of all mistakes, if there are more
    """

    def __init__(self, name: str, mistakes: Sequence[StudyError], count: int = 0) -> None:
        self.name = name
        self.mistakes = tuple(mistakes[:MOST_MISTAKES])
        self.count = max(count, len(mistakes))
        ValueError.__init__(self, name)
        self.field, self.value = "scene", name
        number = f"{self.count} mistakes" if self.count > 1 else "a mistake"
        self.allowed = f"has {number}:" + "".join(f"\n  {each}" for each in self.listed)

    def __str__(self) -> str:
        return f"scene = {self.name!r}: {self.allowed}"

    @property
    def each(self) -> list[StudyError]:
        """The mistakes."""
        return [*self.mistakes]

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.name, self.mistakes, self.count)


class Unchecked(StudyError):
    """An entry that cannot be checked, for another one is wrong: it is not reported."""

    def __init__(self) -> None:
        super().__init__("", None, "cannot be checked")

    def renamed(self, rename: Callable[[str], str]) -> StudyError:
        """Return itself."""
        return self


class Unusable(StudyError):
    """A resource of the operator, such as a directory, cannot be used."""


class StoreBusy(RuntimeError):
    """Another process is computing into the same directory."""


class StoreFull(RuntimeError):
    """The disk is full: with free space, running again computes the rest."""

    def __init__(self, directory: str) -> None:
        super().__init__(directory)
        self.directory = directory

    def __str__(self) -> str:
        return f"no room is left in {self.directory}"


class FileDamaged(RuntimeError):
    """A stored file is absent, damaged, or another one than its name says.

    Parameters
    ----------
    path : of the file
    name : what it should be, such as ``run <id>``
    reason : what is wrong with it
    state : of the file that was read, see `studies.storage.seal.state_of`; None if it is absent
    """

    def __init__(
        self, path: Path, name: str, reason: str, state: tuple[int, ...] | None = None
    ) -> None:
        super().__init__(path, name, reason, state)
        self.path, self.name, self.reason, self.state = path, name, reason, state

    def __str__(self) -> str:
        return f"{self.name} cannot be read: {self.reason}"


class FileDiffers(RuntimeError):
    """The file of a run would differ from the computed and audited results."""

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


def one_of(name: Any, names: Iterable[str], all_of: str = "") -> str:
    """Return what is allowed in place of `name`: one of `names`, the nearest of them last.

    ``all_of`` names what lists all, where some are left out.
    """
    known = list(dict.fromkeys(names))
    listed = ", ".join(cut(each, LONGEST_FIELD) for each in known[:MOST_NAMES])
    more = len(known) - MOST_NAMES
    listed += f" and {more} more{f' ({all_of})' if all_of else ''}" if more > 0 else ""
    return f"must be one of {listed or '(there is none)'}{nearest(name, known)}"


def nearest(name: Any, names: Iterable[str]) -> str:
    """Return ``"; did you mean …?"`` when one of `names` resembles `name`, else nothing."""
    text = name if isinstance(name, str) else ""
    matches = difflib.get_close_matches(text, list(names)[:COMPARED], n=1)
    return f"; did you mean {cut(matches[0], LONGEST_FIELD)}?" if matches else ""


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
    "string_unicode": "must be a text of Unicode",
    "finite_number": "must be finite",
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "dict_type": "must be a table",
    "list_type": "must be a list",
    "tuple_type": "must be a list",
    "enum": "must be {expected}",
    "extra_forbidden": "is not known here",
    "greater_than": "must be greater than {gt:g}",
    "greater_than_equal": "must be at least {ge:g}",
    "less_than": "must be less than {lt:g}",
    "less_than_equal": "must be at most {le:g}",
    "string_too_long": "must have at most {max_length} characters",
    "too_short": "must have {min_length} or more",
    "too_long": "must have at most {max_length}",
}
"""Type of a pydantic error -> what is allowed."""

_FORMS: dict[str, str] = {}
"""Pattern of a text -> what is allowed, as `form` declares it."""


def form(pattern: str, allowed: str) -> str:
    """Return a pattern of texts, and keep the words in which another text is refused."""
    _FORMS[pattern] = allowed
    return pattern


def worded(error: Mapping[str, Any]) -> str:
    """Return what is allowed for the input of a pydantic error."""
    words = _WORDS.get(error["type"])
    if error["type"] == "string_pattern_mismatch":
        return _FORMS.get(error["ctx"]["pattern"], str(error["msg"]))
    if error["type"] == "literal_error":
        known = [*filter(None, re.findall(r"'([^']*)'", error["ctx"]["expected"]))]
        return one_of(error["input"], known) if len(known) > 1 else f"must be {known[0]}"
    if error["type"] in ("float_type", "int_type") and is_quantity(error["input"]):
        return f"{words} without a unit: in N, mm, MPa, t, s, K, degrees"
    return words.format(**error.get("ctx", {})) if words else str(error["msg"])
