"""The directory that holds runs, studies and the catalogue.

```
runs/<run id>.nc              one file a run, shared by all studies
scenes/<scene id>/             scenes of files: scene.json and the meshes
studies/<study id>/study.json
studies/<study id>/dataset.nc the runs of a study combined
studies/<study id>/made.json  digests of its inputs, and of files made from it
catalogue.sqlite              made again from the files if it is missing or damaged
unreadable/                   files that were damaged or in a wrong place
```
A file gets its name only when it is complete; that of a run, only after it has been read back and
compared with the results. It is valid if its checksum is correct and its id is its name. It is
verified in full when a study uses it, and when its length or time of change differs from the
catalogue.
"""

from __future__ import annotations

import itertools
import json
import logging
import tempfile
import time
import uuid
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from solver.results.record import Record
from solver.scenes import Scene
from studies.definition.cases import Case
from studies.definition.identity import is_id
from studies.definition.study import Study
from studies.errors import CatalogueDamaged, RunUnreadable, Unusable
from studies.storage import dataset as layout
from studies.storage import runfile, shelf
from studies.storage.appearing import appearing
from studies.storage.catalogue import Catalogue, Row
from studies.storage.lock import locked
from studies.storage.readback import verified
from studies.storage.room import needs_room

_BATCH = 500
"""Number of runs that are verified before their rows are written."""

_UNFINISHED = 600.0
"""Seconds after which an unfinished file beside a data set counts as abandoned."""
_LOG = logging.getLogger("studies")


