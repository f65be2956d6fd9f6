"""A data set alone, read as a store: the file of a run is made when somebody asks for it."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
import xarray as xr

from solver.files import appearing
from studies.definition.identity import is_id
from studies.definition.vocabulary import MISSING
from studies.errors import StudyError
from studies.storage import dataset as layout
from studies.storage import seal
from studies.storage.frame import SETS
from studies.storage.store import Store
from studies.views.columns import or_none
from studies.views.picking import over_runs, own_grid
from studies.views.reading import check, indexed, one_error

_TEXTS = ("status", "message")


class Unpacked(Store):
    """The runs of a data set, in the order of its sweep.

    The ids of runs are made of that of the data set, in which they are not.

    Attributes
    ----------
    study_id, run_ids : id of the study; id of each run, with its position
    counts : number of runs by status; those that are missing have no file
    content : what the data set says of its study: name, scene, parameters, sweep

    Raises
    ------
    StudyError
        if it is not the data set of a study, or was damaged
    """

    def __init__(self, path: Path, directory: Path) -> None:
        super().__init__(directory)
        self.path, self._one = path, Lock()
        check(path)
        with self._opened() as dataset:
            if any(name not in dataset for name in _TEXTS) or "parameters" not in dataset.attrs:
                raise StudyError("path", str(path), "must be the data set of a study, or of a run")
            known = str(dataset.attrs.get("id", ""))
            self.study_id = known if is_id(known) else _id(str(path.resolve()), 0)
            outcomes = dataset["status"].to_numpy().ravel().tolist()
            self.counts = Counter(map(str, outcomes))
            self.run_ids = {_id(self.study_id, at): at for at in range(len(outcomes))}
            self._there = {each for each, at in self.run_ids.items() if outcomes[at] != MISSING}
            self.content = _content(dataset)
            self.catalogue.put(self._rows(dataset))

    def dataset(self, study_id: str) -> Path:
        """Return the path of the data set."""
        return self.path

    def run_path(self, run_id: str) -> Path:
        """Return the path of the file of a run, which is made if it is not there."""
        path = super().run_path(run_id)
        with self._one:
            if run_id in self._there and not path.exists():
                path.parent.mkdir(exist_ok=True)
                with appearing(path) as part:
                    with self._opened() as dataset:
                        run = self._run(dataset, run_id)
                        run.to_netcdf(part, engine="h5netcdf")
                    seal.seal(part, f"run {run_id}")
        return path

    def _opened(self) -> xr.Dataset:
        """Return the data set, read by h5py: its calls wait for those of other threads."""
        with one_error(self.path):
            return indexed(xr.open_dataset(self.path, engine="h5netcdf"))

    def _run(self, dataset: xr.Dataset, run_id: str) -> xr.Dataset:
        """Return a run as its file has it: with the axes of the sweep, on its own grid."""
        axes = dataset["status"].dims
        at = np.unravel_index(self.run_ids[run_id], dataset["status"].shape)
        place = dict(zip(axes, map(int, at), strict=True))
        over = [  # a run has no texts beside its outcome; those of a search are ids of others
            name for name, each in dataset.data_vars.items()
            if {*axes} <= {*each.dims} and (each.dtype.kind in "fiub" or name in _TEXTS)
        ]  # fmt: skip
        run = own_grid(dataset[over].isel(place).load()).drop_encoding()
        run = run.drop_vars(
            [n for n, each in run.coords.items() if not each.dims and n not in axes]
        )
        run = run.expand_dims({axis: [run[axis].item()] for axis in reversed(axes)})
        run = run.transpose(*axes, ...)
        for axis in axes:
            run[axis].attrs = dataset[axis].attrs
        attrs = {**dataset.attrs, **seal.SEALED, "id": run_id}
        attrs["parameters"] = json.dumps(self._parameters(place))
        attrs["variables"] = " ".join(map(str, run.variables))
        return run.assign_attrs(attrs)

    def _rows(self, dataset: xr.Dataset) -> Iterator[dict[str, Any]]:
        """Yield the rows of the runs that are there for the catalogue."""
        axes, shape = dataset["status"].dims, dataset["status"].shape
        over = over_runs(dataset)
        numbers = {n: each.to_numpy() for n, each in over.items() if each.dtype.kind in "fiub"}
        texts = {name: over[name].to_numpy() for name in _TEXTS}
        for run_id, at in zip(self.run_ids, np.ndindex(shape), strict=True):
            if run_id not in self._there:
                continue
            place = dict(zip(axes, at, strict=True))
            attributes = {**dataset.attrs, "id": run_id}
            attributes["parameters"] = json.dumps(self._parameters(place))
            told = {name: str(each[at]) for name, each in texts.items()}
            scalars = {name: or_none(each[at]) for name, each in numbers.items()}
            yield layout.summary(attributes, told) | {
                "scalars": scalars, "cpu_seconds": scalars.get("cpu_seconds"),
            }  # fmt: skip

    def _parameters(self, place: dict[Any, int]) -> dict[str, Any]:
        """Return the parameters of a run: those of the study, and those of its place."""
        own: dict[str, Any] = dict(self.content["parameters"])
        for name, axis in self.content["sweep"].items():
            value = (list(axis.values()) if isinstance(axis, dict) else axis)[place[name]]
            own |= value if isinstance(value, dict) else {name: value}
        return own


def _content(dataset: xr.Dataset) -> dict[str, Any]:
    """Return what a data set says of its study."""
    sweep = {str(axis): _axis(dataset, axis) for axis in dataset["status"].dims}
    found = {
        "name": str(dataset.attrs["title"]),
        "scene": str(dataset.attrs["scene"]),
        "parameters": json.loads(dataset.attrs["parameters"]),
        "sweep": sweep,
    }
    words = {"note": dataset.attrs.get("note"), "tags": str(dataset.attrs.get("tags", "")).split()}
    return found | {name: each for name, each in words.items() if each}


def _axis(dataset: xr.Dataset, axis: Any) -> Any:
    """Return the values of an axis; of labels and points also the parameters that they set."""
    values = [or_none(each) for each in dataset[axis].to_numpy()]
    if SETS not in dataset[axis].attrs:
        return values
    names = str(dataset[axis].attrs[SETS]).split()
    over = {name: dataset[name].to_numpy() for name in names}
    sets = [{name: or_none(each[k]) for name, each in over.items()} for k in range(len(values))]
    if dataset[axis].dtype.kind in "if":
        return sets
    return dict(zip(values, sets, strict=True))


def _id(study_id: str, position: int) -> str:
    return hashlib.sha256(f"{study_id} {position}".encode()).hexdigest()[:32]
