"""A study carried out: what is missing is computed, stored and combined."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from itertools import chain, islice
from pathlib import Path
from typing import Any

from solver.scenes import Scene
from studies.definition.cases import LoadingPath
from studies.definition.identity import solver_hash
from studies.definition.study import Study
from studies.definition.vocabulary import KEEP, OK, SOLVED
from studies.errors import StoreFull, StudyError, Unusable
from studies.execution.cluster import Access, connect, own_workers
from studies.execution.limits import Limits
from studies.execution.proof import Proof, proof_of
from studies.execution.result import result
from studies.execution.task import PathTask, walk
from studies.execution.watch import Waiting
from studies.storage.store import Store

DEFAULT = Limits()
"""The limits of a study that sets none."""


_ROOM = 10_000_000
"""Bytes that must be free for a study to begin: a few runs of the scenes."""

_BATCH = 500
"""Runs whose rows are held at a time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyEvent:
    """Something that happened in a study.

    Attributes
    ----------
    kind : ``"path"`` (a loading path has advanced), ``"run"`` (a run has its outcome) or
        ``"waiting"`` (no worker takes the work; `message` says why, and is empty when it goes on)
    progress : fraction of the whole study that is done, 0 to 1
    path : id of the path; empty while waiting
    fraction : fraction of this path that is done, 0 to 1
    run, status, message : id and outcome of the run, or what the study waits for
    """

    kind: str
    progress: float
    path: str = ""
    fraction: float = 0.0
    run: str = ""
    status: str = ""
    message: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyOutcome:
    """What came of a study.

    Attributes
    ----------
    study_id : content id of the study
    counts : number of runs by status, ``missing`` included, as the data set holds them
    failed : (run id, status, message) of every run that is neither ``ok`` nor ``missing``
    computed : ids of the runs computed this time
    dataset : the combined data set
    anew : whether the data set was written anew; it is kept where it was made of the same runs
    wall_seconds : duration
    stopped : whether it was stopped before all was computed
    """

    study_id: str
    counts: Mapping[str, int]
    failed: Sequence[tuple[str, str, str]]
    computed: Sequence[str]
    dataset: Path
    anew: bool
    wall_seconds: float
    stopped: bool

    @property
    def ok(self) -> bool:
        """Whether every run of the study succeeded."""
        return set(self.counts) <= {OK}


