"""What the page of a study shows: the chosen run, and the part of the table in the address."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from studies.definition.vocabulary import OK
from studies.views.figures import FIGURES, Floors, group_of, varies
from studies.views.html import number
from studies.views.table import MESSAGE, NUMBERS, RUN, STATUS, Column, RunTable, varied

ROWS = 25
"""Number of runs on a page of the table."""

SHOWN = 6
"""Number of columns of results in the table, beside the sweep and the status."""

WHERE = "where."
"""What precedes the name of a column in the address of a filtered table."""


@dataclass(frozen=True, slots=True)
class TablePart:
    """A part of a table.

    Attributes
    ----------
    columns, rows : its columns, and the positions of its runs
    found : number of runs that meet the conditions
    page, pages : its number, from 1 on, and how many there are
    sort, where : the order and the conditions, as in the address
    """

    columns: Sequence[Column]
    rows: Sequence[int]
    found: int
    page: int
    pages: int
    sort: str
    where: Mapping[str, str]


def usual(table: RunTable) -> list[Column]:
    """Return the columns of numbers that some run has, the main ones first."""
    return sorted(
        (each for each in table.numbers if not np.isnan(each.values).all()),
        key=lambda each: rank(each.name),
    )


def rank(name: str) -> tuple[int, int]:
    """Return the place of a number among others: by its group, the main ones first."""
    main = list(FIGURES)
    return NUMBERS.index(group_of(name)), main.index(name) if name in main else len(main)


def floors_of(table: RunTable) -> Floors:
    """Return what numbers of the runs are shown as 0."""
    return Floors((each.unit, each.values) for each in table.numbers if each.group != "audit")


def shown(column: Column, floors: Floors, at: Any = ...) -> Any:
    """Return the values of a column, or of some of its runs, rounding as 0."""
    values = column.values[at]
    cleaned = column.number and column.group in NUMBERS[:-1]
    return floors.clean(column.name, column.unit, values)[()] if cleaned else values


def cell_text(column: Column, at: int, floors: Floors) -> str:
    """Return a value as the tables show it: four digits, a flag by its word, rounding as 0."""
    value = shown(column, floors, at)
    if column.flags and value == value:
        return str(column.flags.get(int(value), value)).replace("_", " ")
    return number(value)


def part(table: RunTable, query: Mapping[str, str]) -> TablePart:
    """Return the part of a table that the address of a page names.

    Raises
    ------
    StudyError
        if it names a column that is not there, or a condition that the column cannot meet
    """
    where = {
        name.removeprefix(WHERE): value.strip()
        for name, value in query.items()
        if name.startswith(WHERE) and value.strip()
    }
    sort = query.get("sort", "")
    found = table.chosen(sort, where)
    pages = max(1, -(-len(found) // ROWS))
    number = query.get("page", "1")
    page = min(max(int(number[:9]), 1), pages) if number.isdecimal() else 1
    differ = [each.name for each in usual(table) if varies(each.values)]
    named = differ[:SHOWN]
    extra = [sort.removeprefix("-"), query.get("number", ""), *where]
    fresh = [n for n in dict.fromkeys(extra) if n in table.columns and n not in (RUN, MESSAGE)]
    first = [*(each.name for each in varied(table)), STATUS]
    names = dict.fromkeys([*first, *named, *fresh])
    rows = found[(page - 1) * ROWS : page * ROWS].tolist()
    columns = [table.columns[name] for name in names]
    return TablePart(columns, rows, len(found), page, pages, sort, where)


def chosen_run(table: RunTable, wanted: str, number: str) -> int | None:
    """Return the position of a run: of this id, or the one with the largest number.

    Without any that succeeded it is the first that has been computed, if there is one.
    """
    ids = table.columns[RUN].values
    at = np.flatnonzero(ids == wanted)
    if len(at):
        return int(at[0])
    status = table.columns[STATUS].values
    column = table.columns.get(number)
    values = column.values if column is not None and column.number else np.zeros(table.size)
    known = np.where(status == OK, values, np.nan)
    if not np.isnan(known).all():
        return int(np.nanargmax(known))
    computed = np.flatnonzero(status != "pending")
    return int(computed[0]) if len(computed) else None


def described(table: RunTable) -> dict[str, Any]:
    """Return what the scripts of the page need to know of a table.

    The numbers of points are no place: what the points set is.
    """
    sweep = {name for name, each in table.columns.items() if each.group == "sweep"}
    linked = sweep > {*table.axes}
    points = [
        name for name, labels in table.axes.items() if linked and [*labels] == [*range(len(labels))]
    ]
    return {
        "size": table.size,
        "axes": [
            {**_said(table.columns[name]), "labels": list(labels)}
            for name, labels in table.axes.items()
        ],
        "grid": bool(table.axes) and not points,
        "places": [_said(each) for each in varied(table) if each.name not in points],
        "numbers": [
            {
                **_said(each),
                "group": each.group,
                "varies": varies(each.values),
                "flags": {str(code): word for code, word in each.flags.items()},
            }
            for each in usual(table)
        ],
    }


def _said(column: Column) -> dict[str, Any]:
    """Return name, meaning and unit of a column, and whether it has numbers."""
    return {name: getattr(column, name) for name in ("name", "words", "unit", "number")}
