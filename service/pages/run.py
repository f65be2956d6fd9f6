"""What pages of runs show: parameters, numbers, the audit in words, and what differs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np

from service.pages.study import cell_text, floors_of, rank, shown
from solver.audit.figures import LIMITS
from solver.scenes import Scene
from studies.definition.parameters import parameters_of
from studies.views.columns import COMPUTED, computed_text, unit_text
from studies.views.figures import group_of, meter
from studies.views.table import Column, RunTable, column_of


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
