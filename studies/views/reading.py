"""Stored results opened as labelled data sets, and one run picked out of many."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import xarray as xr

from studies.definition.study import Study
from studies.definition.vocabulary import OK, STATUSES
from studies.errors import StudyError
from studies.storage.frame import FRACTION
from studies.storage.store import ENGINE, Store

_WAIT = 60.0
"""Seconds to wait for a service."""


def open_study(path: Path | str, name: str | None = None) -> xr.Dataset:
    """Open the combined data set of a study; arrays are read when they are used.

    Parameters
    ----------
    path : a ``dataset.nc``, the directory of a study, an output directory, or the URL of a study
        of a service that asks for no key, such as ``http://localhost:8000/studies/<id>``
    name : of the study, where the directory holds several; of those with this name the last
        computed is opened

    Raises
    ------
    StudyError
        when there is no data set (of this name), or studies of several names
    """
    if isinstance(path, str) and path.startswith(("http://", "https://")):
        return _fetched(path)
    return open_netcdf(find_study(path, name))


def find_study(path: Path | str, name: str | None = None) -> Path:
    """Return the data set that `open_study` opens."""
    found = find_datasets(path)
    names = {each: _name(each) for each in found}
    known = ", ".join(sorted(set(names.values())))
    if name is not None:
        found = [each for each in found if names[each] == name]
        if not found:
            raise StudyError("name", name, f"must be one of {known}")
    elif len(set(names.values())) > 1:
        raise StudyError("path", str(path), f"holds several studies; give the name of one: {known}")
    return max(found, key=lambda each: each.stat().st_mtime)


def _fetched(url: str) -> xr.Dataset:
    """Return the data set of a study on a service, read whole."""
    import httpx

    whole = url if url.endswith(".nc") else f"{url.rstrip('/')}/dataset.nc"
    try:
        answer = httpx.get(whole, timeout=_WAIT, follow_redirects=True).raise_for_status()
        dataset = xr.load_dataset(io.BytesIO(answer.content), engine=ENGINE)
    except (httpx.HTTPError, httpx.InvalidURL, OSError, ValueError) as error:
        raise StudyError("path", url, f"must be a study of a service: {error}") from None
    return _indexed(dataset)


def _name(dataset: Path) -> str:
    """Return the name of the study that a data set is of; its directory's where it has none."""
    try:
        content = json.loads(dataset.with_name("study.json").read_text(encoding="utf-8"))
        return str(content["name"])
    except (OSError, ValueError, TypeError, KeyError):
        return dataset.parent.name


def open_netcdf(path: Path | str) -> xr.Dataset:
    """Open the file of a run or of a study; arrays are read when they are used.

    Where runs have grids of different length, ``depth`` is a coordinate over the sweep, and
    ``depth_fraction`` the index: ``dataset.sel(depth_fraction=0.1, method="nearest")``.
    """
    try:
        dataset = xr.open_dataset(path, engine=ENGINE)
    except OSError as error:
        raise StudyError("path", str(path), f"must be a netCDF file: {error}") from None
    return _indexed(dataset)


def _indexed(dataset: xr.Dataset) -> xr.Dataset:
    """Return a data set with the fractions of grids that differ as its indexes."""
    for name in [str(name) for name in dataset.dims]:
        if (fraction := f"{name}{FRACTION}") in dataset.variables:
            dataset = dataset.set_coords(fraction).set_xindex(fraction)
    return dataset


def find_datasets(path: Path | str) -> list[Path]:
    """Return the data sets `path` stands for: itself, a study's, or those of all studies in it."""
    found = present_datasets(path)
    if not found:
        begun = "; ".join(begun_studies(path))
        allowed = begun or "must be a data set, a study or an output directory"
        raise StudyError("path", str(path), allowed)
    return found


def present_datasets(path: Path | str) -> list[Path]:
    """Return what `find_datasets` does, or nothing."""
    path = Path(path)
    if path.is_file():
        return [path]
    own = path / "dataset.nc"
    return [own] if own.is_file() else sorted(path.glob("studies/*/dataset.nc"))


def begun_studies(path: Path | str) -> list[str]:
    """Return a line for each study in `path` (or `path` itself) that has no data set yet.

    The data set of a study is written when the work on it ends, also when Ctrl-C ended it.
    """
    path = Path(path).resolve()
    files = [*path.glob("study.json"), *sorted(path.glob("studies/*/study.json"))]
    begun = [file for file in files if not file.with_name("dataset.nc").is_file()]
    return [f"{_progress(file)}; no data set yet ({file.parent})" for file in begun]


def _progress(file: Path) -> str:
    """Return the name of a study, and how many of its runs are finished."""
    study, store = None, Store(file.parents[2])
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        name = content["name"]
        study = Study.known(content, store.scene)
    except StudyError:  # such as a parameter that the scene no longer has
        pass
    except (OSError, ValueError, TypeError, KeyError):
        return f"{file.parent.name}: its {file.name} cannot be read"
    if study is None or study.id != file.parent.name:
        return f"{name}: begun with another version of the solver"
    finished = sum(store.run_path(run_id).is_file() for run_id in study.run_ids())
    return f"{study.name}: {finished} of {study.size} runs finished"