def run_study(
    study: Study | Mapping[str, Any],
    store: Store,
    *,
    scene: Scene | None = None,
    workers: int | None = None,
    scheduler: Access | str | None = None,
    resume: bool = False,
    since: int = 0,
    limits: Limits = DEFAULT,
    priority: int = 0,
    on_event: Callable[[StudyEvent], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> StudyOutcome:
    """Compute what `store` lacks of `study`, and combine its runs into one data set.

    Parameters
    ----------
    study : what to compute: a study, or the content of a study file
    store : where runs are kept, whichever study they were computed for
    scene : with such content, a scene of one's own in place of the name of one
    workers : worker processes on this machine; by default one a core
    scheduler : a running dask scheduler, to be used instead; its workers must see the store
        under the same path
    resume : compute only the runs that have no outcome; by default failed runs are computed again
        too
    since : with `resume`, failed runs stored before this time are computed again [ns since 1970]
    limits : on time and memory
    priority : of studies that share a scheduler, the one with the higher number goes first
    on_event : called, in this thread, with everything that happens
    should_stop : called several times a second; once it is true the work stops, and finished
        runs stay

    Raises
    ------
    StoreBusy
        when another process computes into the same store
    StudyError
        when the store cannot be written to, the certificates cannot be used, or a script calls this
        where its workers would call it too
    StoreFull
        when the disk is full; with room, the same call computes the rest
    FileDiffers
        when no file says what was computed, not even that of a run that failed
    GridLost
        when the scheduler is gone, or no worker took the work for too long; the same call
        computes the rest
    """
    started = time.monotonic()
    if not isinstance(study, Study):
        study = Study.from_dict(study, scene)
    asked = False

    def stop() -> bool:
        nonlocal asked
        asked = asked or (should_stop is not None and should_stop())
        return asked

    access = Access(scheduler) if isinstance(scheduler, str) else scheduler
    if access and not store.directory.exists():
        _answering(access)
    with store.writing():
        store.save_study(study)
        wanted: set[str] = set()
        ids = study.run_ids()
        while some := list(islice(ids, _BATCH)):
            wanted.update(some)
            for run_id, row in store.sound(some).items():
                solved = row["status"] in SOLVED
                kept = study.keep in ("", row[KEEP])
                if (solved and kept) or (not solved and resume and row["modified"] >= since):
                    wanted.discard(run_id)
        work = _Work(study, store, wanted, limits, priority, on_event or (lambda event: None))
        if wanted:
            if shutil.disk_usage(store.directory).free < _ROOM:
                raise StoreFull(str(store.directory))  # no path is walked in vain
            work.compute(workers or os.cpu_count() or 1, access, stop)
        stopped = asked and bool(wanted - work.computed)
        combined = result(study, store, complete=not wanted, stopped=stopped)
    return StudyOutcome(
        study_id=study.id,
        counts=combined.counts,
        failed=combined.failed,
        computed=sorted(work.computed),
        dataset=combined.path,
        anew=combined.anew,
        wall_seconds=time.monotonic() - started,
        stopped=stopped,
    )


def _answering(access: Access) -> None:
    """Refuse a scheduler that does not answer, before a directory is made for its results."""
    with connect(access):
        pass


@dataclass(slots=True)
class _Work:
    """The runs still to compute, and how far they are."""

    study: Study
    store: Store
    wanted: set[str]
    limits: Limits
    priority: int
    emit: Callable[[StudyEvent], None]
    computed: set[str] = field(default_factory=set)
    _walked: int = 0
    _walking: dict[str, tuple[int, float]] = field(default_factory=dict)

    def compute(self, workers: int, access: Access | None, stop: Callable[[], bool]) -> None:
        """Run one task for each path that lacks runs."""
        from studies.execution.grid import Finished, Grid, Message  # dask takes a second to import

        unwritable: list[StoreFull | StudyError] = []
        with ExitStack() as opening:
            tasks = self._tasks(opening.enter_context(proof_of(self.store, self.study.id)))
            if access is None:
                first = list(islice(tasks, workers))
                access = opening.enter_context(own_workers(len(first), self.limits.memory))
                tasks = chain(first, tasks)
            grid = opening.enter_context(Grid(access))

            def leave() -> bool:
                return bool(unwritable) or stop()

            items = grid.run(walk, tasks, leave, self.limits, self.priority)
            for item in opening.enter_context(closing(items)):
                match item:
                    case Waiting(reason):
                        self._tell("waiting", message=reason)
                    case Message(content):
                        self._hear(content)
                    case Finished(_, StoreFull() | StudyError() as error):
                        unwritable.append(error)
                    case Finished(task, error):
                        self._close(task, error)
        for error in unwritable:  # by the name the user gave, not the worker's
            directory = str(self.store.directory)
            if isinstance(error, StoreFull):
                raise StoreFull(directory)
            raise Unusable("directory", directory, error.allowed)

    def _tasks(self, proof: Proof) -> Iterator[PathTask]:
        scene, directory = self.study.problem, self.store.directory.resolve()
        for path in map(self._rest, self.study.paths()):
            if path.cases:
                self._walking[path.id] = (len(path.cases), 0.0)
                stale = self.store.modified(case.id for case in path.cases)
                yield PathTask(scene, path, directory, solver_hash(), self.study.keep, proof, stale)

    def _rest(self, path: LoadingPath) -> LoadingPath:
        cases = tuple(case for case in path.cases if case.id in self.wanted)
        return LoadingPath(path.id, path.parameters, cases)

    def _hear(self, content: Mapping[str, Any]) -> None:
        path = content["path"]
        if "row" in content:
            self._keep(path, [content["row"]])
            return
        cases, before = self._walking.get(path, (0, 1.0))  # a late word of a path that is done
        fraction = max(before, content["fraction"])
        if cases:
            self._walking[path] = (cases, fraction)
        self._tell("path", path=path, fraction=fraction)

    def _keep(self, path: str, rows: Sequence[Mapping[str, Any]]) -> None:
        fresh = [row for row in rows if row["id"] not in self.computed]
        if fresh:
            self.store.catalogue.put(fresh)
        for row in fresh:
            self.computed.add(row["id"])
            self._tell(
                "run", path=path, run=row["id"], status=self.study.taken(row["status"]),
                message=row["message"],
            )  # fmt: skip

    def _tell(self, kind: str, **content: Any) -> None:
        self.emit(StudyEvent(kind=kind, progress=self._progress(), **content))

    def _close(self, task: PathTask, error: Exception | None) -> None:
        """Record the runs of a path that were not heard of; as broken when it did not end well."""
        self._walked += self._walking.pop(task.path.id)[0]
        stored = task.stored(self.store)
        for case in task.path.cases:
            if case.id in self.computed:
                continue
            if case.id in stored:
                self._keep(task.path.id, [stored[case.id]])
            elif error is not None:
                self._keep(task.path.id, [self.store.write_run(case, str(error))])

    def _progress(self) -> float:
        """Return the fraction of the study that is done, runs found finished included."""
        total = self.study.size
        walked = sum(cases * fraction for cases, fraction in self._walking.values())
        done = max(self._walked + walked, len(self.computed))
        return (total - len(self.wanted) + done) / total
