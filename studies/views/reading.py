"""Find stored results and open them as labelled data sets."""

from __future__ import annotations

import io
import json
import logging
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import takewhile
from pathlib import Path
from typing import Any, Literal

import numpy as np
import xarray as xr

from studies.definition.identity import is_id
from studies.definition.study import Study
from studies.errors import FileDamaged, StudyError, cut
from studies.storage import seal
from studies.storage.blobs import blobs_at, directory_of, is_address
from studies.storage.frame import FRACTION
from studies.storage.store import Store

ENGINE: Literal["netcdf4"] = "netcdf4"
"""netCDF backend of xarray for files: it opens a run ten times as fast as h5netcdf, and its calls
wait for those of other threads. It does not read a file in memory."""

LATEST = "latest"
"""In the place of a study's name, the study that was computed last."""

_LOG = logging.getLogger("studies")
_WIDEST = 60
"""Largest number of characters of an entry in which studies differ."""
_WAIT = 60.0
"""Timeout of a request to a service [s]."""


def open_study(path: Path | str, name: str | None = None, *, unchecked: bool = False) -> xr.Dataset:
    """Open the combined data set of a study; arrays are read when they are used.

    It must be as it was written, which its seal proves, wherever the file is.

    Parameters
    ----------
    path : a ``dataset.nc``, the directory of a study, an output directory, a study in it
        (``out/punch``, see `find_datasets`), or the URL of a study of a service that requires no
        key, such as ``http://localhost:8000/studies/<id>``, or the address of a store, such as
        ``s3://bucket/results``
    name : name of the study, if the directory has several; of those with this name the one
        computed last is opened, and the logger ``studies`` says which there are
    unchecked : whether to open a file that has no seal or was changed, such as one that another
        program has written; its numbers are not those of the study

    Raises
    ------
    StudyError
        if there is no data set (of this name), there are studies with different names, or it is not
        as it was written
    """
    if isinstance(path, str) and path.startswith(("http://", "https://")):
        if name is not None:
            raise StudyError("name", name, "must be left out: the URL is that of one study")
        return _fetched(path, unchecked)
    if is_address(path):
        path, name = directory_of(path) / (name or ""), None
    return open_netcdf(find_study(path, name), unchecked=unchecked)


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
        one = Path(path) / sorted(set(names.values()))[0]
        allowed = f"holds several studies: give one, such as {one}, or its name ({known})"
        raise StudyError("path", str(path), allowed)
    found.sort(key=_written, reverse=True)
    if len(found) > 1:
        listed = "\n".join(f"  {each}" for each in _listed(found))
        _LOG.warning("%s holds %d studies of this name, the first is taken:\n%s",
                     path, len(found), listed)  # fmt: skip
    return found[0]


def _listed(found: list[Path]) -> Iterator[str]:
    """Yield a line for each study of one name: its directory, date, and what differs."""
    contents = [{k: json.dumps(v) for k, v in _flat(_content(each))} for each in found]
    keys = dict.fromkeys(key for each in contents for key in each)
    unlike = [k for k in keys if any(each.get(k) != contents[0].get(k) for each in contents)]
    alike = {k: _alike([each[k] for each in contents if k in each]) for k in unlike}
    for each, content in zip(found, contents, strict=True):
        date = time.strftime("%Y-%m-%d %H:%M", time.localtime(_written(each)))
        own = (f"{k} = {_from(content[k], alike[k])}" for k in unlike if k in content)
        yield f"{each.parent}, {date}: {', '.join(own) or 'computed by another solver'}"


def _alike(texts: list[str]) -> int:
    """Return how many characters at the beginning of several texts are the same; 0 of one text."""
    if len(texts) < 2:
        return 0
    return sum(1 for _ in takewhile(lambda own: len({*own}) == 1, zip(*texts, strict=False)))


