"""What pages of studies and runs show: a part of the table, a run, its audit, what differs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from solver.audit.figures import LIMITS
from solver.scenes import Scene
from studies.definition.parameters import parameters_of
from studies.definition.vocabulary import OK
from studies.kinds.kind import Mark
from studies.views.columns import COMPUTED, computed_text, unit_text
from studies.views.figures import FIGURES, Floors, group_of, meter, varies
from studies.views.html import number
from studies.views.table import MESSAGE, NUMBERS, RUN, STATUS, Column, RunTable, column_of, varied

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
    """Return a value as the tables show it: four digits, counts all, a flag by its word."""
    value = shown(column, floors, at)
    if column.flags and value == value:
        return str(column.flags.get(int(value), value)).replace("_", " ")
    return number(int(value) if column.whole and value == value else value)


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


def chosen_run(table: RunTable, wanted: str, number: str, marks: Sequence[Mark]) -> int | None:
    """Return the position of a run: of this id, at the first mark, or with the largest number.

    Without any that succeeded it is the first that has been computed, if there is one.
    """
    at = table.columns[RUN].values == wanted
    if marks and not at.any():
        places = ((name, value) for name, (value, _, _) in marks[0].items())
        at = np.all([table.columns[name].values == value for name, value in places], axis=0)
    if at.any():
        return int(at.argmax())
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


def numbers_of(rows: Sequence[Mapping[str, Any]], scene: Scene | None) -> RunTable:
    """Return a table of the numbers of runs, the main ones first."""
    every = [row["scalars"] for row in rows]
    columns = [
        column_of(name, np.array([each.get(name) for each in every], float), group_of(name), scene)
        for name in sorted(dict.fromkeys(chain(*every)), key=rank)
    ]
    return RunTable(axes={}, columns={each.name: each for each in columns})


def numbers_shown(table: RunTable, alike: bool = True) -> list[tuple[Column, list[str]]]:
    """Return the numbers that are not of the audit, and their texts, as tables show them.

    Those that are ``alike`` in all runs may be left out.
    """
    floors, runs = floors_of(table), range(table.size)
    return [
        (each, [cell_text(each, at, floors) for at in runs])
        for each in table.numbers
        if each.group != "audit" and (alike or len(np.unique(shown(each, floors))) > 1)
    ]


def audited(table: RunTable) -> dict[str, list[dict[str, Any]]]:
    """Return the figures of the audit of a run: those with a limit of their own, and the others.

    Of the former with their limit, whether it is kept, and the length of their `meter`.
    """
    figures = [each for each in table.numbers if each.group == "audit"]
    values = [(each, float(each.values[0]), LIMITS.get(each.name)) for each in figures]
    return {
        "limited": [
            {"of": each, "value": value, "limit": most, "kept": value <= most,
             "share": meter(value, most)}
            for each, value, most in values
            if most is not None
        ],
        "others": [{"of": each, "value": value} for each, value, most in values if most is None],
    }  # fmt: skip


def parameters_shown(run: Mapping[str, Any], scene: Scene | None) -> list[dict[str, Any]]:
    """Return name, meaning, unit and value of each parameter; whether it is the scene's default."""
    known = parameters_of(scene) if scene else {}
    return [
        {
            "name": name,
            "words": known[name].description if name in known else "",
            "unit": unit_text(known[name].unit) if name in known else "",
            "value": computed_text(value, _computed(run, name)),
            "usual": name in known and known[name].default == value,
        }
        for name, value in run["parameters"].items()
    ]


def _computed(run: Mapping[str, Any], parameter: str) -> str:
    """Return the word of the parameter with which a run was computed; empty if it has none."""
    name = f"{COMPUTED}{parameter}"
    if run["scalars"].get(name) is None:
        return ""
    return str(column_of(name, np.array([run["scalars"][name]], float), "run").said[0])


MOST = 6
"""Largest number of runs that are compared."""


def compared(rows: Sequence[Mapping[str, Any]], scene: Scene | None) -> dict[str, Any]:
    """Return parameters and numbers that are not the same in all runs, with the values of each."""
    every = [{each["name"]: each for each in parameters_shown(row, scene)} for row in rows]
    found = []
    for name, each in {name: each for run in every for name, each in run.items()}.items():
        own = [run[name]["value"] if name in run else None for run in every]
        if any(value != own[0] for value in own):
            found.append({**each, "values": own})
    return {"parameters": found, "numbers": numbers_shown(numbers_of(rows, scene), alike=False)}
