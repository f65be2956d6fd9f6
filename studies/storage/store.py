"""What holds runs, studies and the catalogue: a directory, or an address of an object store.

```
runs/<run id>.nc              one file a run, shared by all studies
scenes/<scene id>/             scenes of files: scene.json, the meshes and their arrays
studies/<study id>/study.json
studies/<study id>/dataset.nc the runs of a study combined
studies/<study id>/made.json  digests of its inputs, and of files made from it
claims/                        what processes that share the directory compute now
catalogue.sqlite              made again from the files if it is missing or damaged
scenes.sqlite                 index of the scenes, likewise
unreadable/                   what was damaged or in a wrong place
```
A file gets its name only when it is complete; that of a run, only after it has been read back and
compared with the results. Each has a seal (`studies.storage.seal`), which is checked whenever it is
read. What fails is moved to ``unreadable/``, told in one line, and made again where it can be.
`studies.storage.blobs` says where the files are; the catalogue is always on this machine.
"""

from __future__ import annotations

import logging
import os
import tempfile
import time
import uuid
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from itertools import chain, islice
from pathlib import Path
from typing import Any, TypeVar

from solver.files import appearing
from solver.results.record import Record
from solver.scenes import Scene
from studies.definition.cases import Case
from studies.definition.identity import is_id
from studies.definition.study import Study
from studies.errors import CatalogueDamaged, FileDamaged, StoreFull, StudyError, Unusable
from studies.scenes.file_scene import FileScene
from studies.scenes.registry import known_names
from studies.storage import dataset as layout
from studies.storage import ran, runfile, seal, shelf, ugrid
from studies.storage.blobs import blobs_at
from studies.storage.catalogue import BATCH, Catalogue, Row
from studies.storage.readback import verified
from studies.storage.room import needs_room

_STUDY, _DATASET = "study.json", "dataset.nc"
_UNFINISHED = 600.0
"""Seconds after which an unfinished file beside a data set counts as abandoned."""
_LOG = logging.getLogger("studies")
_LISTED = 10
"""Number of posted scenes of one name that an error lists."""

Found = TypeVar("Found")


