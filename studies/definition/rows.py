"""Tables of text, such as files of points and of measured lines."""

from __future__ import annotations

import csv
import re
from pathlib import Path

from studies.errors import StudyError
from studies.toml import CASE, read_given

_DECIMAL_COMMA = re.compile(r"[+-]?(?:[0-9]+,[0-9]*|,[0-9]+)(?:[eE][+-]?[0-9]+)?")


def read_table(path: Path | str, field: str) -> list[dict[str, str]]:
    """Return the rows of a table of text, each by the heading of its columns.

    The first line has the headings. Columns are separated by comma, semicolon or tab; after a
    semicolon numbers may have a decimal comma. Lines that begin with ``#`` and those without any
    text are left out, and so is an empty cell: its row does not have this heading. A cell is text:
    whether it is a number, its parameter decides (`studies.definition.points`).

    Raises
    ------
    StudyError
        for ``field``, when the file cannot be read, has no row, or a row of another length
    """
    name = Path(path).name
    try:
        lines = read_given(path, field).decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise StudyError(field, name, "must be text in UTF-8") from None
    text = [(k, each) for k, each in enumerate(lines, 1) if each.strip() and each.strip()[0] != "#"]
    delimiter = next((each for each in ";\t" if text and each in text[0][1]), ",")
    rows = [(k, _cells(each, delimiter, k, field, name)) for k, each in text]
    (_, headings), *filled = [each for each in rows if any(each[1])] or [(0, [])]
    if not filled:
        raise StudyError(field, name, "must have a line of headings, and a line for each point")
    twice = [heading for k, heading in enumerate(headings) if heading in headings[:k]]
    if twice or "" in headings:
        allowed = f"has the heading {twice[0]!r} twice" if twice else "has a column without heading"
        raise StudyError(field, name, allowed)
    for number, row in filled:
        if len(row) != len(headings):
            allowed = f"has {len(row)} cells in line {number}, and {len(headings)} headings"
            raise StudyError(field, name, allowed)
    return [
        {key: _cell(key, text, delimiter) for key, text in zip(headings, row, strict=True) if text}
        for _, row in filled
    ]


def _cells(line: str, delimiter: str, number: int, field: str, name: str) -> list[str]:
    """Return the cells of a line of a table: a cell does not go on in the next line."""
    try:
        row = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
    except csv.Error as error:
        raise StudyError(field, name, f"must have cells in line {number}: {error}") from None
    return [cell.strip() for cell in row]


def _cell(heading: str, text: str, delimiter: str) -> str:
    """Return a cell; the decimal comma of a number becomes a point, that of a name stays."""
    number = delimiter == ";" and heading != CASE and _DECIMAL_COMMA.fullmatch(text)
    return text.replace(",", ".") if number else text
