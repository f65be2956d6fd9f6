"""Compute a study: missing runs are computed, stored and combined."""

from __future__ import annotations

import math
import os
import shutil
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from itertools import chain, islice
from pathlib import Path
from typing import Any

from solver.late import Late
from solver.memory import most_kept
from solver.scenes import Scene
from studies.definition.cases import LoadingPath
from studies.definition.identity import solver_hash
from studies.definition.study import Study
from studies.definition.vocabulary import KEEP, OK, SOLVED
from studies.errors import StoreFull, StudyError, Unusable
from studies.execution.access import Access
from studies.execution.asking import Asking
from studies.execution.bundles import Bundle, bundles
from studies.execution.estimate import memory_needed
from studies.execution.executor import Event, Executor, Finished, Here, Limits, Message, Waiting
from studies.execution.forks import SHARED
from studies.execution.result import answered, result
from studies.execution.script import check_script
from studies.execution.task import PathTask, Proof, proof_of, walk
from studies.storage.store import Store

own_workers = Late("studies.execution.workers:own_workers")
connect = Late("studies.execution.workers:connect")
grid_of = Late("studies.execution.grid:Grid")
"""What uses dask, which takes a second to import."""

DEFAULT = Limits()
"""The limits of a study that sets none."""


_ROOM = 10_000_000
"""Bytes that must be free to begin a study: enough for a few runs."""

