"""The axes of a data set, and one run, a part of the sweep, or a grid of its points."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from studies.definition.points import POINT
from studies.definition.study import Study
from studies.definition.vocabulary import OK, STATUSES
from studies.errors import FileDamaged, StudyError, one_of
from studies.storage.frame import FRACTION, SETS
from studies.storage.seal import content_of
from studies.storage.store import Store
from studies.toml import CASE
from studies.views.columns import counted
from studies.views.reading import find_study, open_netcdf


def flags(variable: xr.DataArray) -> dict[int, str]:
    """Return the meanings of a variable's values; empty if it is not a flag.

    The outcomes of runs are stored as words and numbered for drawing.
    """
    if variable.name == "status":
        return dict(enumerate(STATUSES))
    meanings = str(variable.attrs.get("flag_meanings", "")).split()
    values = np.atleast_1d(variable.attrs.get("flag_values", [])).tolist()
    return dict(zip(values, meanings, strict=True))


def sweep_axes(dataset: xr.Dataset) -> list[str]:
    """Return the sweep dimensions of a data set, including those of size one.

    Raises
    ------
    StudyError
        if it is not the data set of a study, or of a run
    """
    if "status" not in dataset:
        path = dataset.encoding.get("source", "")
        raise StudyError("path", path, "must be the data set of a study, or of a run")
    return [str(name) for name in dataset["status"].dims]


def over_runs(dataset: xr.Dataset) -> dict[str, xr.DataArray]:
    """Return the variables of a data set that have one value for each run."""
    axes = tuple(sweep_axes(dataset))
    return {str(name): each for name, each in dataset.data_vars.items() if each.dims == axes}


def only_numbers(dataset: xr.Dataset, *but: str) -> xr.Dataset:
    """Return a data set without other lines and maps: to stack its runs reads all that it has."""
    axes = {*sweep_axes(dataset)}
    wide = [str(name) for name, each in dataset.data_vars.items() if axes < {*map(str, each.dims)}]
    return dataset.drop_vars([name for name in wide if name not in but])


def sweep_coordinates(dataset: xr.Dataset) -> dict[str, str]:
    """Return the coordinates that distinguish runs, each with its sweep dimension.

    These are the dimensions themselves, then the parameters that linked axes set.
    """
    axes = {axis: axis for axis in sweep_axes(dataset)}
    return axes | {
        str(name): axis
        for axis in axes
        for name, each in dataset.coords.items()
        if each.dims == (axis,)
    }


def varied(dataset: xr.Dataset) -> dict[str, str]:
    """Return the coordinates that differ between runs, each with its sweep dimension."""
    return {n: axis for n, axis in sweep_coordinates(dataset).items() if dataset.sizes[axis] > 1}


def each_run(
    dataset: xr.Dataset, coordinates: Mapping[str, str]
) -> Iterator[tuple[tuple[int, ...], dict[str, Any]]]:
    """Yield the position of each run, and its values of coordinates, given with their axes."""
    axes = sweep_axes(dataset)
    values = {name: dataset[name].to_numpy() for name in coordinates}
    for at in np.ndindex(dataset["status"].shape):
        place = dict(zip(axes, at, strict=True))
        yield at, {name: values[name][place[axis]] for name, axis in coordinates.items()}


def select(dataset: xr.Dataset, selection: Mapping[str, str | float]) -> xr.Dataset:
    """Return the part of a data set where the sweep has the selected values; all axes are kept.

    Parameters
    ----------
    dataset : data set of a study or of a run
    selection : value for each selected axis, or parameter set by a linked axis

    Raises
    ------
    StudyError
        if an axis or a value is unknown
    """
    coordinates = sweep_coordinates(dataset)
    for name, value in selection.items():
        if name not in coordinates:
            raise StudyError(name, value, f"must be one of {', '.join(coordinates)}")
        dataset = dataset.isel({coordinates[name]: positions(dataset[name], value)})
    return dataset


def one_run(dataset: xr.Dataset, selection: Mapping[str, str | float] | None = None) -> xr.Dataset:
    """Return one successful run of a study.

    Parameters
    ----------
    dataset : data set of a study or of a run
    selection : value for each selected axis, or parameter set by a linked axis. On other axes the
        largest number or the first label is taken: usually the run with the most residual stress

    Raises
    ------
    StudyError
        if an axis or a value is unknown, or no selected run succeeded
    """
    axes = sweep_axes(dataset)
    chosen = select(dataset, selection or {})
    ok = np.argwhere(chosen["status"].to_numpy() == OK)
    if not len(ok):
        reasons = sorted({str(text) for text in chosen["message"].to_numpy().flat if text})
        wanted = dict(selection) if selection else "any"
        raise StudyError("run", wanted, f"no such run succeeded: {'; '.join(reasons) or 'missing'}")
    numeric = [chosen[axis].dtype.kind in "fiu" for axis in axes]
    best = max(
        ok.tolist(), key=lambda at: [i if n else -i for i, n in zip(at, numeric, strict=True)]
    )
    run = chosen.isel(dict(zip(axes, best, strict=True)))
    return own_grid(run)


def runs_over(
    dataset: xr.Dataset,
    axis: str,
    selection: Mapping[str, str | float],
    field: str,
    along: str | None = None,
) -> xr.Dataset:
    """Return the run that `one_run` selects for each value of an axis; failed runs are left out.

    Parameters
    ----------
    dataset, selection : as for `one_run`
    axis : axis of the sweep
    field : variable whose grids are made one, see `_aligned`
    along : dimension along which its lines go

    Raises
    ------
    StudyError
        if there is no such axis or value, no run succeeded, or the grids of the field differ
    """
    if axis not in sweep_axes(dataset):
        raise StudyError("over", axis, f"must be one of {', '.join(sweep_axes(dataset))}")
    others = [name for name in sweep_axes(dataset) if name != axis]
    best = one_run(dataset, selection)
    chosen = select(dataset, selection).sel({name: best[name].item() for name in others})
    chosen = chosen.isel({axis: np.flatnonzero(chosen["status"] == OK)})
    own = [str(name) for name in chosen[field].dims]
    own = [name for name in own if name in chosen.coords and name not in chosen.indexes]
    for name in [name for name in own if not _same(chosen[name], axis)]:
        own.remove(name)
        chosen = _aligned(chosen, axis, name, field, along)
    for name in own:
        grid = chosen[name].isel({axis: 0}) if axis in chosen[name].dims else chosen[name]
        chosen = chosen.drop_vars(name).assign_coords({name: (name, grid.to_numpy(), grid.attrs)})
    return own_grid(chosen, own)


def _aligned(runs: xr.Dataset, axis: str, name: str, field: str, along: str | None) -> xr.Dataset:
    """Return runs whose grids differ over one that they have in common.

    Along lines these are the places of all runs, with values that are linear between those of each:
    a line is drawn as over its own places. Other places are named by their fraction of the whole.

    Raises
    ------
    StudyError
        if there is no such grid
    """
    grid = runs[name]
    if name != along:
        fraction = runs.get(f"{name}{FRACTION}")
        if fraction is None:
            allowed = f"changes {name}: these runs have no place in common"
            raise StudyError("over", axis, allowed)
        return runs.drop_vars([name, fraction.name]).assign_coords({name: fraction.variable})
    common = np.unique(grid.to_numpy()[grid.notnull().to_numpy()])

    def on_common(places: np.ndarray, values: np.ndarray) -> np.ndarray:
        there = ~np.isnan(places)
        found: np.ndarray = np.interp(
            common, places[there], values[there], left=np.nan, right=np.nan
        )
        return found

    values = xr.apply_ufunc(
        on_common, grid, runs[field], input_core_dims=[[name], [name]],
        output_core_dims=[[name]], exclude_dims={name}, vectorize=True,
    )  # fmt: skip
    found = runs.drop_dims(name).assign({field: values.assign_attrs(runs[field].attrs)})
    return found.assign_coords({name: xr.Variable(name, common, grid.attrs)})


def _same(grid: xr.DataArray, axis: str) -> bool:
    """Whether a grid is the same for all values of an axis."""
    if axis not in grid.dims:
        return True
    values = np.moveaxis(grid.to_numpy(), grid.dims.index(axis), 0)
    return all(np.array_equal(each, values[0], equal_nan=True) for each in values)


def run_file(path: Path | str, selection: Mapping[str, str | float]) -> Path:
    """Return the file of a run: `path` itself, or the run that `one_run` selects from a study.

    Raises
    ------
    StudyError
        if there is no such run
    """
    found = find_study(path)
    if found.name != "dataset.nc" or not found.with_name("study.json").is_file():
        return found
    study, store = study_of(found)
    with open_netcdf(found) as dataset:
        return file_of(dataset, study, store, selection)


def file_of(
    dataset: xr.Dataset, study: Study, store: Store, selection: Mapping[str, str | float]
) -> Path:
    """Return the file of the run that `one_run` selects from the data set of a study in a store.

    Raises
    ------
    StudyError
        if there is no such run, or the study has searched
    """
    if not study.kind.of_runs:
        path = str(store.dataset_path(study.id))
        such = study.kind.example
        allowed = f"holds what a search found: give the file of a run, such as that of {such}"
        raise StudyError("path", path, allowed)
    run = one_run(dataset, selection)
    if "run" in run:  # its study chose the runs
        return store.run_path(str(run["run"].item()))
    index = tuple(int(positions(dataset[axis], run[axis].item())[0]) for axis in study.axes)
    return store.run_path(next(case.id for case in study.cases() if case.index == index))


def study_of(dataset: Path) -> tuple[Study, Store]:
    """Return the study of a data set in a store, and the store.

    Raises
    ------
    StudyError
        if it is not in a store, or another version of the solver computed it
    """
    path, beside = str(dataset), dataset.with_name("study.json")
    if not beside.is_file():
        raise StudyError("path", path, "must be a study in an output directory")
    store = Store(dataset.resolve().parents[2])
    try:
        content = content_of(beside, f"study {dataset.parent.name}")
    except FileDamaged as error:
        raise StudyError("path", path, f"holds a damaged file: {error}") from None
    study = Study.known(content, store.scene)
    if study.id != dataset.parent.name:  # then the ids of its runs differ too
        allowed = "was computed by another version of the solver: give the file of a run"
        raise StudyError("path", path, allowed)
    return study, store


def positions(axis: xr.DataArray, value: str | float) -> np.ndarray:
    """Return the indices (n,) at which a coordinate has a value.

    Raises
    ------
    StudyError
        if it has no such value; the message lists its values
    """
    values = axis.to_numpy()
    try:
        same = (
            np.isclose(values.astype(float), float(value), rtol=1e-9)
            if values.dtype.kind in "fiu"
            else values == str(value)
        )
    except ValueError:
        same = np.zeros(len(values), dtype=bool)
    if not same.any():
        known = ", ".join(dict.fromkeys(counted(each) for each in values))
        raise StudyError(str(axis.name), value, f"must be one of {known}")
    return np.flatnonzero(same)


def own_grid(runs: xr.Dataset, names: Sequence[str] | None = None) -> xr.Dataset:
    """Return runs with a grid of their own as the index of these dimensions, if grids differ.

    By default it is done for all dimensions of a single run.
    """
    for name in map(str, runs.dims) if names is None else names:
        if name in runs.coords and name not in runs.indexes:
            there = runs[name].notnull().to_numpy()
            runs = runs.drop_vars(f"{name}{FRACTION}", errors="ignore")
            runs = runs.isel({name: there}).set_xindex(name)
    return runs


def point_axes(dataset: xr.Dataset) -> list[str]:
    """Return the axes of points of a data set: those that are numbers and set parameters."""
    return [
        str(name)
        for name in dataset["status"].dims
        if SETS in dataset[name].attrs and dataset[name].dtype.kind in "iu"
    ]


def parameters_over(dataset: xr.Dataset, axis: str) -> list[str]:
    """Return the parameters that an axis of labels or points sets, if they are not all equal."""
    names = str(dataset[axis].attrs.get(SETS, "")).split()
    given = [name for name in names if name != CASE and dataset[name].dims == (axis,)]
    return [name for name in given if len(np.unique(dataset[name])) > 1]


def to_grid(
    dataset: xr.Dataset, axis: str = POINT, parameters: Sequence[str] | None = None
) -> xr.Dataset:
    """Return a data set whose points are a grid, with a dimension for each of their parameters.

    Parameters
    ----------
    dataset : data set of a study
    axis : the axis of points
    parameters : the new dimensions; by default those that are not the same at all points

    Raises
    ------
    StudyError
        if there is no such axis, or a combination of values is missing or occurs twice
    """
    axes = point_axes(dataset)
    if axis not in axes:
        raise StudyError("axis", axis, one_of(axis, axes))
    varied = parameters_over(dataset, axis)
    names = varied if parameters is None else list(parameters)
    for name in names:
        if name not in varied:
            raise StudyError("parameters", name, one_of(name, varied))
    places = [np.unique(dataset[name], return_inverse=True) for name in names]
    shape = tuple(len(values) for values, _ in places)
    points, grid = dataset.sizes[axis], math.prod(shape)
    flat = np.ravel_multi_index([at for _, at in places], shape) if names else np.zeros(points, int)
    if points != grid or len(np.unique(flat)) != grid:
        sizes = " x ".join(f"{n} {name}" for n, name in zip(shape, names, strict=True)) or "1"
        allowed = f"are no grid: {len(np.unique(flat))} of its {grid} places ({sizes}) are taken"
        raise StudyError("points", f"{points} points", allowed)
    ordered = dataset.isel({axis: np.argsort(flat)}).drop_vars(axis)
    if not names:
        return ordered.squeeze(axis)
    index: dict[Any, list[str]] = {axis: names}
    found = ordered.set_index(index).unstack(axis)
    dims = [str(name) for name in dataset["status"].dims]
    at = dims.index(axis)
    for name in names:
        found[name].attrs |= dataset[name].attrs
    return found.transpose(*dims[:at], *names, *dims[at + 1 :], ...)
