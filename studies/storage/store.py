"""The directory that holds runs, studies and the catalogue.

```
runs/<run id>.nc              one file a run, shared by all studies
studies/<study id>/study.json
studies/<study id>/dataset.nc the runs of a study combined
catalogue.sqlite              made anew from the files when it is missing or damaged
```
A file appears under its name only when it is complete.
"""

from __future__ import annotations

import fcntl
import json
import os
import sqlite3
import uuid
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import h5py
import xarray as xr

from studies.definition.identity import is_id
from studies.definition.study import Study
from studies.errors import StoreBusy, StudyError
from studies.storage import dataset as layout
from studies.storage.catalogue import Catalogue

ENGINE: Literal["h5netcdf"] = "h5netcdf"
"""netCDF backend of every file read or written here; safe with several threads."""


class Store:
    """Results under one directory.

    Parameters
    ----------
    directory : made by the first write
    """

    def __init__(self, directory: Path | str, held: bool = False) -> None:
        self.directory = Path(directory)
        self.held = held
        self.catalogue = Catalogue(self.directory / "catalogue.sqlite")

    def run_path(self, run_id: str) -> Path:
        """Return where the file of a run is or will be."""
        return self.directory / "runs" / f"{_checked(run_id)}.nc"

    def study_directory(self, study_id: str) -> Path:
        """Return the directory of a study."""
        return self.directory / "studies" / _checked(study_id)

    def dataset_path(self, study_id: str) -> Path:
        """Return where the combined data set of a study is or will be."""
        return self.study_directory(study_id) / "dataset.nc"

    def save_study(self, study: Study) -> Path:
        """Keep what the study asks for, and return its directory."""
        directory = self.study_directory(study.id)
        if not (directory / "study.json").exists():
            directory.mkdir(parents=True, exist_ok=True)
            with appearing(directory / "study.json") as part:
                part.write_text(json.dumps(study.to_dict(), indent=2) + "\n", encoding="utf-8")
        return directory

    def write_run(self, run: xr.Dataset) -> dict[str, Any]:
        """Write the file of one run, and return its row for the catalogue."""
        path = self.run_path(run.attrs["id"])
        path.parent.mkdir(parents=True, exist_ok=True)
        with appearing(path) as part:
            run.to_netcdf(part, engine=ENGINE, encoding=layout.encoding(run))
        return layout.summary(run.attrs, layout.singles(run))

    def read_row(self, run_id: str) -> dict[str, Any]:
        """Return the catalogue's row of a run, read from its file.

        h5py reads the few values needed; xarray would take fifty times as long.
        """
        with h5py.File(self.run_path(run_id), "r") as run:
            rank = run["status"].ndim
            wanted = {name: each for name, each in run.items() if each.ndim == rank}
            values = {
                name: (each.asstr() if each.dtype.kind == "O" else each)[...].item()
                for name, each in wanted.items()
                if not each.is_scale
            }
            return layout.summary(run.attrs, values)

    def discard(self, run_ids: Collection[str]) -> None:
        """Delete runs that shall be computed again."""
        for run_id in run_ids:
            self.run_path(run_id).unlink(missing_ok=True)
        self.catalogue.remove(run_ids)

    def reconcile(self) -> None:
        """Bring the catalogue into line with the files that exist and can be read."""
        try:
            known = self.catalogue.ids()
        except sqlite3.OperationalError:  # such as a locked file, which is not damaged
            raise
        except sqlite3.DatabaseError:
            for damaged in self.directory.glob(f"{self.catalogue.path.name}*"):  # and its journal
                damaged.unlink()
            known = set()
        found = self._files()
        self.catalogue.remove(known - found)
        self.catalogue.put(self.read_row(run_id) for run_id in found - known)

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Hold the directory as its only writer; delete the unfinished files of killed writers.

        Raises
        ------
        StoreBusy
            when another process holds it
        StudyError
            when it cannot be written to
        """
        if self.held:
            yield
            return
        try:
            (self.directory / "runs").mkdir(parents=True, exist_ok=True)
            holding = (self.directory / ".lock").open("w")
        except OSError as error:
            allowed = f"must be a directory to write in ({error.strerror})"
            raise StudyError("directory", str(self.directory), allowed) from None
        with holding as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise StoreBusy(
                    f"{self.directory}: another process computes here; "
                    "wait until it has ended, or name another directory"
                ) from None
            for part in self.directory.rglob("*.part"):
                part.unlink(missing_ok=True)
            self.reconcile()
            yield

    def _files(self) -> set[str]:
        """Return the ids of all runs whose file can be read."""
        found = (self.directory / "runs").glob("*.nc")
        return {path.stem for path in found if is_id(path.stem) and _opens(path)}


@contextmanager
def appearing(path: Path) -> Iterator[Path]:
    """Give a path to write to; what was written appears under `path` at once, or not at all."""
    part = path.with_name(f"{path.name}.{uuid.uuid4().hex}.part")
    try:
        yield part
        with part.open("rb") as written:
            os.fsync(written.fileno())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def _opens(path: Path) -> bool:
    """Tell whether a file is complete, as far as its head and its length tell."""
    try:
        with h5py.File(path, "r"):
            return True
    except OSError:
        return False


def _checked(content_id: str) -> str:
    if not is_id(content_id):
        raise ValueError(f"{content_id!r} is not a content id")
    return content_id