_BATCH = 500
"""Number of runs whose rows are in memory at a time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyEvent:
    """An event during the execution of a study.

    Attributes
    ----------
    kind : ``"path"`` (progress of a loading path), ``"run"`` (a run has its status) or
        ``"waiting"`` (no worker accepts tasks; `message` is the reason, and empty when work goes
        on)
    progress : fraction of the whole study that is done, 0 to 1
    path : id of the path; empty while waiting
    fraction : fraction of this path that is done, 0 to 1
    run, status, message : id, status and message of the run, or the reason of waiting
    place : of a study that chooses its runs, where the run is and the round of what asked for it
    stage : of a study that chooses its runs, how far it is
    """

    kind: str
    progress: float
    path: str = ""
    fraction: float = 0.0
    run: str = ""
    status: str = ""
    message: str = ""
    place: str = ""
    stage: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyOutcome:
    """The result of the execution of a study.

    Attributes
    ----------
    study_id : content id of the study
    counts : number of runs by status in the data set, with ``missing``
    failed : (run id, status, message) of every run that is neither ``ok`` nor ``missing``
    computed : ids of the runs computed this time
    asked, stage : of a study that chooses its runs, ids of those that it has asked for, and how
        far it is
    dataset : the combined data set
    anew : whether the data set was written; it is kept if it was made of the same runs
    wall_seconds : duration
    stopped : whether it was stopped before all was computed
    """

    study_id: str
    counts: Mapping[str, int]
    failed: Sequence[tuple[str, str, str]]
    computed: Sequence[str]
    asked: Sequence[str]
    stage: str
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
    alone: float = 0.0,
    scheduler: Access | str | None = None,
    executor: Executor | None = None,
    resume: bool = False,
    since: int = 0,
    limits: Limits = DEFAULT,
    priority: int = 0,
    on_event: Callable[[StudyEvent], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> StudyOutcome:
    """Compute the runs of `study` that `store` lacks, and combine all into one data set.

    Parameters
    ----------
    study : a study, or the content of a study file
    store : the store of runs, shared by all studies
    scene : for the content of a study file, the user's own scene in place of a scene's name
    workers : number of worker processes on this machine; by default one per core, or fewer if they
        need more memory than the machine has. 0 computes in this process, which no limit ends
    alone : processor time [s] of this process after which workers are started; until then it
        computes itself. They begin with the next loading path
    scheduler : a running dask scheduler to use instead; its workers must see the store under the
        same path
    executor : computes in another way than this process or workers of dask
    resume : compute only runs without a stored status; by default failed runs are computed again
        too
    since : with `resume`, failed runs stored before this time are computed again [ns since 1970]
    limits : limits on time and memory
    priority : among studies that share a scheduler, the one with the higher number goes first
    on_event : called, in this thread, with every event
    should_stop : called several times a second, in this process at each increment; if it returns
        true the work stops, and finished runs stay

    Raises
    ------
    StoreBusy
        when another process computes into the same store
    ModelError
        if the environment variable `RESIDUA_KEPT_MEMORY` is not a size
    StudyError
        if the store cannot be written to, the certificates cannot be used, `limits` are those of
        workers and there are none, or a script calls this outside of ``if __name__ ==
        "__main__":``, so that its workers would call it too
    StoreFull
        if the disk is full; with free space, the same call computes the rest
    FileDiffers
        if the file of a run differs from its results, and that of a failed run cannot be written
    GridLost
        if the scheduler is gone, or no worker accepted the work for too long; the same call
        computes the rest
    """
    started = time.monotonic()
    most_kept()
    if not isinstance(study, Study):
        study = Study.from_dict(study, scene)
    stop_requested = False

    def stop() -> bool:
        nonlocal stop_requested
        stop_requested = stop_requested or (should_stop is not None and should_stop())
        return stop_requested

    access = Access(scheduler) if isinstance(scheduler, str) else scheduler
    alone = 0.0 if access else math.inf if workers == 0 else alone
    if alone:
        limits.check_without_workers()
    if access and not store.directory.exists():
        _answering(access, limits.patience)
    with store.writing():
        store.save_study(study)
        asking = Asking(study, store, resume, since) if study.kind.chooses else None
        wanted: set[str] = set()
        ids = study.run_ids()
        while some := list(islice(ids, _BATCH)):
            wanted.update(some)
            for run_id, row in store.sound(some).items():
                solved = row["status"] in SOLVED
                kept = study.keep in ("", row[KEEP])
                if (solved and kept) or (not solved and resume and row["modified"] >= since):
                    wanted.discard(run_id)
        emit = on_event or (lambda event: None)
        work = _Work(study, store, wanted, limits, priority, emit, asking)
        if wanted or (asking and not asking.ended):
            if shutil.disk_usage(store.directory).free < _ROOM:
                raise StoreFull(str(store.blobs.address))  # before any path is computed in vain
            here = Here(alone)
            if executor or alone:
                work.compute_by(executor or here, stop)
            if not executor and (not alone or (here.over and work.lacks and not stop())):
                work.compute(workers, access, stop)
        if asking:
            stopped, anew = work.lacks, bool(work.computed)
            combined = answered(study, store, asking, anew)
        else:
            stopped = stop_requested and work.lacks
            combined = result(study, store, complete=not wanted, stopped=stopped)
    return StudyOutcome(
        study_id=study.id,
        counts=combined.counts,
        failed=combined.failed,
        computed=sorted(work.computed),
        asked=asking.asked if asking else (),
        stage=asking.stage if asking else "",
        dataset=combined.path,
        anew=combined.anew,
        wall_seconds=time.monotonic() - started,
        stopped=stopped,
    )


def _answering(access: Access, patience: float | None) -> None:
    """Raise `GridLost` if a scheduler does not answer, before a directory is made."""
    with connect(access, patience):
        pass


@dataclass(slots=True)
class _Work:
    """The runs to compute, and their progress."""

    study: Study
    store: Store
    wanted: set[str]
    limits: Limits
    priority: int
    emit: Callable[[StudyEvent], None]
    asking: Asking | None = None
    begun: int = field(default_factory=time.time_ns)
    computed: set[str] = field(default_factory=set)
    _left: deque[PathTask] = field(default_factory=deque)
    _walked: int = 0
    _walking: dict[str, tuple[int, float]] = field(default_factory=dict)

    def compute_by(self, executor: Executor, stop: Callable[[], bool]) -> None:
        """Run a task for each bundle of paths that lack runs."""
        self._run(executor, self._tasks(None, lambda: executor.workers), stop)

    def compute(self, wanted: int | None, access: Access | None, stop: Callable[[], bool]) -> None:
        """Run the tasks on workers of dask, which prove that they see the directory."""
        workers = wanted or os.cpu_count() or 1
        grid: Any = None
        with ExitStack() as opening:
            proof = opening.enter_context(proof_of(self.store, self.study.id))
            tasks = self._tasks(proof, lambda: grid.workers if grid else workers)
            if access is None:
                check_script()
                SHARED.prepare()  # loads while dask is imported
                first = list(islice(tasks, workers))
                count = sum(task is not None for task in first)
                need = 0 if wanted or count < 2 else memory_needed(self.study)
                own = own_workers(count, self.limits.memory, need)
                access = opening.enter_context(own)
                tasks = chain(first, tasks)
            grid = opening.enter_context(grid_of(access, self.limits.patience))
            self._run(grid, self._with_left(tasks), stop)

    def _run(
        self, executor: Executor, tasks: Iterator[PathTask | None], stop: Callable[[], bool]
    ) -> None:
        unwritable: list[StoreFull | StudyError] = []

        def hear(event: Event) -> None:
            match event:
                case Waiting(reason):
                    self._tell("waiting", message=reason)
                case Message(content):
                    self._hear(content)
                case Finished(_, StoreFull() | StudyError() as error):
                    unwritable.append(error)
                case Finished(task, error, path):
                    self._close(task, error, path)

        def leave() -> bool:
            return bool(unwritable) or stop()

        executor.run(walk, tasks, hear, leave, self.limits, self.priority)
        for error in unwritable:
            raise self._of_directory(error)

    @property
    def lacks(self) -> bool:
        """Whether runs are left to compute."""
        return not self.asking.ended if self.asking else bool(self.wanted - self.computed)

    def _of_directory(self, error: StoreFull | StudyError) -> StoreFull | StudyError:
        """Return an error with the directory as the user gave it, not with the path of a task."""
        directory = str(self.store.blobs.address)
        if isinstance(error, StoreFull):
            return StoreFull(directory)
        return Unusable("directory", directory, error.allowed)

    def _tasks(self, proof: Proof | None, workers: Callable[[], int]) -> Iterator[PathTask | None]:
        if self.asking is None:
            lacking = (path for path in map(self._rest, self.study.paths()) if path.cases)
            for paths in bundles(self.study.problem, lacking, workers):
                yield self._task(proof, paths)
            return
        for asked in self.asking.paths():
            yield asked and replace(
                self._task(proof, (asked.path,)), limit=asked.limit, place=asked.place
            )

    def _task(self, proof: Proof | None, paths: Bundle) -> PathTask:
        scene, directory = self.study.problem, self.store.address
        self._walking.update({path.id: (len(path.cases), 0.0) for path in paths})
        task = PathTask(scene, paths, directory, solver_hash(), self.study.keep, proof)
        return replace(task, stale=self.store.modified(case.id for case in task.cases))

    def _with_left(self, tasks: Iterator[PathTask | None]) -> Iterator[PathTask | None]:
        """Yield tasks, first those that failed ones left; None if there is none for now."""
        while True:
            yield self._left.popleft() if self._left else next(tasks, None)

    def _rest(self, path: LoadingPath) -> LoadingPath:
        lacking = (case for case in path.cases if case.id in self.wanted)
        cases = tuple(case for case in lacking if case.id not in self.computed)
        return LoadingPath(path.id, path.parameters, cases)

    def _hear(self, content: Mapping[str, Any]) -> None:
        path = content["path"]
        if "row" in content:
            self._keep(path, [content["row"]])
            return
        cases, before = self._walking.get(path, (0, 1.0))  # default: a late message of a done path
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
            place = self.asking.heard(path, row) if self.asking else ""
            self._tell(
                "run", path=path, run=row["id"], status=self.study.taken(row["status"]),
                message=row["message"], place=place,
            )  # fmt: skip

    def _tell(self, kind: str, **content: Any) -> None:
        stage = self.asking.stage if self.asking else ""
        self.emit(StudyEvent(kind=kind, progress=self._progress(), stage=stage, **content))

    def _close(self, task: PathTask, error: Exception | None, at_fault: str = "") -> None:
        """Record the runs of a task without a report.

        If it failed, this is the fault of its first path that is not complete: its other runs are
        recorded as ``error``, and the paths behind it make a new task. If another path is at fault,
        that one was completed meanwhile, and no run is recorded as ``error``.
        """
        stored = task.stored(self.store, known=self.computed)
        for number, path in enumerate(task.paths):
            lacking = [case for case in path.cases if case.id not in self.computed]
            self._keep(path.id, [stored[case.id] for case in lacking if case.id in stored])
            failed = [case for case in lacking if case.id not in stored]
            if failed and error is not None:
                blamed = at_fault in ("", path.id)
                if blamed:
                    self._walked += self._walking.pop(path.id)[0]
                    self._keep(path.id, [self.store.write_run(case, str(error)) for case in failed])
                if rest := task.paths[number + blamed :]:
                    self._left.append(replace(task, paths=rest))
                return
            self._walked += self._walking.pop(path.id)[0]
            if self.asking:
                owed = self.asking.owed(path.id) if error else None
                if owed is not None:
                    self._keep(path.id, [self.store.write_run(owed, str(error))])
                self.asking.closed(path.id)
                self._keep(path.id, self.asking.stored(path.id, self.begun))

    def _progress(self) -> float:
        """Return the completed fraction of the study, including runs found in the store."""
        if self.asking:
            return self.asking.progress
        total = self.study.size
        walked = sum(cases * fraction for cases, fraction in self._walking.values())
        done = max(self._walked + walked, len(self.computed))
        return (total - len(self.wanted) + done) / total
