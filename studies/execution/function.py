"""Sweep the user's own function, for instance in a notebook; nothing is stored."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import xarray as xr

from solver.errors import LimitLoad, NotConverged
from solver.late import Late
from studies.errors import StudyError

_CALLED = Late("studies.execution.workers:called")  # dask takes a second to import
_DONE, _LIMIT, _FAILED = "ok", "limit_load", "not_converged"


def sweep(
    function: Callable[..., Any], axes: Mapping[str, Sequence[Any]], *, workers: int = 1
) -> xr.Dataset:
    """Return the results of a function for every combination of values, over the axes.

    Parameters
    ----------
    function : called with one value of each axis, by name; returns a data set, or a mapping of
        names to numbers or arrays of xarray
    axes : argument of the function -> its values, which become a dimension
    workers : number of processes; with more than one the function must be picklable: it must not
        use an open file, for instance

    Returns
    -------
    xarray.Dataset : with ``status``, which is ok, limit_load or not_converged; results of failed
        calls are NaN, and ``message`` has the reason

    Raises
    ------
    StudyError
        if there is no axis, or an axis has no values or one twice
    """
    values = {name: list(given) for name, given in axes.items()}
    for name, own in values.items():
        if not own or len(set(own)) < len(own):
            raise StudyError(f"axes.{name}", own, "must be one value or more, each of them once")
    if not values:
        raise StudyError("axes", dict(axes), "must be one or more")
    combined = itertools.product(*values.values())
    points = [dict(zip(values, point, strict=True)) for point in combined]
    calls = [partial(_run, function, point) for point in points]
    found = _CALLED(calls, workers) if workers > 1 else [call() for call in calls]
    runs: list[Any] = [
        xr.Dataset(dict(result)).assign(status=status, message=message)
        for result, status, message in found
    ]
    for own in reversed(list(values.values())[1:]):  # lists of lists, the last axis innermost
        runs = [runs[k : k + len(own)] for k in range(0, len(runs), len(own))]
    together = xr.combine_nested(
        runs, list(values), join="outer", data_vars="all", coords="minimal", compat="override"
    )
    return together.assign_coords(values).transpose(*values, ...)


def _run(function: Callable[..., Any], point: Mapping[str, Any]) -> tuple[Any, str, str]:
    """Return the result of the function at a point, its status and its message."""
    try:
        return function(**point), _DONE, ""
    except LimitLoad as error:
        return {}, _LIMIT, str(error)
    except NotConverged as error:
        return {}, _FAILED, str(error)