def _from(text: str, alike: int) -> str:
    """Return the part of a text around what differs, behind so many characters that do not."""
    begin = 0 if alike < _WIDEST // 2 else alike - _WIDEST // 2
    return cut(("…" if begin else "") + text[begin:], _WIDEST)


def _flat(content: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the entries of a study, and of its tables, by their names with dots."""
    for key, value in content.items():
        if isinstance(value, dict):
            yield from ((f"{key}.{inner}", each) for inner, each in _flat(value))
        else:
            yield key, value


def _written(path: Path) -> float:
    return path.stat().st_mtime


def _fetched(url: str, unchecked: bool) -> xr.Dataset:
    """Return the data set of a study from a service, completely read."""
    import httpx

    whole = url if url.endswith(".nc") else f"{url.rstrip('/')}/dataset.nc"
    try:
        answer = httpx.get(whole, timeout=_WAIT, follow_redirects=True)
        if answer.is_error:
            raise ValueError(_refusal(answer))
    except (httpx.HTTPError, httpx.InvalidURL, OSError, ValueError) as error:
        raise StudyError("path", url, f"must be a study of a service: {error}") from None
    return loaded(answer.content, url, unchecked=unchecked)


def loaded(content: bytes, path: str, *, unchecked: bool = False) -> xr.Dataset:
    """Return a data set, completely read, from the content of its file; see `open_netcdf`."""
    with one_error(path):
        if not unchecked:
            seal.check_content(content)
        return indexed(xr.load_dataset(io.BytesIO(content), engine="h5netcdf"))


def _refusal(answer: Any) -> str:
    """Return status and reason of an answer with an error."""
    try:
        return f"{answer.status_code} {answer.json()['detail']}"
    except (ValueError, TypeError, KeyError):
        return f"{answer.status_code} {answer.reason_phrase}"


def _name(dataset: Path) -> str:
    """Return the name of a data set's study, or of its directory if there is none."""
    return str(_content(dataset).get("name", dataset.parent.name))


def _content(dataset: Path) -> dict[str, Any]:
    """Return the definition of a data set's study; empty if it cannot be read."""
    try:
        return seal.content_of(dataset.with_name("study.json"))
    except (FileDamaged, OSError):
        return {}


def open_netcdf(path: Path | str, *, unchecked: bool = False) -> xr.Dataset:
    """Open the file of a run or of a study; arrays are read when they are used.

    It is checked as `check` does, unless ``unchecked``.

    If runs have grids of different length, ``depth`` is a coordinate over the sweep and
    ``depth_fraction`` is the index: ``dataset.sel(depth_fraction=0.1, method="nearest")``.

    Raises
    ------
    StudyError
        if it is not a netCDF file, or not as it was written
    """
    if not unchecked:
        check(Path(path))
    with one_error(path):
        return indexed(xr.open_dataset(path, engine=ENGINE))


def check(path: Path) -> None:
    """Raise `StudyError` unless a file has its seal, and in a store is what its place says.

    The seal is at the end of the file, and goes with every copy of it.
    """
    whole, name = path.absolute(), ""
    if whole.name == "dataset.nc" and is_id(whole.parent.name):
        name = f"dataset {whole.parent.name}"
    elif whole.parent.name == "runs" and is_id(whole.stem):
        name = f"run {whole.stem}"
    with one_error(path):
        seal.check(path, name)


@contextmanager
def one_error(path: Path | str) -> Iterator[None]:
    """Raise `StudyError` in place of what a library or the check of a file raises."""
    try:
        yield
    except (FileDamaged, OSError, RuntimeError, ValueError, LookupError) as error:
        reason = error.reason if isinstance(error, FileDamaged) else str(error)
        allowed = (
            f"is not a file as Residua has written it: {reason}. Compute its study again; "
            "open_study(path, unchecked=True) opens a file that another program has written"
        )
        raise StudyError("path", str(path), allowed) from None


def indexed(dataset: xr.Dataset) -> xr.Dataset:
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

    A path within an output directory may be the name of a study, the beginning of its id, or
    ``latest``: ``out/punch``, ``out/3fa9``, ``out/latest``.

    Raises
    ------
    StudyError
        if there are none
    """
    found = present_datasets(path)
    if not found:
        begun = _begun(path)
        lines = [line for line, _ in begun]
        if shown := next((output for _, output in begun if output), None):
            there = f"residua view {shown} shows the runs that are there"
            lines += [f"{there}, and gives xarray.open_zarr its address with /studies/ID/zarr"]
        allowed = "; ".join(lines) or "must be a data set, a study or an output directory"
        raise StudyError("path", str(path), allowed)
    return found


def present_datasets(path: Path | str) -> list[Path]:
    """Return the paths of `find_datasets`; empty if there are none."""
    path = Path(path)
    if path.is_file():
        return [path]
    own = path / "dataset.nc"
    if own.is_file():
        return [own]
    return _datasets(path, "") if path.is_dir() else _datasets(path.parent, path.name)


def _datasets(directory: Path, name: str) -> list[Path]:
    """Return the data sets in a directory, or those of the studies that a name stands for."""
    blobs = blobs_at(directory)
    blobs.follow()
    found = dict(sorted(blobs.stamps(blobs.names("studies/*/dataset.nc")).items()))
    names = {each: _name(blobs.path(each.replace("dataset.nc", "study.json"))) for each in found}
    if name == LATEST:
        found = dict(sorted(found.items(), key=lambda each: each[1][1])[-1:])
    elif name:
        named = [each for each in found if names[each] == name]
        begun = [each for each in found if each.split("/")[1].startswith(name)]
        return [blobs.path(each) for each in named or begun]
    return [blobs.path(each) for each in found]


def begun_studies(path: Path | str) -> list[str]:
    """Return a line for each study at `path`, as for `find_datasets`, that has no data set yet.

    The data set of a study is written when its computation ends, also after Ctrl-C.
    """
    return [line for line, _ in _begun(path)]


def begun_in(path: Path | str) -> Path | None:
    """Return the output directory of a study at `path` whose runs can be read before its end."""
    return next((output for _, output in _begun(path) if output), None)


def _begun(path: Path | str) -> list[tuple[str, Path | None]]:
    """Return the lines of `begun_studies`, each with its output directory if runs can be read."""
    path = Path(path).resolve()
    name, path = ("", path) if path.is_dir() else (path.name, path.parent)
    blobs = blobs_at(path)
    there = {Path(name).parent.name for name in blobs.names("studies/*/dataset.nc")}
    files = map(blobs.path, ["study.json", *sorted(blobs.names("studies/*/study.json"))])
    begun = [file for file in files if file.is_file() and file.parent.name not in there]
    begun = [file for file in begun if not file.with_name("dataset.nc").is_file()]
    begun = [each for each in begun if each.parent.name.startswith(name) or _name(each) == name]
    each = ((*_progress(file), file) for file in begun)
    return [
        (f"{line}; no data set yet ({file.parent})", file.parents[2] if readable else None)
        for line, readable, file in each
    ]


def _progress(file: Path) -> tuple[str, bool]:
    """Return the name of a study and the number of its finished runs; whether this is known."""
    study, store = None, Store(file.parents[2])
    try:
        content = seal.content_of(file, f"study {file.parent.name}")
        name = content["name"]
        study = Study.known(content, store.scene)
    except StudyError:  # such as a parameter that the scene no longer has
        pass
    except (FileDamaged, KeyError):
        return f"{file.parent.name}: its {file.name} cannot be read", False
    if study is None or study.id != file.parent.name:
        return f"{name}: begun with another version of the solver", False
    if study.kind.chooses:
        return f"{study.name}: the {study.kind.work} has not ended", False
    finished = len(store.modified(study.run_ids()))
    return f"{study.name}: {finished} of {study.size} runs finished", True
