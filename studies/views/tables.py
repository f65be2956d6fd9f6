"""Text tables of the runs of a study and of one run."""

from __future__ import annotations

import json
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, SupportsIndex

import numpy as np
import xarray as xr

from solver.derivatives.asked import named, reach
from solver.errors import ModelError
from solver.results.quantities import QUANTITIES
from solver.tensors import AXES
from studies.definition.identity import solver_hash
from studies.definition.parameters import Parameter, completed, parameters_of, plain
from studies.definition.vocabulary import LABEL_ATTRIBUTES, MISSING, OK
from studies.errors import StudyError
from studies.execution.run import StudyOutcome
from studies.kinds.kind import Kind
from studies.scenes.registry import scene_of
from studies.storage.ugrid import owns
from studies.views.columns import (
    COMPUTED,
    aligned,
    computed_text,
    in_blocks,
    or_none,
    placed,
    stacked,
    unit_of,
    value_text,
    with_unit,
)
from studies.views.elasticities import derived, elasticities
from studies.views.figures import FIGURES, Floors, worst
from studies.views.picking import each_run, flags, over_runs, sweep_axes, sweep_coordinates, varied
from studies.views.reading import open_study
from studies.views.summary import NAMED, Failed, Summary, values_text

LISTED = 100
"""Largest number of runs that a report lists; `residua show` prints all."""
_NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.]*[A-Za-z_])")
"""A number in a message, not the digits of a name."""
_COLUMNS = ("body", "tip", "stage")
"""Dimensions of which each place of a figure has a column."""
_AUDIT = "audit_"
_AWAY = "audit_plastic_strain"
_MARK = "*"
FOOTNOTE = (
    f"\n{_MARK} taken at a singular point, where strain is unbounded: the number depends on the "
    "mesh and need not\n  converge as the mesh is refined\n"
)


class RunCells(NamedTuple):
    """The texts of a table of runs.

    Attributes
    ----------
    headings, units, rows : a text for each column
    keys, words : number of the first columns that tell where a run is; of those that are words
    marked : whether some number was taken at a singular point, and has a mark
    """

    headings: list[str]
    units: list[str]
    rows: list[list[str]]
    keys: int
    words: int
    marked: bool


def runs_table(dataset: xr.Dataset) -> str:
    """Return a line for each run: its values of the sweep, its status, its main figures.

    The labels of a linked axis are followed by the parameters they set. Residual stress and plastic
    strain are those after unloading. Increments, and cut increments if there are any, show how hard
    the run was to solve. Numbers taken at a singular point are marked.
    """
    cells = run_cells(dataset)
    units = [with_unit("", each) for each in cells.units]
    lines = [*stacked(cells.headings), units, *cells.rows]
    table = in_blocks(lines, cells.keys, right=cells.words)
    return f"{table}\n{FOOTNOTE}" if cells.marked else table


def run_cells(dataset: xr.Dataset) -> RunCells:
    """Return the texts of `runs_table`."""
    places = varied(dataset)
    keys = sum(name == axis for name, axis in places.items())
    figures = list(_figures(dataset))
    headings = [
        *(name.replace("_", " ") for name in places),
        "status",
        *(heading for heading, *_ in figures),
    ]
    units: list[str] = [unit_of(dataset[name]) for name in places]
    units += ["", *(unit_of(each) for _, each, _ in figures)]
    status = dataset["status"].to_numpy()
    floors = _floors(each for _, each, _ in figures)
    cells = [_cells(_clean(each, floors), spoiled) for _, each, spoiled in figures]
    rows: list[list[str]] = []
    for at, place in each_run(dataset, places):
        where = map(value_text, place.values())
        rows.append([*where, str(status[at]), *(str(each[at]) for each in cells)])
    marked = any(bool(spoiled.any()) for *_, spoiled in figures)
    return RunCells(headings, units, rows, keys, len(places) + 1, marked)


def _floors(variables: Iterable[xr.DataArray]) -> Floors:
    return Floors((unit_of(each), each.to_numpy()) for each in variables if each.dtype.kind == "f")


