"""Find stored results and open them as labelled data sets."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any, Literal

import numpy as np
import xarray as xr

from studies.definition.identity import is_id
from studies.definition.study import Study
from studies.errors import FileDamaged, StudyError
from studies.storage import seal
from studies.storage.frame import FRACTION
from studies.storage.store import Store

ENGINE: Literal["netcdf4"] = "netcdf4"
"""netCDF backend of xarray for files: it opens a run ten times as fast as h5netcdf, and its calls
wait for those of other threads. It does not read a file in memory."""

_WAIT = 60.0
"""Timeout of a request to a service [s]."""


def open_study(path: Path | str, name: str | None = None) -> xr.Dataset:
    """Open the combined data set of a study; arrays are read when they are used.

    Parameters
    ----------
    path : a ``dataset.nc``, the directory of a study, an output directory, or the URL of a study
        of a service that requires no key, such as ``http://localhost:8000/studies/<id>``
    name : name of the study, if the directory has several; of those with this name the one
        computed last is opened

    Raises
    ------
    StudyError
        if there is no data set (of this name), or there are studies with different names
    """
    if isinstance(path, str) and path.startswith(("http://", "https://")):
        if name is not None:
            raise StudyError("name", name, "must be left out: the URL is that of one study")
        return _fetched(path)
    return open_netcdf(find_study(path, name))


def find_study(path: Path | str, name: str | None = None) -> Path:
    """Return the path of the data set that `open_study` opens."""
    found = find_datasets(path)
    names = {each: _name(each) for each in found}
    known = ", ".join(sorted(set(names.values())))
    if name is not None:
        found = [each for each in found if names[each] == name]
        if not found:
            raise StudyError("name", name, f"must be one of {known}")
    elif len(set(names.values())) > 1:
        allowed = f"holds several studies: give the directory of one, or its name ({known})"
        raise StudyError("path", str(path), allowed)
    return max(found, key=lambda each: each.stat().st_mtime)


def _fetched(url: str) -> xr.Dataset:
    """Return the data set of a study from a service, completely read."""
    import httpx

    whole = url if url.endswith(".nc") else f"{url.rstrip('/')}/dataset.nc"
    try:
        answer = httpx.get(whole, timeout=_WAIT, follow_redirects=True)
        if answer.is_error:
            raise ValueError(_refusal(answer))
        dataset = xr.load_dataset(io.BytesIO(answer.content), engine="h5netcdf")
    except (httpx.HTTPError, httpx.InvalidURL, OSError, ValueError) as error:
        raise StudyError("path", url, f"must be a study of a service: {error}") from None
    return _indexed(dataset)


def _refusal(answer: Any) -> str:
    """Return status and reason of an answer with an error."""
    try:
        return f"{answer.status_code} {answer.json()['detail']}"
    except (ValueError, TypeError, KeyError):
        return f"{answer.status_code} {answer.reason_phrase}"


def _name(dataset: Path) -> str:
    """Return the name of a data set's study, or of its directory if there is none."""
    try:
        content = json.loads(dataset.with_name("study.json").read_text(encoding="utf-8"))
        return str(content["name"])
    except (OSError, ValueError, TypeError, KeyError):
        return dataset.parent.name


def open_netcdf(path: Path | str) -> xr.Dataset:
    """Open the file of a run or of a study; arrays are read when they are used.

    One in a store is checked: it must be what was written there.

    If runs have grids of different length, ``depth`` is a coordinate over the sweep and
    ``depth_fraction`` is the index: ``dataset.sel(depth_fraction=0.1, method="nearest")``.

    Raises
    ------
    StudyError
        if it is not a netCDF file, or was damaged or replaced in its store
    """
    _check(Path(path))
    try:
        dataset = xr.open_dataset(path, engine=ENGINE)
    except OSError as error:
        raise StudyError("path", str(path), f"must be a netCDF file: {error}") from None
    return _indexed(dataset)


def _check(path: Path) -> None:
    """Raise `StudyError` if a file in a store is not what its place says."""
    whole = path.absolute()
    if whole.name == "dataset.nc" and is_id(whole.parent.name):
        name = f"dataset {whole.parent.name}"
    elif whole.parent.name == "runs" and is_id(whole.stem):
        name = f"run {whole.stem}"
    else:
        return
    try:
        seal.check(path, name)
    except FileDamaged as error:
        if error.state is None or (error.reason == seal.NO_SEAL and not seal.lost(path)):
            return  # it is missing, or of an earlier version
        allowed = f"was damaged or replaced, compute its study again: {error.reason}"
        raise StudyError("path", str(path), allowed) from None


def _indexed(dataset: xr.Dataset) -> xr.Dataset:
    """Return a data set whose indexes are the fractions of grids that differ between runs.

    Outcomes are converted to words if an earlier version of the solver stored numbers.
    """
    if "status" in dataset and dataset["status"].dtype.kind == "i":
        words = np.array(str(dataset["status"].attrs["flag_meanings"]).split(), dtype=object)
        dataset["status"] = (dataset["status"].dims, words[dataset["status"].to_numpy()])
    for name in [str(name) for name in dataset.dims]:
        if (fraction := f"{name}{FRACTION}") in dataset.variables:
            dataset = dataset.set_coords(fraction).set_xindex(fraction)
    return dataset


def find_datasets(path: Path | str) -> list[Path]:
    """Return the data sets at `path`: itself, that of a study, or those of all studies in it.

    Raises
    ------
    StudyError
        if there are none
    """
    found = present_datasets(path)
    if not found:
        begun = "; ".join(begun_studies(path))
        allowed = begun or "must be a data set, a study or an output directory"
        raise StudyError("path", str(path), allowed)
    return found


def present_datasets(path: Path | str) -> list[Path]:
    """Return the paths of `find_datasets`; empty if there are none."""
    path = Path(path)
    if path.is_file():
        return [path]
    own = path / "dataset.nc"
    return [own] if own.is_file() else sorted(path.glob("studies/*/dataset.nc"))


def begun_studies(path: Path | str) -> list[str]:
    """Return a line for each study in `path` (or `path` itself) that has no data set yet.

    The data set of a study is written when its computation ends, also after Ctrl-C.
    """
    path = Path(path).resolve()
    files = [*path.glob("study.json"), *sorted(path.glob("studies/*/study.json"))]
    begun = [file for file in files if not file.with_name("dataset.nc").is_file()]
    return [f"{_progress(file)}; no data set yet ({file.parent})" for file in begun]


def _progress(file: Path) -> str:
    """Return the name of a study and the number of its finished runs."""
    study, store = None, Store(file.parents[2])
    try:
        content = seal.content_of(file, f"study {file.parent.name}")
        name = content["name"]
        study = Study.known(content, store.scene)
    except StudyError:  # such as a parameter that the scene no longer has
        pass
    except (FileDamaged, KeyError):
        return f"{file.parent.name}: its {file.name} cannot be read"
    if study is None or study.id != file.parent.name:
        return f"{name}: begun with another version of the solver"
    if study.asks:
        return f"{study.name}: the {'refinement' if study.refine else 'search'} has not ended"
    finished = sum(store.run_path(run_id).is_file() for run_id in study.run_ids())
    return f"{study.name}: {finished} of {study.size} runs finished"
