"""Read and write TOML files of studies and scenes."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from itertools import accumulate, chain
from pathlib import Path
from typing import Any

from solver.files import read_file
from studies.errors import StudyError

DEEPEST = 50
"""Largest number of tables and lists inside one another."""

CASE = "case"
"""Key by which points have names: a coordinate of the data set, never a parameter."""

_TEXT = re.compile(
    r""""{3}(?:\\.|[^\\])*?(?:"{3,5}|\Z)|'{3}.*?(?:'{3,5}|\Z)"""
    r"""|"(?:\\.|[^"\\\n])*+"?|'[^'\n]*+'?|\#[^\n]*+""",
    re.DOTALL,
)
_KEY = re.compile(rf"(?<![\w-])(?:[\w-]++[ \t]*+\.[ \t]*+){{{DEEPEST}}}")
_BARE = re.compile(r"[\w-]+", re.ASCII)
_STEP = {"[": 1, "{": 1, "]": -1, "}": -1}


def read_given(path: Path | str, field: str) -> bytes:
    """Return the content of a file that a user names.

    Raises
    ------
    StudyError
        for ``field``, when it is a device or a pipe, too large, or cannot be read
    """
    try:
        return read_file(path)
    except OSError as error:
        raise StudyError(field, str(path), f"must be a file to read: {error.strerror}") from None


def check_depth(text: str) -> None:
    """Raise `ValueError` for a text of TOML or JSON that nests more than `DEEPEST` lists or tables.

    The time of a parser may grow with the square of the parts of a dotted key, and one that calls
    itself for each bracket may end the process. So this is found before anything is parsed.
    """
    bare = _TEXT.sub("s", text)
    levels = max(accumulate(map(_STEP.__getitem__, re.findall(r"[][{}]", bare))), default=0)
    if levels > DEEPEST or _KEY.search(bare):
        found = f"lists or tables {levels}" if levels > DEEPEST else f"keys over {DEEPEST} tables"
        raise ValueError(f"it has {found} deep; at most {DEEPEST} are allowed")


def depth(content: Any) -> int:
    """Return how many lists and tables are inside one another; an empty one counts for nothing."""
    found, level = -1, [content]
    while level:
        found += 1
        tables = [each for each in level if isinstance(each, dict | list)]
        inside = (each.values() if isinstance(each, dict) else each for each in tables)
        level = list(chain.from_iterable(inside))
    return found


def read_toml(path: Path | str, field: str) -> dict[str, Any]:
    """Return the tables of a TOML file.

    Raises
    ------
    StudyError
        for ``field``, when the file cannot be read or is no TOML
    """
    return toml_of(read_given(path, field), field, str(path))


def toml_of(data: bytes, field: str, name: str) -> dict[str, Any]:
    """Return the tables of a TOML text; a date is text.

    Raises
    ------
    StudyError
        for ``field`` with the value ``name``, if the text is not TOML
    """
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        allowed = f"must be saved as UTF-8, which line {line} is not"
        raise StudyError(field, name, allowed) from None
    try:
        check_depth(text)
        tables = tomllib.loads(text)
        if (levels := depth(tables)) > DEEPEST:
            raise ValueError(f"it has lists or tables {levels} deep; at most {DEEPEST} are allowed")
        plain: dict[str, Any] = json.loads(json.dumps(tables, default=str))
    except ValueError as error:
        raise StudyError(field, name, f"must be valid TOML: {error}") from None
    return plain


def toml_text(value: Any) -> str:
    """Return a value as TOML on one line, which is JSON but for tables."""
    if isinstance(value, Mapping):
        entries = (f"{_key(name)} = {toml_text(each)}" for name, each in value.items())
        return "{" + ", ".join(entries) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml_text, value)) + "]"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def toml_file(content: Mapping[str, Any]) -> str:
    """Return the text of a TOML file with this content, an entry a line."""
    return "".join(f"{_key(name)} = {toml_text(each)}\n" for name, each in content.items())


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else toml_text(name)