class Store:
    """Results under one directory.

    Methods that write raise `StoreFull` if the disk is full, and `StudyError` if the directory is
    not writable.

    Parameters
    ----------
    directory : the directory; the first write creates it. Or an address, ``s3://bucket/results``
    held : whether the caller already has the writer's lock, as the service has for its children
    aside : folder of the catalogue and the index of scenes, for a directory that is only read:
        nothing is written or moved in it
    """

    def __init__(
        self, directory: Path | str, held: bool = False, aside: Path | None = None
    ) -> None:
        self.blobs = blobs_at(directory)
        self.directory = self.blobs.directory
        self.held, self.aside = held, aside
        self._refused: set[str] = set()
        self._lists = aside or self.directory
        self.catalogue = Catalogue(self._lists / "catalogue.sqlite", self.directory / "runs")

    def run_path(self, run_id: str) -> Path:
        """Return the path of the file of a run."""
        return self.blobs.path(_run(run_id))

    @property
    def address(self) -> Path | str:
        """What opens the store in another process: the whole path of its directory, or a URL."""
        address = self.blobs.address
        return address if isinstance(address, str) else address.resolve()

    def stored_runs(self) -> set[str]:
        """Return the ids of the runs that have a file."""
        return {Path(name).stem for name in self.blobs.names("runs/*.nc")}

    def study_ids(self) -> list[str]:
        """Return the ids of the studies whose definition is here, in order."""
        there = (name.split("/")[1] for name in self.blobs.names(f"studies/*/{_STUDY}"))
        return sorted(filter(is_id, there))

    def dataset_path(self, study_id: str) -> Path:
        """Return the path of the combined data set of a study."""
        return self.study_path(study_id, _DATASET)

    def study_path(self, study_id: str, name: str = "") -> Path:
        """Return the path of a file in the directory of a study, or without a name of all."""
        return self.blobs.path(_study(study_id, name))

    @contextmanager
    def appearing(self, study_id: str, name: str = _DATASET) -> Iterator[Path]:
        """Give a path to write to, which becomes a file of a study, by default its data set."""
        with needs_room(self.directory), self.blobs.appearing(_study(study_id, name)) as part:
            yield part

    def scene(self, scene_id: str, whole: bool = True) -> Scene | None:
        """Return the scene from a file that is stored here under this id, or None.

        A damaged one is set aside. One that this version does not allow stays, and is told once.

        One that is not ``whole`` has no meshes, so that it takes little time and memory.
        """
        try:
            return shelf.stored(self.blobs, scene_id, whole) if is_id(scene_id) else None
        except FileDamaged as error:
            self.set_aside(error, "post the scene again")
            return None
        except ValueError as error:
            if scene_id not in self._refused:
                self._refused.add(scene_id)
                reason = f"{error}".replace("\n", " ")
                _LOG.warning("scenes/%s is not allowed in this version: %s", scene_id, reason)
            return None

    def scenes(self, limit: int, offset: int = 0, name: str | None = None) -> list[shelf.Entry]:
        """Return a page of the scenes that are stored here, or of those of a name, newest first."""
        return self._indexed(lambda index: index.page(limit, offset, name))

    def scene_id(self, name: str) -> str:
        """Return the id of the scene that is stored here under a name; else the name itself.

        Raises
        ------
        StudyError
            if several have it
        """
        if not name or is_id(name) or name in known_names():
            return name
        found = self.scenes(limit=_LISTED + 1, name=name)
        if len(found) > 1:
            ids = ", ".join(each.id for each in found[:_LISTED])
            more = len(found) > _LISTED
            count, rest = (f"over {_LISTED}", " and more") if more else (len(found), "")
            allowed = f"is the name of {count} posted scenes: give an id, one of {ids}{rest}"
            raise StudyError("scene", name, allowed)
        return found[0].id if found else name

    def scene_files(self) -> list[shelf.Entry]:
        """Return the files of all scenes, the oldest first, also of those not allowed here."""
        return self._indexed(shelf.Index.files)

    def _indexed(self, ask: Callable[[shelf.Index], Found]) -> Found:
        """Return what is asked of the index of scenes, which follows the files first.

        Raise `CatalogueDamaged` if it is damaged again after it was made again.
        """
        index = shelf.Index(self.blobs, self._lists)

        def asked() -> Found:
            with suppress(StoreFull):  # then the latest ones are missing
                index.follow(lambda scene_id: self.scene(scene_id, whole=False), self._refused)
            return ask(index)

        state = seal.state_of(index.path)
        try:
            return asked()
        except CatalogueDamaged as error:
            damaged = FileDamaged(index.path, index.path.name, str(error.__cause__), state)
            self.set_aside(damaged, "it is made again from the scenes")
        return asked()

    def save_scene(self, scene: Scene) -> None:
        """Store a scene from a file, so that studies can name it by its id."""
        if isinstance(scene, FileScene) and scene.posted:
            self.keep_scene(scene.id, scene.description)

    def keep_scene(self, scene_id: str, description: Any, owner: str = "") -> bool:
        """Store a scene of this content id for an owner; return whether it is new."""
        new = self.scene(scene_id) is None  # a damaged one is set aside, and so written again
        if new:
            with self._writable():
                shelf.keep(self.blobs, scene_id, description, owner)
        return new

    def discard_scene(self, scene_id: str) -> None:
        """Delete a scene."""
        self.blobs.remove(f"scenes/{_checked(scene_id)}")

    def discard_study(self, study_id: str, files: str = "") -> None:
        """Delete the definition of a study and what was made of its runs, or ``files`` of these."""
        for name in self.blobs.names(_study(study_id, files)) if files else [_study(study_id)]:
            self.blobs.remove(name)

    def size(self, *patterns: str) -> int:
        """Return the bytes of the files whose names match, or are given."""
        found = ([each] if "*" not in each else self.blobs.names(each) for each in patterns)
        names = chain.from_iterable(found)
        return sum(size for size, _ in self.blobs.stamps(names).values())

    def dataset(self, study_id: str) -> Path:
        """Return the path of the data set of a study, checked.

        Raises
        ------
        FileDamaged
            if it is missing (`state` is None) or was damaged, and is now set aside
        """
        path = self.dataset_path(study_id)
        try:
            seal.check(path, f"dataset {study_id}")
        except FileDamaged as error:
            self.set_aside(error, "it is made again from the runs")
            raise
        return path

    def outcomes(self, study_id: str) -> Counter[str]:
        """Return the number of runs by status in the data set of a study."""
        import h5py

        try:
            with h5py.File(self.dataset(study_id), "r") as file:
                return Counter(file["status"].asstr()[...].ravel().tolist())
        except FileDamaged:
            return Counter()

    def runs_of(self, study: Study) -> set[str]:
        """Return the ids of the runs of a study; if it chooses them, those that it has asked for.

        What it has asked for is known at its end. Until then all runs of its scene count.
        """
        if not study.kind.chooses:
            return set(study.run_ids())
        asked = self.asked(study)
        if asked is not None:
            return asked
        return {row["id"] for row in self.catalogue.runs(scene=study.problem.name, limit=-1)[0]}

    def asked(self, study: Study) -> set[str] | None:
        """Return the ids of the runs that a study has asked for; None before the end of its search.

        They are in its data set.
        """
        import h5py

        with suppress(FileDamaged), h5py.File(self.dataset(study.id), "r") as file:
            standing, unended, runs = study.kind.ends
            if unended not in set(file[standing].asstr()[...].ravel()):
                return {each for each in file[runs].asstr()[...].ravel() if each}
        return None

    def study(self, study_id: str) -> Study:
        """Return the study of this id, as it was saved.

        Raises
        ------
        FileDamaged
            if its file is missing (`state` is None) or was damaged, and is now set aside
        StudyError
            if another version of the solver computed it, or the scene has changed
        """
        path = self.study_path(study_id, _STUDY)
        try:
            study = Study.known(seal.content_of(path, f"study {study_id}"), self.scene)
        except FileDamaged as error:
            self.set_aside(error, "it is written again where the study is known")
            raise
        if study.id != study_id:
            allowed = "was computed by another version of the solver"
            raise StudyError("study", study_id, allowed)
        return study

    def definition(self, name: str) -> Mapping[str, Any] | None:
        """Return the content of the study of this id or name; None if there is none.

        Raises
        ------
        StudyError
            if several studies have the name
        """
        found: dict[str, Mapping[str, Any]] = {}
        for study_id in [name] if is_id(name) else self.study_ids():
            path = self.study_path(study_id, _STUDY)
            with suppress(FileDamaged):
                content = seal.content_of(path, f"study {study_id}")
                if name in (study_id, content.get("name")):
                    found[study_id] = content
        if len(found) > 1:
            ids = ", ".join(found)
            raise StudyError(
                "extends", name, f"is the name of several studies: give an id of {ids}"
            )
        return next(iter(found.values()), None)

    def save_study(self, study: Study, keep: bool = False) -> Path:
        """Store the definition of the study and its scene, and return its directory."""
        self.save_scene(study.problem)
        return self.save_definition(study.id, study.to_dict(files=True), keep)

    def save_definition(
        self, study_id: str, content: Mapping[str, Any], keep: bool = False
    ) -> Path:
        """Store the content of a study, unless it is stored, and return its directory.

        What does not count for the id, such as its DOI, is that of the last time; or, with
        ``keep``, of the first.
        """
        path, name = self.study_path(study_id, _STUDY), f"study {study_id}"
        text = seal.sealed_json(name, content)
        try:
            seal.check(path, name)
            if keep or seal.digest(path) == seal.digest_of(text):
                return path.parent
        except FileDamaged as error:
            with suppress(FileDamaged):  # one of an earlier version has no seal
                if seal.sealed_json(name, seal.content_of(path, name)) == text:
                    error.state = None
            self.set_aside(error, "it is written again")
        with self._writable(), self.blobs.appearing(_study(study_id, _STUDY)) as part:
            part.write_bytes(text)
        return path.parent

    def write_run(self, case: Case, outcome: Record | str, keep: str = "", began: str = "") -> Row:
        """Write the file of one run, read it back, and return its row for the catalogue.

        Parameters
        ----------
        outcome : the record of the run, or the reason why there is none
        keep : what is kept in addition to the results of the scene
        began : time at which this process began to compute it (`ran.now`); empty if it did not

        Raises
        ------
        FileDiffers
            if the file differs from the record; then there is no file
        """
        if not isinstance(outcome, str):
            outcome = outcome.with_one_mesh()
        content = layout.run_content(case.scene, case, outcome, keep, ran.how(began))
        whole = runfile.sealed(content)
        with self._writable():
            with self.blobs.appearing(_run(case.id)) as part:
                part.write_bytes(whole)
                row = verified(part, case, outcome, keep)
            return row | runfile.stamp(self.run_path(case.id))

    def found(self, run_id: str, known: Row | None = None) -> Row | None:
        """Return the row of a run from its file; None if it has none, or one that is set aside.

        Parameters
        ----------
        run_id : id of the run
        known : its row in the catalogue, which makes opening an unchanged file unnecessary
        """
        path = self.run_path(run_id)
        try:
            runfile.verify(path)
            if known and known | runfile.stamp(path) == known:
                return known
            return runfile.row(path)
        except FileDamaged as error:
            self.set_aside(error, "the run will be computed again")
            return None

    def begun(self, case: Case) -> tuple[int, dict[str, Any]] | None:
        """Return the branch value and the state of the longest stored run that a run goes on from.

        None if no shorter run is stored with its state.
        """
        values = case.shorter
        for run_id in sorted(self.modified(values), key=values.__getitem__, reverse=True):
            # without it the run begins at the start
            with suppress(FileDamaged, OSError), runfile.opened(self.run_path(run_id)) as run:
                if state := ugrid.state_of(run):
                    return values[run_id], state
        return None

    def run(self, run_id: str) -> Row | None:
        """Return the row of a run whose file is valid; the catalogue is updated to the file."""
        return self._sound([run_id]).get(run_id)

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
        stored = self.modified(each for each in wanted if each not in known)
        there = [each for each in wanted if each in known or each in stored]
        found = {run_id: self.found(run_id, known.get(run_id)) for run_id in there}
        rows = {run_id: row for run_id, row in found.items() if row}
        if gone := known.keys() - rows.keys():
            self.catalogue.remove(gone)
        if fresh := [row for run_id, row in rows.items() if row != known.get(run_id)]:
            self.catalogue.put(fresh)
        return rows

    def set_aside(self, error: FileDamaged, then: str) -> None:
        """Move what is damaged to ``unreadable/``, unless it is gone or another one by now."""
        if error.state is not None and seal.state_of(error.path) == error.state:
            self.put_aside(error.path, error.reason, then)

    def put_aside(self, path: Path, reason: str, then: str) -> None:
        """Move a file or directory, if there is one, to ``unreadable/``, and log it in one line.

        In a directory that is only read it stays.
        """
        if not os.path.lexists(path):
            return
        if self.aside:
            _LOG.warning("%s cannot be read: %s", path.name, reason)
            return
        here = path.relative_to(self.directory)
        target = Path("unreadable") / ".".join(here.parts[1:] or here.parts)
        try:
            (self.directory / target).parent.mkdir(exist_ok=True)
            if (self.directory / target).exists():
                target = target.with_name(f"{target.name}.{uuid.uuid4().hex}")
            self.blobs.move(str(here), str(target))
            now = f"is now {target}"
        except OSError as failed:
            now = f"stays, because it cannot be moved ({failed.strerror})"
        _LOG.warning("%s cannot be read and %s: %s; %s", here, now, reason, then)

    def modified(self, run_ids: Iterable[str]) -> dict[str, int]:
        """Return, by id, the time of change [ns] of the files of runs that exist."""
        names = {_run(run_id): run_id for run_id in run_ids}
        return {names[name]: time for name, (_, time) in self.blobs.stamps(names).items()}

    def discard(self, run_ids: Collection[str]) -> None:
        """Delete runs: their files, then their rows."""
        for run_id in run_ids:
            self.blobs.remove(_run(run_id))
        self.catalogue.remove(run_ids)

    def reconcile(self) -> None:
        """Update the catalogue to the files that exist and can be read.

        One that is missing or damaged is made again, and appears when it is complete.
        """
        path = self.catalogue.path
        self.blobs.follow()
        try:
            known = self.catalogue.stamps()
        except CatalogueDamaged as error:
            anew = Store(self.directory, held=True, aside=self.aside)
            for old in (path, path.with_name(f"{path.name}-journal")):
                self.put_aside(old, str(error.__cause__), "it is made again from the runs")
            with self._writable(), appearing(path) as part:
                anew.catalogue = Catalogue(part)
                anew._follow({})
            _LOG.warning("%s has been made again from the files of the runs", path.name)
            known = self.catalogue.stamps()
        self.catalogue.damaged = False
        self._follow(known)  # after it was made again, what was stored meanwhile

    def _follow(self, known: Mapping[str, tuple[int | None, int | None]]) -> None:
        """Update the catalogue, in which these runs have these stamps, to the files."""
        stamps = self.blobs.stamps(self.blobs.names("runs/*.nc"))
        there = {Path(name).stem: stamp for name, stamp in stamps.items()}
        there = {run_id: stamp for run_id, stamp in there.items() if is_id(run_id)}
        self.catalogue.remove(known.keys() - there.keys())
        changed = iter([run_id for run_id, state in there.items() if known.get(run_id) != state])
        while batch := list(islice(changed, BATCH)):
            self._sound(batch)

    @contextmanager
    def writing(self, tidy: bool = True) -> Iterator[None]:
        """Lock the directory, as its only writer.

        With `tidy`, unfinished files of killed writers are deleted. A store whose caller has the
        lock (`held`) does nothing here.

        Raise `StoreBusy` if another process has the lock.
        """
        if self.held:
            yield
            return
        with self._locked():
            try:
                self.blobs.remove("claims")  # of those that shared it
            except OSError:  # NFS keeps files that are open
                for name in self.blobs.names("claims/*"):
                    with suppress(OSError):
                        self.blobs.remove(name)
            patterns = ("*/**/*.part", "catalogue*.part") if tidy else ()  # not those of keys
            for part in filter(_left, chain.from_iterable(map(self.directory.glob, patterns))):
                part.unlink(missing_ok=True)
            self.reconcile()
            yield

    @contextmanager
    def sharing(self) -> Iterator[None]:
        """Lock the directory against those who are its only writer, together with others.

        Raise `StoreBusy` if a process that does not share has the lock.
        """
        with self._locked(shared=True):
            yield

    @contextmanager
    def _locked(self, shared: bool = False) -> Iterator[None]:
        with ExitStack() as held:
            with self._writable():
                for name in ("runs", "studies"):
                    (self.directory / name).mkdir(parents=True, exist_ok=True)
                    with tempfile.TemporaryFile(dir=self.directory / name):
                        pass  # a directory may exist and still not be writable
                busy = "computes here; wait until it has ended, or name another directory"
                held.enter_context(self.blobs.lock(busy, shared))
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


def _left(part: Path) -> bool:
    """Whether an unfinished file is abandoned; a report is written without the lock."""
    try:
        return part.parent.name == "runs" or time.time() - part.stat().st_mtime > _UNFINISHED
    except FileNotFoundError:
        return False


def _run(run_id: str) -> str:
    return f"runs/{_checked(run_id)}.nc"


def _study(study_id: str, file: str = "") -> str:
    return f"studies/{_checked(study_id)}/{file}".rstrip("/")


def _checked(content_id: str) -> str:
    if not is_id(content_id):
        raise ValueError(f"{content_id!r} is not a content id")
    return content_id
