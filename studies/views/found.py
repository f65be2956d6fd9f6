"""What a study that chooses its runs has found, as a table and as marks over what it sets.

Of a goal it is an answer at each place of the axes, of a fit its parameters, of a refinement the
errors that are left.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from studies.definition.cells import ERROR
from studies.views.columns import or_none, unit_text, value_text
from studies.views.fits import fit_rows, measures
from studies.views.picking import sweep_axes, sweep_coordinates
from studies.views.tables import run_cells

Mark = Mapping[str, tuple[Any, Any, Any]]
"""A place by parameter: value, and lower and upper end of what is known of it, or None."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What was found.

    Attributes
    ----------
    about : what was asked for, and how the work ended, a sentence each
    warning : what makes it doubtful; empty if nothing does
    headings, units, rows : a table; its texts for each column
    words : number of the first columns that are words
    marks : a place for each answer that has one
    """

    about: Sequence[str]
    headings: Sequence[str]
    units: Sequence[str]
    rows: Sequence[Sequence[str]]
    words: int
    marks: Sequence[Mark] = ()
    warning: str = ""


def found_of(dataset: xr.Dataset) -> Found | None:
    """Return what the study of a data set has found; None if it chose no runs."""
    for entry, told in {"goal": _goal, "fit": _fit, "refine": _refined}.items():
        if entry in dataset.attrs:
            return told(dataset, json.loads(dataset.attrs[entry]))
    return None


def _goal(dataset: xr.Dataset, goal: Mapping[str, Any]) -> Found:
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
        about=[f"The {_words(name)} from {low} to {high} at which {_reached(goal)}; {within}."],
        headings=[*cells.headings[:at], *more, *cells.headings[at:]],
        units=[*cells.units[:at], *([""] if more else []), *cells.units[at:]],
        rows=rows,
        words=at + len(more),
        marks=_places(dataset, name),
    )


def _reached(goal: Mapping[str, Any]) -> str:
    """Return in words when a goal is reached."""
    if not goal.get("of"):
        return "there is no equilibrium any more"
    words = {"at": "is", "first_above": "is above", "first_below": "is below"}
    kind = next(each for each in words if each in goal)
    return f"{_words(goal['of'])} {words[kind]} {value_text(goal[kind])}"


def _places(dataset: xr.Dataset, name: str) -> list[Mark]:
    """Return where the answers of a goal are: on the axes, and of the parameter searched."""
    axes = sweep_coordinates(dataset)
    at = {each: dataset[each].to_numpy() for each in axes}
    ends = [dataset[f"{name}{end}"].to_numpy() for end in ("", "_low", "_high")]
    marks: list[Mark] = []
    for index in np.ndindex(ends[0].shape):
        value, low, high = (each[index].item() for each in ends)
        if np.isnan(value):
            continue
        place = dict(zip(sweep_axes(dataset), index, strict=True))
        own = {each: values[place[axes[each]]].item() for each, values in at.items()}
        fixed: dict[str, tuple[Any, Any, Any]] = {k: (v, None, None) for k, v in own.items()}
        marks.append(fixed | {name: (value, or_none(low), or_none(high))})
    return marks


def _fit(dataset: xr.Dataset, _: Mapping[str, Any]) -> Found:
    """Return the parameters of a fit with what is known of them."""
    headings, *rows = fit_rows(dataset)
    place = {}
    for name in map(str, dataset["parameter"].to_numpy()):
        value, sigma = dataset[name].item(), dataset[f"{name}_sigma"].item()
        ends = (None, None) if np.isnan(sigma) else (value - sigma, value + sigma)
        place[name] = (value, *ends)
    return Found(
        about=[f"{measures(dataset)}; marks are drawn with one sigma."],
        warning=str(dataset["message"].item()),
        headings=headings,
        units=[""] * len(headings),
        rows=[[*row[:-1], unit_text(row[-1])] for row in rows],
        words=1,
        marks=[] if any(np.isnan(value) for value, *_ in place.values()) else [place],
    )


def _refined(dataset: xr.Dataset, refine: Mapping[str, Any]) -> Found:
    """Return the errors that a refinement has left in its cells."""
    count = Counter(dataset["cell_state"].to_numpy().astype(str).tolist())
    states = ", ".join(f"{number} {state}" for state, number in count.most_common())
    numbers = [n.removeprefix(ERROR) for n in map(str, dataset.data_vars) if ERROR in n]
    rows = []
    for name in numbers:
        left, values = dataset[f"{ERROR}{name}"].max().item(), dataset[name]
        width = values.max().item() - values.min().item()
        unit = unit_text(values.attrs.get("units"))
        share = 100.0 * left / width if width > 0.0 else np.nan
        rows.append([_words(name), value_text(left), unit, value_text(share)])
    until = refine["until"]
    if isinstance(until, Mapping):
        miss = ", ".join(f"{_words(name)} by {value_text(each)}" for name, each in until.items())
    else:
        miss = f"a number by {value_text(100.0 * until)} % of its range"
    return Found(
        about=[
            f"{dataset.sizes['cell']} cells: {states}.",
            f"A cell is divided where its runs miss {miss} or more.",
        ],
        headings=["number", "largest error left", "unit", "of its range"],
        units=["", "", "", "%"],
        rows=rows,
        words=1,
    )


def _words(name: str) -> str:
    return name.replace("_", " ")