class Store:
    """Results under one directory.

    Methods that write raise `StoreFull` if the disk is full, and `StudyError` if the directory is
    not writable.

    Parameters
    ----------
    directory : the directory; the first write creates it
    held : whether the caller already has the writer's lock, as the service has for its children
    """

    def __init__(self, directory: Path | str, held: bool = False) -> None:
        self.directory = Path(directory)
        self.held = held
        self.catalogue = Catalogue(self.directory / "catalogue.sqlite")

    def run_path(self, run_id: str) -> Path:
        """Return the path of the file of a run."""
        return self.directory / "runs" / f"{_checked(run_id)}.nc"

    def study_directory(self, study_id: str) -> Path:
        """Return the directory of a study."""
        return self.directory / "studies" / _checked(study_id)

    def dataset_path(self, study_id: str) -> Path:
        """Return the path of the combined data set of a study."""
        return self.study_directory(study_id) / "dataset.nc"

    def scene(self, scene_id: str) -> Scene | None:
        """Return the scene from a file that is stored here under this id, or None."""
        return shelf.kept(self.directory, scene_id) if is_id(scene_id) else None

    def save_scene(self, scene: Scene) -> None:
        """Store a scene from a file, so that studies can name it by its id."""
        with self._writable():
            shelf.keep(self.directory, scene)

    def outcomes(self, study_id: str) -> Counter[str]:
        """Return the number of runs by status in the data set of a study."""
        import h5py

        try:
            with h5py.File(self.dataset_path(study_id), "r") as file:
                return Counter(file["status"].asstr()[...].ravel().tolist())
        except (OSError, KeyError, TypeError, RuntimeError):
            return Counter()

    def save_study(self, study: Study) -> Path:
        """Store the definition of the study and its scene, and return its directory."""
        self.save_scene(study.problem)
        directory = self.study_directory(study.id)
        path = directory / "study.json"
        if not _holds_json(path):
            with self._writable():
                directory.mkdir(parents=True, exist_ok=True)
                self.clear_directory(path)
                with appearing(path) as part:
                    part.write_text(json.dumps(study.to_dict(), indent=2) + "\n", encoding="utf-8")
        return directory

    def write_run(self, case: Case, outcome: Record | str, keep: str = "") -> Row:
        """Write the file of one run, read it back, and return its row for the catalogue.

        Parameters
        ----------
        outcome : the record of the run, or the reason why there is none
        keep : what is kept in addition to the results of the scene

        Raises
        ------
        FileDiffers
            if the file differs from the record; then there is no file
        """
        if isinstance(outcome, str):
            run = layout.broken_content(case.scene, case, outcome)
        else:
            outcome = outcome.with_one_mesh()
            run = layout.run_content(case.scene, case, outcome, keep)
        path = self.run_path(case.id)
        content = runfile.sealed(run)
        with self._writable():
            path.parent.mkdir(parents=True, exist_ok=True)
            with appearing(path) as part:
                part.write_bytes(content)
                row = verified(part, case, outcome, keep)
            return row | runfile.stamp(path)

    def read_row(self, run_id: str) -> Row:
        """Return the catalogue's row of a run, read from its file.

        Raises
        ------
        RunUnreadable
            if the file is missing, damaged, or that of another run
        """
        return runfile.row(self.run_path(run_id))

    def found(self, run_id: str, known: Row | None = None) -> Row | None:
        """Return the row of a run from its file; an unreadable file is moved to ``unreadable/``.

        Parameters
        ----------
        run_id : id of the run
        known : its row in the catalogue, which makes opening an unchanged file unnecessary
        """
        path = self.run_path(run_id)
        try:
            if known and runfile.verify(path) and known | runfile.stamp(path) == known:
                return known
            return self.read_row(run_id)
        except RunUnreadable as error:
            self.set_aside(error)
            return None

    def sound(self, run_ids: Iterable[str]) -> dict[str, Row]:
        """Return, by id, the rows of the runs whose file exists and is valid.

        Every file is verified in full; invalid ones are moved to ``unreadable/``. The catalogue is
        updated to the files.
        """
        wanted = list(run_ids)
        try:
            return self._sound(wanted)
        except CatalogueDamaged:
            self.reconcile()
            return self._sound(wanted)

    def _sound(self, wanted: Sequence[str]) -> dict[str, Row]:
        known = self.catalogue.rows(wanted)
        there = [each for each in wanted if each in known or self.run_path(each).exists()]
        found = {run_id: self.found(run_id, known.get(run_id)) for run_id in there}
        rows = {run_id: row for run_id, row in found.items() if row}
        if gone := known.keys() - rows.keys():
            self.catalogue.remove(gone)
        if fresh := [row for run_id, row in rows.items() if row != known.get(run_id)]:
            self.catalogue.put(fresh)
        return rows

    def set_aside(self, error: RunUnreadable) -> None:
        """Move an unreadable file to ``unreadable/``, so that the run is computed again."""
        path = self.run_path(error.run_id)
        if path.exists():
            self._move(path, f"{error.reason}; the run will be computed again")

    def modified(self, run_ids: Iterable[str]) -> dict[str, int]:
        """Return, by id, the time of change [ns] of the files of runs that exist."""
        times = {}
        for run_id in run_ids:
            with suppress(FileNotFoundError):
                times[run_id] = self.run_path(run_id).stat().st_mtime_ns
        return times

    def discard(self, run_ids: Collection[str]) -> None:
        """Delete runs: their files, then their rows."""
        for run_id in run_ids:
            self.run_path(run_id).unlink(missing_ok=True)
        self.catalogue.remove(run_ids)

    def delete_run(self, run_id: str) -> None:
        """Delete a run: its file and its row."""
        self.discard([run_id])

    def reconcile(self) -> None:
        """Update the catalogue to the files that exist and can be read."""
        try:
            known = self.catalogue.stamps()
        except CatalogueDamaged as error:
            for damaged in self.directory.glob(f"{self.catalogue.path.name}*"):  # and its journal
                self.clear_directory(damaged)
                damaged.unlink(missing_ok=True)
            _LOG.warning("%s", error)
            known = {}
        there = {
            path.stem: tuple(runfile.stamp(path).values())
            for path in (self.directory / "runs").glob("*.nc")
            if is_id(path.stem)
        }
        self.catalogue.remove(known.keys() - there.keys())
        changed = iter([run_id for run_id, state in there.items() if known.get(run_id) != state])
        while batch := list(itertools.islice(changed, _BATCH)):
            self.sound(batch)

    @contextmanager
    def writing(self, tidy: bool = True) -> Iterator[None]:
        """Lock the directory, as its only writer.

        With `tidy`, unfinished files of killed writers are deleted. A store whose caller has the
        lock (`held`) does nothing here.

        Raises
        ------
        StoreBusy
            if another process has the lock
        StudyError
            if the directory is not writable
        """
        if self.held:
            yield
            return
        with self._writable():
            for name in ("runs", "studies"):
                (self.directory / name).mkdir(parents=True, exist_ok=True)
                with tempfile.TemporaryFile(dir=self.directory / name):
                    pass  # a directory may exist and still not be writable
            file = (self.directory / ".lock").open("a+", encoding="ascii")
        with locked(self.directory, file):
            parts = self.directory.glob("*/**/*.part") if tidy else ()  # keys are next to them
            for part in filter(_left, parts):
                part.unlink(missing_ok=True)
            self.reconcile()
            yield

    @contextmanager
    def _writable(self) -> Iterator[None]:
        """Raise `Unusable`, with the directory as it was given, if it is not writable."""
        try:
            with needs_room(self.directory):
                yield
        except OSError as error:
            allowed = f"must be a directory to write in ({error.strerror})"
            raise Unusable("directory", str(self.directory), allowed) from None

    def clear_directory(self, path: Path) -> None:
        """Move a directory that has the name of a file to ``unreadable/``."""
        if path.is_dir():
            self._move(path, "it is a directory instead of a file")

    def _move(self, path: Path, reason: str) -> None:
        """Move a file or directory to ``unreadable/``, and log it in one line."""
        target = self.directory / "unreadable" / path.name
        with self._writable():
            target.parent.mkdir(exist_ok=True)
            if target.exists():
                target = target.with_name(f"{path.name}.{uuid.uuid4().hex}")
            path.rename(target)
        here, there = (each.relative_to(self.directory) for each in (path, target))
        _LOG.warning("%s cannot be read and is now %s: %s", here, there, reason)


def _left(part: Path) -> bool:
    """Whether an unfinished file is abandoned; a report is written without the lock."""
    try:
        return part.parent.name == "runs" or time.time() - part.stat().st_mtime > _UNFINISHED
    except FileNotFoundError:
        return False


def _holds_json(path: Path) -> bool:
    try:
        json.loads(path.read_bytes())
    except (OSError, ValueError):
        return False
    return True


def _checked(content_id: str) -> str:
    if not is_id(content_id):
        raise ValueError(f"{content_id!r} is not a content id")
    return content_id
