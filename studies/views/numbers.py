"""The numbers of the runs of a data set as a table."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from studies.views.columns import unit_text
from studies.views.figures import group_of
from studies.views.picking import flags, sweep_axes, sweep_coordinates
from studies.views.plots.fields import sweep_fields, wide_fields
from studies.views.table import STATUS, Column, RunTable


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
    whole, _ = xr.broadcast(values, status)
    return column_over(values, whole.transpose(*status.dims).to_numpy().ravel(), group)


def column_over(values: xr.DataArray, flat: np.ndarray, group: str) -> Column:
    """Return the column of a variable, with its values as they are listed in ``flat``."""
    number = flat.dtype.kind in "fiu"
    return Column(
        name=str(values.name),
        words=str(values.attrs.get("long_name", str(values.name).replace("_", " "))),
        unit=unit_text(values.attrs.get("units")),
        group=group,
        flags=flags(values) if number else {},
        values=flat.astype(float) if number else flat.astype(str).astype(object),
    )
