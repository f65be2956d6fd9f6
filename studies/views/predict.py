"""Numbers, lines and maps between the runs of a study, each with its error."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from solver.parameters import is_number
from studies.definition.parameters import Parameter, parameters_of
from studies.definition.points import POINT
from studies.definition.study import Study
from studies.definition.vocabulary import OK
from studies.errors import StudyError, one_of
from studies.kinds.refine.cells import ERROR, KINK, edges, weights
from studies.storage.frame import SETS
from studies.storage.store import Store
from studies.toml import CASE
from studies.views.fits import by_content, check_predicted, share_predicted
from studies.views.gaussian import Array, Gaussian, in_hull
from studies.views.picking import (
    only_numbers,
    over_runs,
    positions,
    select,
    sweep_axes,
    sweep_coordinates,
)
from studies.views.plots.fields import wide_fields
from studies.views.table import one_number

WAYS = CELLS, GAUSSIAN = "cells", "gaussian"
ERROR_IS = {CELLS: "error", GAUSSIAN: "standard deviation"}
"""What the error of a prediction is: a cell has one for all its places."""
MOST = 1000
"""Largest number of runs of a Gaussian process: its cost grows with their cube."""
_RUN = "run_between"

_process = by_content(Gaussian)


def predict(
    dataset: xr.Dataset,
    /,
    of: str | Sequence[str] | None = None,
    *,
    by: str | None = None,
    **at: Any,
) -> xr.Dataset:
    """Return variables at a place between the runs, each with its error, ``<name>_error``.

    Parameters
    ----------
    dataset : data set of a study
    of : variables over the runs: numbers, lines or maps; by default the numbers of a refinement, or
        all numbers of the runs
    by : ``cells``, linear in the cells of a refinement, or ``gaussian``, a Gaussian process through
        all runs; by default in cells if there are any
    **at : a value for each parameter that varies: numbers between those of the runs, words among
        theirs

    Returns
    -------
    xarray.Dataset : the place is in its coordinates. Of a Gaussian process the error is a standard
        deviation; its attributes are ``q2``, and ``left_out``, the root of the mean square by
        which fits miss the runs of a tenth that they leave out. Of all numbers of the runs those
        are left out of which a process predicts too little

    Raises
    ------
    StudyError
        if the place is outside the hull of the runs, or between failed ones; if a parameter that
        varies is left out, or there is no such variable; if a process predicts too little of the
        runs that are left out (`check_predicted`, as for `sensitivity`)
    """
    ways = [way for way in WAYS if way == GAUSSIAN or "cell_state" in dataset]
    if by is not None and by not in ways:
        raise StudyError("by", by, one_of(by, ways))
    way = by or ways[0]
    names = _names(dataset, of)
    between = _placed(only_numbers(dataset, *names), at, whole=way == GAUSSIAN)
    if way == CELLS:
        found = _in_cells(dataset, between, names)
    else:
        found = _by_process(between, names, strict=of is not None)
    return found.assign_coords(between.fixed | between.place).assign_attrs(by=way)


class _Between(NamedTuple):
    """The runs among which a place is, over one dimension, and the place.

    Attributes
    ----------
    runs : those of the words that were given
    place, fixed : the numbers that vary among these runs; the parameters that do not
    """

    runs: xr.Dataset
    place: dict[str, float]
    fixed: dict[str, Any]

    @property
    def where(self) -> tuple[str, list[float]]:
        """The place, as the field and the value of an error."""
        return ", ".join(self.place), list(self.place.values())

    def known(self, names: Sequence[str]) -> np.ndarray:
        """Return which runs succeeded and have these numbers."""
        numbers = [self.runs[name] for name in names if self.runs[name].ndim == 1]
        there = [each.notnull().to_numpy() for each in numbers]
        return np.logical_and.reduce([(self.runs["status"] == OK).to_numpy(), *there])


def _names(dataset: xr.Dataset, of: str | Sequence[str] | None) -> list[str]:
    """Return the variables that are asked for."""
    axes = tuple(sweep_axes(dataset))
    every = {str(name): each for name, each in dataset.data_vars.items()}
    floats = [n for n, v in every.items() if v.dtype.kind == "f" and v.dims[: len(axes)] == axes]
    numbers = [name for name in over_runs(dataset) if name in floats]
    refined = [name.removeprefix(ERROR) for name in every if name.startswith(ERROR)]
    names = [of] if isinstance(of, str) else list(of or refined or numbers)
    for name in names:
        if name not in floats:
            raise StudyError("of", name, one_of(name, floats))
    return names


def _placed(dataset: xr.Dataset, at: Mapping[str, Any], whole: bool) -> _Between:
    """Return the runs of the words that are given, and the numbers.

    Numbers that were not refined count as words, unless all runs are taken as a ``whole``.
    """
    coordinates, chosen = sweep_coordinates(dataset), dataset
    for name, value in at.items():
        if name not in coordinates:
            raise StudyError(name, value, one_of(name, list(coordinates)))
        if name == POINT:
            others = ", ".join(each for each in coordinates if each not in (POINT, CASE))
            raise StudyError(name, value, f"only numbers the runs: give what it sets, {others}")
        words = dataset[name].dtype.kind not in "fiu"
        if words or (not whole and f"cell_{name}" in dataset):
            chosen = select(chosen, {name: value})
    place, fixed = {}, {}
    for name in coordinates:
        if name == CASE or SETS in dataset[name].attrs:
            continue
        values = np.unique(chosen[name].to_numpy())
        if len(values) == 1:
            fixed[name] = values[0].item() if hasattr(values[0], "item") else values[0]
            if name in at:
                positions(chosen[name], at[name])
            continue
        if name not in at:
            known = ", ".join(map(str, values[:5])) + (", …" if len(values) > 5 else "")
            raise StudyError(name, "", f"must be given, because it varies: {known}")
        try:
            place[name] = float(at[name])
        except (TypeError, ValueError):
            raise StudyError(name, at[name], "must be a number") from None
        if not values[0] <= place[name] <= values[-1]:
            allowed = f"must be between {values[0]:g} and {values[-1]:g}, as the runs are"
            raise StudyError(name, at[name], allowed)
    if not place:
        raise StudyError("at", dict(at), "no number varies among these runs: nothing is between")
    over = sweep_axes(chosen)
    return _Between(chosen.reset_coords().stack({_RUN: over}, create_index=False), place, fixed)


def _in_cells(dataset: xr.Dataset, between: _Between, names: Sequence[str]) -> xr.Dataset:
    """Predict in the smallest cell of a refinement that holds the place."""
    place, runs = between.place, between.runs
    inside = np.ones(dataset.sizes["cell"], dtype=bool)
    size = np.ones(len(inside))
    for name, at in place.items():
        below, above = (dataset[f"cell_{name}_{end}"].to_numpy() for end in ("low", "high"))
        inside &= (below <= at) & (at <= above)
        size *= above - below
    for name, at in between.fixed.items():
        if f"cell_{name}" in dataset:
            inside &= dataset[f"cell_{name}"].to_numpy().astype(str) == str(at)
    known = between.known(names)
    columns = [runs[name].to_numpy() for name in place]
    where = {each: k for k, each in enumerate(zip(*columns, strict=True))}
    left = next(each for name, each in dataset.data_vars.items() if str(name).startswith(ERROR))
    told = inside & left.notnull().to_numpy()
    for number in sorted(np.flatnonzero(told), key=lambda k: size[k]):
        low, high = (
            tuple(
                dataset[f"cell_{name}_{end}"].to_numpy()[number].astype(column.dtype).item()
                for name, column in zip(place, columns, strict=True)
            )
            for end in ("low", "high")
        )
        parts = weights(low, high, tuple(place.values()), where)
        if all(at in where and known[where[at]] for at in parts):
            break
    else:
        state = dataset["cell_state"].to_numpy()[inside]
        allowed = f"is across failed runs: its cell is {', '.join(state)}"
        raise StudyError(*between.where, allowed)
    found = {}
    for name in names:
        each = runs[name]
        values = {at: each.isel({_RUN: where[at]}) for at in parts}
        terms = [weight * values[at] for at, weight in parts.items()]
        inner: xr.DataArray = sum(terms[1:], start=terms[0])
        if f"{ERROR}{name}" in dataset:
            error = xr.zeros_like(inner) + dataset[f"{ERROR}{name}"].item(number)
        else:
            worst: dict[int, Any] = {}
            for axis, first, last, mid in edges(low, high):
                share = (mid[axis] - first[axis]) / (last[axis] - first[axis])
                if mid in values:
                    line = values[first] * (1.0 - share) + values[last] * share
                    left = KINK * abs(values[mid] - line)
                else:
                    left = abs(values[last] - values[first])
                worst[axis] = np.maximum(worst.get(axis, 0.0), left)
            error = xr.zeros_like(inner) + sum(worst.values())
        found[name] = inner.assign_attrs(each.attrs)
        found[f"{name}_error"] = error.assign_attrs(_error_of(each, ERROR_IS[CELLS]))
    return xr.Dataset(found)


def _by_process(between: _Between, names: Sequence[str], strict: bool) -> xr.Dataset:
    """Predict by a Gaussian process through all runs that succeeded.

    A variable of which it predicts too little is refused if ``strict``, or if there is no other.
    """
    runs, known = between.runs, between.known(names)
    every = np.column_stack([runs[name].to_numpy().astype(float) for name in between.place])
    least, span = every.min(axis=0), np.ptp(every, axis=0)
    places = (every - least) / span
    place: Array = (np.array(list(between.place.values())) - least) / span
    good, dimensions = places[known], places.shape[1]
    if not dimensions + 3 <= len(good) <= MOST:
        allowed = f"needs {dimensions + 3} to {MOST} runs that succeeded: there are {len(good)}"
        raise StudyError("by", GAUSSIAN, allowed)
    if not in_hull(good, place):
        raise StudyError(*between.where, "is outside the hull of the runs that succeeded")
    apart = np.sum((places - place) ** 2, axis=1)
    nearest = np.argsort(apart, kind="stable")[: 1 if apart.min() == 0.0 else dimensions + 1]
    if failed := [k for k in nearest if not known[k]]:
        allowed = f"is across a failed run: {runs['status'].to_numpy()[failed[0]]}"
        raise StudyError(*between.where, allowed)
    found, refused = dict[str, Any](), list[StudyError]()
    for name in names:
        each = runs[name].isel({_RUN: known}).transpose(_RUN, ...)
        flat = each.to_numpy().reshape(len(good), -1)
        there = np.isfinite(flat).all(axis=0)
        process = _process(good, flat[:, there])
        q2 = share_predicted(flat[:, there], process.misses)
        try:
            check_predicted(name, q2, len(good))
        except StudyError as refusal:
            refused.append(refusal)
            continue
        error = np.full(flat.shape[1], np.nan)
        parts, error[there] = process.at(place)
        value = xr.dot(each, xr.DataArray(parts, dims=_RUN), dim=_RUN)
        rms = float(np.sqrt(np.mean(process.misses**2)))
        found[name] = value.assign_attrs(each.attrs)
        told = _error_of(each, ERROR_IS[GAUSSIAN]) | {"q2": q2, "left_out": rms}
        found[f"{name}_error"] = value.copy(data=error.reshape(value.shape)).assign_attrs(told)
    if refused and (strict or not found):
        raise refused[0]
    return xr.Dataset(found)


def _error_of(values: xr.DataArray, what: str) -> dict[str, Any]:
    """Return the attributes of the error of a variable."""
    unit = {key: each for key, each in values.attrs.items() if key == "units"}
    return {"long_name": f"{what} of the predicted {values.name}"} | unit


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
    numbers = [name for name, each in over_runs(dataset).items() if each.dtype.kind == "f"]
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
