"""Files of measured lines, which take the place of their names in a study."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from studies.definition.rows import read_table
from studies.errors import StudyError
from studies.toml import CASE


def with_files(content: Any, folder: Path, given: Sequence[Path]) -> Any:
    """Return a fit with the rows of its measured lines.

    Parameters
    ----------
    content : the entry of a study; None if it has none
    folder : of the study
    given : tables, in place of those that the fit names; the place of one on other dimensions may
        be behind its name: ``crater.csv@stage=unloaded,pass=2``
    """
    if given and not isinstance(content := {} if content is None else content, dict):
        raise StudyError("fit", content, "must be a table")
    if given:
        return content | {"measured": [_at_place(str(each), "--measured") for each in given]}
    if not isinstance(content, dict) or "measured" not in content:
        return content
    lines = content["measured"] if isinstance(content["measured"], list) else [content["measured"]]
    every = [_with_rows(each, f"fit.measured[{k}]", folder) for k, each in enumerate(lines)]
    return content | {"measured": every}


def _with_rows(line: Any, field: str, folder: Path) -> Any:
    """Return a measured line with the rows of its file, if it names one."""
    given = {"file": line} if isinstance(line, str) else line
    if not isinstance(given, dict) or not isinstance(given.get("file"), str):
        return line
    rest = {key: value for key, value in given.items() if key != "file"}
    return rest | {"rows": read_table(folder / given["file"], field)}


def _at_place(text: str, field: str) -> dict[str, Any]:
    """Return the rows of a measured line, and its place, which may be behind the file's name."""
    signs = [k for k in range(len(text) - 1, 0, -1) if text[k] == "@" and "=" in text[k:]]
    # Path.is_file raises an error for a text that is too long for the name of a file
    there = (k for k in [len(text), *signs] if os.path.isfile(text[:k]))  # noqa: PTH113
    end = next(there, signs[0] if signs else len(text))  # names and folders may have these signs
    name, places = text[:end], text[end + 1 :]
    if not places:
        return {"rows": read_table(text, field)}
    at: dict[str, Any] = {}
    for each in places.split(","):
        dim, sign, value = each.partition("=")
        if not (dim and sign and value):
            raise StudyError(field, text, "must be FILE, or FILE@NAME=VALUE,NAME=VALUE")
        try:
            at[dim] = value if dim == CASE else float(value)
        except ValueError:
            at[dim] = value
    return {"rows": read_table(name, field), "at": at}
