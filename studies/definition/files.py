"""Read study files, and the files of points, curves and sections that they name."""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from solver.errors import ModelError
from studies.errors import StudyError
from studies.scenes.formats import FORMATS
from studies.toml import CASE, read_given, read_toml

_MAY_NAME_FILES, _OF_POINTS = ("parameters", "points", "sweep"), (".csv", ".txt")
_LONGEST_CHAIN = 20
"""Largest number of study files that extend one another."""
_DECIMAL_COMMA = re.compile(r"[+-]?(?:[0-9]+,[0-9]*|,[0-9]+)(?:[eE][+-]?[0-9]+)?")


def read_study(
    path: Path | str, measured: Sequence[Path] = (), chain: int = _LONGEST_CHAIN
) -> dict[str, Any]:
    """Return the tables of a study file.

    ``[points] file = "tests.csv"`` names a table beside the study, and so does an axis of the sweep
    that has this entry: see `read_table`. A value of a parameter that ends in ``.csv`` or ``.txt``
    names the points of a curve, one with the ending of a mesh file (`FORMATS`) the mesh of a
    section. ``[fit] measured`` names tables of measured lines. The study that this one ``extends``
    may be a file. What is in the files takes their place, so that the content of a study needs no
    other file.

    Parameters
    ----------
    path : of the study
    measured : tables of measured lines, in place of those that a fit names; the place of one on
        other dimensions may be behind its name: ``crater.csv@stage=unloaded,pass=2``
    chain : largest number of studies in files that it extends, one by the other

    Raises
    ------
    StudyError
        for ``file``, when the study cannot be read or is no TOML; for the place that names another
        file which cannot be read; for ``extends``, when files extend one another in a circle
    """
    tables, folder = read_toml(path, "file"), Path(path).parent
    if "bodies" in tables and "scene" not in tables:
        name = Path(path).name
        allowed = f'is a scene file, not a study: a study has the line scene = "{name}"'
        raise StudyError("file", str(path), allowed)
    if "points" in tables:
        tables["points"] = _with_table(tables["points"], "points", folder)
    if isinstance(sweep := tables.get("sweep"), dict):
        for name in sweep:
            sweep[name] = _with_table(sweep[name], f"sweep.{name}", folder)
    if measured and not isinstance(tables.setdefault("fit", {}), dict):
        raise StudyError("fit", tables["fit"], "must be a table")
    if isinstance(fit := tables.get("fit"), dict):
        if measured:
            fit["measured"] = [_at_place(str(each), "--measured") for each in measured]
        elif "measured" in fit:
            lines = fit["measured"] if isinstance(fit["measured"], list) else [fit["measured"]]
            fit["measured"] = [
                _with_rows(each, f"fit.measured[{k}]", folder) for k, each in enumerate(lines)
            ]
    before = tables.get("extends")
    if isinstance(before, str) and before.endswith(".toml"):
        if not chain:
            allowed = f"extends a study that extends it, or more than {_LONGEST_CHAIN}"
            raise StudyError("extends", before, allowed)
        theirs: Any = read_study(folder / before, (), chain - 1)
        tables["extends"] = theirs
        while isinstance(theirs, dict):  # the scenes of all are beside their files
            if str(theirs.get("scene", "")).endswith(".toml"):
                theirs["scene"] = str(Path(before).parent / theirs["scene"])
            theirs = theirs.get("extends")
    for table in _MAY_NAME_FILES:
        if table in tables:
            tables[table] = _with_files(tables[table], table, folder)
    return tables


def _with_table(axis: Any, field: str, folder: Path) -> Any:
    """Return the rows of a file of points in place of its name."""
    if not isinstance(axis, dict) or not isinstance(axis.get("file"), str):
        return axis
    for key in axis.keys() - {"file"}:
        raise StudyError(f"{field}.{key}", axis[key], "must be in the file, or left out")
    return read_table(folder / axis["file"], f"{field}.file")


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


def _with_files(value: Any, field: str, folder: Path) -> Any:
    """Return a value with what is in files in place of their names; that of a case is none."""
    if isinstance(value, dict):
        return {
            key: each
            if key == CASE and isinstance(each, str)
            else _with_files(each, f"{field}.{key}", folder)
            for key, each in value.items()
        }
    if isinstance(value, list):
        return [_with_files(each, f"{field}[{k}]", folder) for k, each in enumerate(value)]
    if not isinstance(value, str) or not value.endswith((*_OF_POINTS, *FORMATS)):
        return value
    try:
        if value.endswith(_OF_POINTS):
            from solver.rolling.rail.profiles.points import read_points  # loads numpy

            return read_points(folder / value).T.tolist()
        from studies.scenes.meshfile import MeshFile  # loads scipy

        return MeshFile(value, read_given(folder / value, field)).section()
    except ModelError as error:
        raise StudyError(field, value, f"{error.field} {error.allowed}") from None
