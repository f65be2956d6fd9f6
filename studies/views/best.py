"""The numbers of the runs of a data set: as a table, and the runs in the order of one of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from studies.definition.vocabulary import OK
from studies.errors import StudyError
from studies.views.columns import in_blocks, meaning_of, stacked, unit_of, value_text, with_unit
from studies.views.figures import group_of
from studies.views.picking import flags, sweep_axes, sweep_coordinates, varied
from studies.views.plots.fields import sweep_fields, wide_fields
from studies.views.table import STATUS, Column, RunTable, one_number


def table_of(dataset: xr.Dataset) -> RunTable:
    """Return the table of a data set: its runs in the order of its dimensions, the last fastest.

    Its columns are what distinguishes the runs, the status, and all variables with one value a run.
    """
    axes = {name: dataset[name].to_numpy().tolist() for name in sweep_axes(dataset)}
    columns = {each.name: each for each in _columns(dataset)}
    return RunTable(axes=axes, columns=columns, wide=wide_fields(dataset))


def _columns(dataset: xr.Dataset) -> Iterator[Column]:
    status = dataset[STATUS]
    for name in sweep_coordinates(dataset):
        yield _column(dataset[name], status, "sweep")
    for name in sweep_fields(dataset):
        yield _column(dataset[name], status, "run" if name == STATUS else group_of(name))


def _column(values: xr.DataArray, status: xr.DataArray, group: str) -> Column:
    """Return a column with a value for each run, also of a variable that not all axes change."""
    whole = values if values.dims == status.dims else xr.broadcast(values, status)[0]
    return column_over(values, whole.transpose(*status.dims).to_numpy().ravel(), group)


def column_over(values: xr.DataArray, flat: np.ndarray, group: str) -> Column:
    """Return the column of a variable, with its values as they are listed in ``flat``."""
    number = flat.dtype.kind in "fiu"
    return Column(
        name=str(values.name),
        words=meaning_of(values),
        unit=unit_of(values),
        group=group,
        flags=flags(values) if number else {},
        values=flat.astype(float) if number else flat.astype(str).astype(object),
    )


def best_runs(
    dataset: xr.Dataset,
    of: str,
    where: Sequence[str] = (),
    *,
    lowest: bool = False,
    count: int = 10,
) -> list[dict[str, Any]]:
    """Return the successful runs with the highest numbers, the best first: what tells them apart.

    Each has its values on the axes that vary, what labels and points set, and the number.

    Parameters
    ----------
    dataset : data set of a study
    of : a variable with one number a run
    where : conditions such as ``"friction<0.3"`` or ``"hardening=none"``: on axes, on what labels
        and points set, or on variables with one value a run
    lowest : whether the lowest numbers come first
    count : largest number of runs

    Raises
    ------
    StudyError
        if there is no such variable, a condition has a mistake, or no run is left
    """
    known = sweep_fields(dataset)
    if of not in known or of == "status":
        others = [name for name in known if name != "status"]
        raise StudyError("of", of, one_number(of, others, wide_fields(dataset)))
    table = table_of(dataset)
    left = (table.columns[STATUS].values == OK) & ~np.isnan(table.columns[of].values)
    for text in where:
        left &= table.meeting(text)
    if not left.any():
        conditions = ", ".join(where) or "any"
        raise StudyError("where", conditions, "no run that succeeded meets this")
    places = np.argwhere(left.reshape(dataset["status"].shape))
    numbers = dataset[of].to_numpy()[tuple(places.T)]
    order = np.argsort(numbers if lowest else -numbers, kind="stable")[:count]
    axes = sweep_axes(dataset)
    there = varied(dataset)
    found = []
    for at in order:
        place = dict(zip(axes, places[at], strict=True))
        run = {name: dataset[name].to_numpy()[place[axis]] for name, axis in there.items()}
        found.append({name: each.item() for name, each in run.items()} | {of: numbers[at].item()})
    return found


def best_table(dataset: xr.Dataset, of: str, runs: Sequence[Mapping[str, Any]]) -> str:
    """Return a line for each run that `best_runs` has found."""
    meaning = flags(dataset[of])
    lines = [[meaning.get(each, "") or value_text(each) for each in run.values()] for run in runs]
    second = [with_unit("", unit_of(dataset[name])) for name in runs[0]]
    headings = [name.replace("_", " ") for name in runs[0]]
    return in_blocks([*stacked(headings), second, *lines], 1, right=len(headings) - 1)