def _clean(values: xr.DataArray, floors: Floors) -> xr.DataArray:
    """Return numbers with zero for what is rounding beside others of their unit."""
    if values.dtype.kind != "f":
        return values
    return values.copy(data=floors.clean(str(values.name), unit_of(values), values.to_numpy()))


def _cells(values: xr.DataArray, spoiled: xr.DataArray) -> np.ndarray:
    """Return the texts of a column, with a mark on numbers taken at a singular point."""
    end = np.where(spoiled, _MARK, " " if spoiled.any() else "")
    texts = np.vectorize(value_text, otypes=[object])(values)
    return np.asarray(texts + end.astype(object))


def _figures(dataset: xr.Dataset) -> Iterator[tuple[str, xr.DataArray, xr.DataArray]]:
    """Yield each figure of the runs: heading, values, whether each is taken at a singular point."""
    for name in _own(dataset):
        yield name.replace("_", " "), dataset[name], _spoiled(dataset, name)
    for name, heading in FIGURES.items():
        if name not in dataset or (name == _AWAY and "singular" not in dataset.dims):
            continue
        if name == "cut_increments" and not (dataset[name] > 0).any():
            continue
        values, spoiled = _in_words(dataset[name]), _spoiled(dataset, name)
        over = [dim for dim in _COLUMNS if dim in values.dims]
        for at in np.ndindex(*(values.sizes[dim] for dim in over)):
            one = {"component": 0, **dict(zip(over, at, strict=True))}
            each = values.isel(one, missing_dims="ignore")
            words = {c: str(each[c].item()) for c in ("component", *over) if c in each.coords}
            text = heading.format(**words).replace("_", " ")
            yield text, each, spoiled.isel(one, missing_dims="ignore")


def _in_words(values: xr.DataArray) -> xr.DataArray:
    """Return a flag by its words, "-" where it has none; other values unchanged."""
    known = flags(values)
    if not known:
        return values
    words = [known.get(each, "-").replace("_", " ") for each in values.to_numpy().flat]
    return values.copy(data=np.reshape(np.array(words, dtype=object), values.shape))