def flags(variable: xr.DataArray) -> dict[int, str]:
    """Return what the values of a variable mean, nothing for one that is no flag."""
    meanings = str(variable.attrs.get("flag_meanings", "")).split()
    values = np.atleast_1d(variable.attrs.get("flag_values", [])).tolist()
    return dict(zip(values, meanings, strict=True))


def sweep_axes(dataset: xr.Dataset) -> list[str]:
    """Return the sweep dimensions of a data set, those of size one included."""
    return [str(name) for name in dataset["status"].dims]


def sweep_coordinates(dataset: xr.Dataset) -> dict[str, str]:
    """Return the coordinates that tell runs apart, each with its sweep dimension.

    These are the dimensions themselves, and after them what linked axes set.
    """
    axes = {axis: axis for axis in sweep_axes(dataset)}
    return axes | {
        str(name): axis
        for axis in axes
        for name, each in dataset.coords.items()
        if each.dims == (axis,)
    }


def select(dataset: xr.Dataset, selection: Mapping[str, str | float]) -> xr.Dataset:
    """Return the part of a data set where the sweep has the wanted values, all axes kept.

    Parameters
    ----------
    dataset : of a study or of a run
    selection : axis, or parameter set by a linked axis -> wanted value

    Raises
    ------
    StudyError
        when an axis or a value is unknown
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
    dataset : of a study or of a run
    selection : axis, or parameter set by a linked axis -> wanted value. On an axis that is not
        named, the largest number or the first label is taken: usually the run with the most
        residual stress

    Raises
    ------
    StudyError
        when an axis or a value is unknown, or no run that matches succeeded
    """
    axes = sweep_axes(dataset)
    chosen = select(dataset, selection or {})
    ok = np.argwhere(chosen["status"].to_numpy() == STATUSES.index(OK))
    if not len(ok):
        reasons = sorted({str(text) for text in chosen["message"].to_numpy().flat if text})
        wanted = dict(selection) if selection else "any"
        raise StudyError("run", wanted, f"no such run succeeded: {'; '.join(reasons) or 'missing'}")
    numeric = [chosen[axis].dtype.kind in "fiu" for axis in axes]
    best = max(
        ok.tolist(), key=lambda at: [i if n else -i for i, n in zip(at, numeric, strict=True)]
    )
    return _own_grid(chosen.isel(dict(zip(axes, best, strict=True))))


def runs_over(dataset: xr.Dataset, axis: str, selection: Mapping[str, str | float]) -> xr.Dataset:
    """Return for each value of an axis the run that `one_run` takes; failed ones are left out.

    Raises
    ------
    StudyError
        when there is no such axis or value, no run succeeded, or the runs have different grids
    """
    if axis not in sweep_axes(dataset):
        raise StudyError("over", axis, f"must be one of {', '.join(sweep_axes(dataset))}")
    others = [name for name in sweep_axes(dataset) if name != axis]
    best = one_run(dataset, selection)
    chosen = select(dataset, selection).sel({name: best[name].item() for name in others})
    if unlike := [name for name in map(str, chosen.dims) if f"{name}{FRACTION}" in chosen.coords]:
        allowed = f"changes {', '.join(unlike)}: these runs have no place in common"
        raise StudyError("over", axis, allowed)
    return chosen.isel({axis: np.flatnonzero(chosen["status"] == STATUSES.index(OK))})


def run_file(path: Path | str, selection: Mapping[str, str | float]) -> Path:
    """Return the file of a run: `path` itself, or that of the run `one_run` takes of a study.

    Raises
    ------
    StudyError
        when there is no such run
    """
    found = find_study(path)
    beside = found.with_name("study.json")
    if found.name != "dataset.nc" or not beside.is_file():
        return found
    store = Store(found.resolve().parents[2])
    study = Study.known(json.loads(beside.read_text(encoding="utf-8")), store.scene)
    with open_netcdf(found) as dataset:
        run = one_run(dataset, selection)
        index = tuple(int(positions(dataset[axis], run[axis].item())[0]) for axis in study.axes)
    return store.run_path(next(case.id for case in study.cases() if case.index == index))


def positions(axis: xr.DataArray, value: str | float) -> np.ndarray:
    """Return where a coordinate has the wanted value, or raise a `StudyError` that lists it."""
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
        known = ", ".join(dict.fromkeys(str(each) for each in values))
        raise StudyError(str(axis.name), value, f"must be one of {known}")
    return np.flatnonzero(same)


def _own_grid(run: xr.Dataset) -> xr.Dataset:
    """Return a run on its own grid, where the study's runs have different ones."""
    for name in [str(name) for name in run.dims]:
        if name in run.coords and name not in run.indexes:
            there = run[name].notnull().to_numpy()
            run = run.drop_vars(f"{name}{FRACTION}", errors="ignore")
            run = run.isel({name: there}).set_xindex(name)
    return run
