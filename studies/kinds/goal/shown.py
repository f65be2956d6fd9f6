"""What a goal has found: an answer at each place of the axes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from studies.kinds.kind import Found, Mark
from studies.views.columns import or_none, unit_of, value_text, words
from studies.views.picking import each_run, sweep_coordinates
from studies.views.tables import run_cells


def found(dataset: xr.Dataset, goal: Mapping[str, Any]) -> Found:
    """Return the answers as `runs_table` has them, each with the reason of its end."""
    cells, name = run_cells(dataset), goal["parameter"]
    said = [str(each) for each in dataset["message"].to_numpy().ravel()]
    more = ["reason"] if any(said) else []
    at = cells.words
    rows = [
        [*row[:at], *([text] if more else []), *row[at:]]
        for row, text in zip(cells.rows, said, strict=True)
    ]
    low, high = map(value_text, goal["between"])
    within = f"bracket at most {value_text(100.0 * goal['within'])} % of its upper end"
    return Found(
        about=[
            f"The {words(name)} from {low} to {high} at which {_reached(goal, dataset)}; {within}."
        ],
        headings=[*cells.headings[:at], *more, *cells.headings[at:]],
        units=[*cells.units[:at], *([""] if more else []), *cells.units[at:]],
        rows=rows,
        words=at + len(more),
        marks=_places(dataset, name),
    )


def _reached(goal: Mapping[str, Any], dataset: xr.Dataset) -> str:
    """Return in words when a goal is reached."""
    if not goal.get("of"):
        return "there is no equilibrium any more"
    verbs = {"at": "is", "first_above": "is above", "first_below": "is below"}
    kind = next(each for each in verbs if each in goal)
    unit = unit_of(dataset[f"tried_{goal['of']}"])
    value = f"{value_text(goal[kind])} {unit}".rstrip()
    return f"{words(goal['of'])} {verbs[kind]} {value}"


def _places(dataset: xr.Dataset, name: str) -> list[Mark]:
    """Return where the answers of a goal are: on the axes, and of the parameter searched."""
    ends = [dataset[f"{name}{end}"].to_numpy() for end in ("", "_low", "_high")]
    marks: list[Mark] = []
    for index, at in each_run(dataset, sweep_coordinates(dataset)):
        value, low, high = (each[index].item() for each in ends)
        if np.isnan(value):
            continue
        fixed: dict[str, tuple[Any, Any, Any]] = {k: (v.item(), None, None) for k, v in at.items()}
        marks.append(fixed | {name: (value, or_none(low), or_none(high))})
    return marks