def _spoiled(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """Return whether a figure was taken at a singular point; false if its position is unknown."""
    if "singular" not in dataset.dims:
        return xr.zeros_like(dataset[name], dtype=bool)
    if name == "max_plastic_strain":
        return dataset[name] > dataset[_AWAY]
    places = [axis for axis in AXES if f"singular_{axis}" in dataset]
    for axes in (places, ["s"]):
        if axes and all(f"{name}_{axis}" in dataset for axis in axes):
            off = [dataset[f"{name}_{axis}"] - dataset[f"singular_{axis}"] for axis in axes]
            far = sum((each**2 for each in off[1:]), off[0] ** 2) ** 0.5
            near = (far <= dataset["singular_radius"]).any("singular")
            return near.transpose(*dataset[name].dims)
    return xr.zeros_like(dataset[name], dtype=bool)


def _own(dataset: xr.Dataset) -> list[str]:
    """Return the outputs that a scene file declares, without places of extremes and derivatives."""
    every = over_runs(dataset)
    names = [name for name, each in every.items() if each.dtype.kind in "fiub"]
    parameters = [*_parameters(dataset), *map(str, dataset.coords)]
    known = {named(*each) for each in derived(every, parameters)}
    known |= {*LABEL_ATTRIBUTES, *map(reach, parameters)}
    own = [name for name in names if name not in known and not name.startswith(_AUDIT)
           and name not in QUANTITIES]  # fmt: skip
    ends = {f"_{axis}" for axis in AXES}
    return [name for name in own if name[-2:] not in ends or name[:-2] not in own]


def messages(dataset: xr.Dataset) -> str:
    """Return each kind of message once: outcome, text, number of runs, and their places.

    Messages that differ only in numbers are of one kind; the ranges of the numbers are shown.
    """
    status, text = (dataset[name].to_numpy() for name in ("status", "message"))
    found: dict[tuple[str, str], list[tuple[list[str], str]]] = defaultdict(list)
    for at in np.ndindex(status.shape):
        if text[at]:
            outcome = str(status[at])
            kind = "warning" if outcome == OK else outcome
            words = _NUMBER.sub("\0", str(text[at]))
            found[kind, words].append((_NUMBER.findall(str(text[at])), place_of(dataset, at)))
    return "".join(
        f"\n{kind}: {_ranged(words, [numbers for numbers, _ in runs])}\n"
        f"    {_listed([where for _, where in runs])}\n"
        for (kind, words), runs in sorted(found.items())
    )


def _ranged(words: str, numbers: Sequence[Sequence[str]]) -> str:
    """Return the text with its numbers, or with their ranges if they differ between runs."""
    every = []
    for column in zip(*numbers, strict=True):
        least, most = min(column, key=float), max(column, key=float)
        every.append(least if least == most else f"{least} to {most}")
    pieces = words.split("\0")
    return "".join(map("".join, zip(pieces, [*every, ""], strict=True)))


def _listed(places: Sequence[str]) -> str:
    """Return the number of runs, and the places of the first ones."""
    if not places[0]:
        return "the only run"
    more = f"; and {len(places) - NAMED} more" if len(places) > NAMED else ""
    runs = "1 run" if len(places) == 1 else f"{len(places)} runs"
    return f"{runs}: {'; '.join(places[:NAMED])}{more}"


def run_details(dataset: xr.Dataset) -> str:
    """Return the parameters, outcome and figures of a single run."""
    lines = [["scene", dataset.attrs["scene"]]]
    swept = {name: dataset[name].item() for name in sweep_coordinates(dataset)}
    left_out = set_by_accuracy(dataset)
    for name, value in (_parameters(dataset) | swept).items():
        own = left_out.get(name)
        text = value_text(value) if own is None else f"{own} {BY_ACCURACY}".lstrip()
        computed = f"{COMPUTED}{name}"
        if computed in dataset and flags(dataset[computed]).get(dataset[computed].item()):
            text = computed_text(text, _figure(dataset[computed]))
        lines.append([name, text])
    lines.append(["status", _figure(dataset["status"])])
    if message := str(dataset["message"].item()):
        lines.append(["message", message])
    rank = dataset["status"].ndim
    shown = {
        str(name): each
        for name, each in dataset.data_vars.items()
        if each.ndim == rank
        and name not in {"status", "message"}
        and not owns(str(name), each.dims)
    }
    floors = _floors(each for name, each in shown.items() if not name.startswith(_AUDIT))
    for name, each in shown.items():
        value = each if name.startswith(_AUDIT) else _clean(each, floors)
        lines.append([name, with_unit(_figure(value), unit_of(each))])
    return aligned(lines)


def _parameters(dataset: xr.Dataset) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(dataset.attrs.get("parameters", "{}"))
    return found


def _figure(variable: xr.DataArray) -> str:
    """Return the single value of a variable as text; a flag as its meaning."""
    return flags(variable).get(variable.item()) or value_text(variable.item())


BY_ACCURACY = "by accuracy"
"""What sets a parameter that is left out."""

_MOST = 500
"""Largest number of runs whose parameters are made: those of a scene file take a millisecond."""


def set_by_accuracy(dataset: xr.Dataset) -> dict[str, str]:
    """Return the number of each parameter that is left out as text, or its range over the runs.

    The text is empty where the number is not known: the data set is of another version of the
    solver, does not tell all parameters of its runs, as that of a search, or has too many runs.
    """
    given = _parameters(dataset)
    names = [name for name, value in given.items() if value is None]
    if not names or "accuracy" not in {*given, *dataset.coords}:
        return {}
    found: dict[str, list[Any]] = {name: [] for name in names}
    if dataset.attrs.get("solver_source") == solver_hash() and dataset["status"].size <= _MOST:
        try:
            scene = scene_of(dataset.attrs)
            known = parameters_of(scene)
            if known.keys() <= {*given, *dataset.coords}:
                for own in _runs(dataset, given, known):
                    whole = completed(scene, own)
                    for name in names:
                        found[name].append(whole[name])
        except (StudyError, ModelError):  # a scene that is not here, or of another time
            found = {name: [] for name in names}
    return {name: _range_text(numbers) for name, numbers in found.items()}


def _runs(
    dataset: xr.Dataset, given: dict[str, Any], known: dict[str, Parameter]
) -> Iterator[dict[str, Any]]:
    """Yield the parameters of each run."""
    swept = {n: axis for n, axis in sweep_coordinates(dataset).items() if n in known}
    for _, place in each_run(dataset, swept):
        own = {n: plain(or_none(each), known[n].default) for n, each in place.items()}
        yield given | own


def _range_text(numbers: list[Any]) -> str:
    texts = [value_text(each) for each in (min(numbers), max(numbers))] if numbers else []
    return " to ".join(dict.fromkeys(texts))


def summary(study: xr.Dataset | Path | str) -> Summary:
    """Return a short view of a study that is stored.

    Raises
    ------
    StudyError
        if there is no such study
    """
    if isinstance(study, Path | str):
        with open_study(study) as opened:
            return summary(opened)
    names = sweep_axes(study)
    status, message = (study[name].to_numpy() for name in ("status", "message"))
    numbers = {name: each.to_numpy() for name, each in over_runs(study).items()}
    first = next(iter(worst(numbers)), None)
    words, count = np.unique(status.astype(str), return_counts=True)
    lost = [at for at in np.ndindex(status.shape) if status[at] not in (OK, MISSING)]
    counts = dict(zip(words.tolist(), count.tolist(), strict=True))
    return Summary(
        name=str(study.attrs["title"]),
        scene=str(study.attrs["scene"]),
        status="complete" if MISSING not in counts else "not complete",
        progress=1.0 - counts.get(MISSING, 0) / status.size,
        counts=counts,
        axes={n: values_text(study[n].to_numpy().tolist(), unit_of(study[n])) for n in names},
        audit=None
        if first is None
        else (first, place_of(study, np.unravel_index(first.at, status.shape))),
        failed=[
            Failed(place=place_of(study, at), status=str(status[at]), message=str(message[at]))
            for at in lost[:NAMED]
        ],
    )


def place_of(dataset: xr.Dataset, at: Sequence[SupportsIndex]) -> str:
    """Return where the run at a position (n_axes,) of a data set is, on axes of several values."""
    here = zip(dataset["status"].dims, at, strict=True)
    several = ((str(n), k) for n, k in here if dataset.sizes[n] > 1)
    return placed({name: dataset[name].to_numpy()[k] for name, k in several})


def elasticity_table(runs: xr.Dataset) -> str:
    """Return the elasticities of the runs of a study as text; empty if there are none.

    Of several runs they are the median, and the least and the largest.
    """
    cells: dict[str, dict[str, str]] = {}
    swept = {str(name): each for name, each in runs.coords.items()}
    for of, row in elasticities(over_runs(runs), {**_parameters(runs), **swept}).items():
        for by, known in row.items():
            least, median, most = np.quantile(known, [0.0, 0.5, 1.0])
            span = f" ({least:+.2f} to {most:+.2f})" if known.size > 1 else ""
            cells.setdefault(of, {})[by] = f"{median:+.2f}{span}"
    if not cells:
        return ""
    every = list(dict.fromkeys(by for row in cells.values() for by in row))
    rows = [[of, *(row.get(by, "") for by in every)] for of, row in cells.items()]
    how = ": median (least to largest) of the runs" if runs["status"].size > 1 else ""
    table = aligned([["", *every], *rows], right=1)
    return f"\nChange in % if a parameter is 1 % larger{how}\n{table}\n"


def report_text(dataset: xr.Dataset, kind: Kind, outcome: StudyOutcome, note: str) -> str:
    """Return the runs of a study, or what it has found, and their messages; last their numbers."""
    size = dataset["status"].size
    if kind.table:
        table = kind.table(dataset) + "\n"
    else:
        table = runs_table(dataset) + "\n" if size <= LISTED else ""
    counts = ", ".join(f"{number} {status}" for status, number in outcome.counts.items())
    warned = (dataset["status"] == OK) & (dataset["message"] != "")
    warning = f"; {int(warned.sum())} with a warning" if warned.any() else ""
    ended = f"{dataset.attrs['title']}: {size} {kind.rows} ({counts}{warning})"
    noted = f"\nnote: {note}\n" if note else ""
    return f"{table}{elasticity_table(dataset)}{messages(dataset)}{noted}\n{ended}\n"
