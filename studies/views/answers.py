"""A number between the runs of a study, its error, and the run that would tell it exactly."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import xarray as xr

from solver.parameters import is_number
from studies.definition.parameters import Parameter, parameters_of
from studies.definition.study import Study
from studies.definition.vocabulary import OK
from studies.errors import StudyError
from studies.storage.store import Store
from studies.views.picking import sweep_axes
from studies.views.plots.fields import wide_fields
from studies.views.predict import predict
from studies.views.table import one_number

RUN = "run"
"""Way of an answer that is no prediction: there is a run at its place."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NumberBetween:
    """A number at a place.

    Attributes
    ----------
    of, value, error, unit : the number and its error: by ``gaussian`` a standard deviation, by
        ``cells`` the error of the cell, by ``run`` 0
    by : how it was found: ``cells`` or ``gaussian`` (`predict`), or ``run``
    at : the parameters of the place that the study varies
    run : the run at this place, as a study
    enough : whether the error is as small as was asked for
    """

    of: str
    value: float
    error: float
    unit: str
    by: str
    at: Mapping[str, Any]
    run: Study
    enough: bool


def answer(
    dataset: xr.Dataset,
    study: Study,
    store: Store,
    of: str,
    at: Mapping[str, Any],
    *,
    by: str | None = None,
    within: float | None = None,
) -> NumberBetween:
    """Return a number at a place: of the run there, if the store has it, else as `predict` does.

    Parameters
    ----------
    dataset, study, store : data set of a study of runs, the study, and its store
    of : a number of the runs
    at, by : as in `predict`
    within : largest ``error`` that is enough

    Raises
    ------
    StudyError
        as `predict`; if ``of`` is a line or a map, ``within`` is no number >= 0, or the study has
        what a search found in place of runs
    """
    if not study.kind.of_runs:
        allowed = "has what a search found, not runs: predict tells numbers of runs"
        raise StudyError("study", study.name, allowed)
    axes = sweep_axes(dataset)
    numbers = [
        str(name)
        for name, each in dataset.data_vars.items()
        if each.dtype.kind == "f" and each.dims == tuple(axes)
    ]
    if of not in numbers:
        raise StudyError("of", of, one_number(of, numbers, wide_fields(dataset)))
    if within is not None and not (is_number(within) and within >= 0.0):
        raise StudyError("within", within, "must be a number >= 0")
    found = predict(dataset, of, by=by, **at)
    known = parameters_of(study.problem)
    place = {
        str(name): _json(each.item(), known[str(name)])
        for name, each in found.coords.items()
        if name in known
    }
    value, error, way = found[of].item(), found[f"{of}_error"].item(), str(found.attrs["by"])
    content = {"name": study.name, "scene": study.scene, "parameters": study.parameters | place}
    run = Study.from_dict(content | {"allow": study.allow}, scenes=lambda _: study.problem)
    row = store.run(next(run.run_ids()))
    if row and study.taken(row["status"]) == OK and row["scalars"].get(of) is not None:
        value, error, way = float(row["scalars"][of]), 0.0, RUN
    unit = str(dataset[of].attrs.get("units", ""))
    enough = within is None or error <= within
    return NumberBetween(
        of=of, value=value, error=error, unit=unit, by=way, at=place, run=run, enough=enough
    )


def _json(value: Any, parameter: Parameter) -> Any:
    """Return a value of a coordinate as that of its parameter, of which a data set has the JSON."""
    if isinstance(value, str):
        return parameter.read(value, parameter.name)
    return None if isinstance(value, float) and math.isnan(value) else value
