"""A study carried out: what is missing is computed, stored and combined."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from solver.scenes import SCENES, Scene
from studies.definition.cases import LoadingPath
from studies.definition.identity import solver_hash
from studies.definition.study import Study
from studies.definition.vocabulary import OK
from studies.errors import StoreFull, StudyError
from studies.execution.task import PathTask, walk
from studies.storage import dataset as layout
from studies.storage.combine import combine
from studies.storage.store import Store


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyEvent:
    """Something that happened in a study.

    Attributes
    ----------
    kind : ``"path"`` (a loading path has advanced) or ``"run"`` (a run has its outcome)
    progress : fraction of the whole study that is done, 0 to 1
    path : id of the path
    fraction : fraction of this path that is done, 0 to 1
    run, status, message : id and outcome of the run
    """

    kind: str
    progress: float
    path: str
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
    wall_seconds : duration
    stopped : whether it was asked to stop before all was computed
    """

    study_id: str
    counts: Mapping[str, int]
    failed: Sequence[tuple[str, str, str]]
    computed: Sequence[str]
    dataset: Path
    wall_seconds: float
    stopped: bool

    @property
    def ok(self) -> bool:
        """Whether every run of the study succeeded."""
        return set(self.counts) <= {OK}


def run_study(
    study: Study,
    store: Store,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
    on_event: Callable[[StudyEvent], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> StudyOutcome:
    """Compute what `store` lacks of `study`, and combine its runs into one data set.

    Parameters
    ----------
    study : what to compute
    store : where runs are kept, whichever study asked for them first
    workers : worker processes on this machine; by default one a core
    scheduler : address of a running dask scheduler, to be used instead; its workers must see
        the store under the same path
    resume : compute only the runs that have no outcome; by default failed runs are computed again
        too
    on_event : called, in this thread, with everything that happens
    should_stop : asked several times a second; once it is true the work stops, and finished
        runs stay

    Raises
    ------
    StoreBusy
        when another process computes into the same store
    StudyError
        when the store cannot be written to
    StoreFull
        when the disk is full; with room, the same call computes the rest
    GridLost
        when the scheduler is gone; the same call computes the rest
    """
    started = time.monotonic()
    asked = False

    def stop() -> bool:
        nonlocal asked
        asked = asked or (should_stop is not None and should_stop())
        return asked

    if scheduler and not store.directory.exists():
        _answering(scheduler)
    with store.writing():
        store.save_study(study)
        cases = list(study.cases())
        known = store.sound(case.id for case in cases)
        done = {key for key, row in known.items() if resume or row["status"] == OK}
        wanted = {case.id for case in cases} - done
        work = _Work(study, store, wanted, on_event or (lambda event: None))
        if wanted:
            work.compute(workers or os.cpu_count() or 1, scheduler, stop)
        combined = combine(study, store, cases)
        store.catalogue.remove(combined.missing)
    return StudyOutcome(
        study_id=study.id,
        counts=combined.counts,
        failed=combined.failed,
        computed=sorted(work.computed),
        dataset=combined.path,
        wall_seconds=time.monotonic() - started,
        stopped=asked and bool(wanted - work.computed),
    )


def _answering(scheduler: str) -> None:
    """Refuse a scheduler that does not answer, before a directory is made for its results."""
    from studies.execution.grid import Grid  # dask takes a second to import

    with Grid(0, scheduler):
        pass


@dataclass(slots=True)
class _Work:
    """The runs still to compute, and how far they are."""

    study: Study
    store: Store
    wanted: set[str]
    emit: Callable[[StudyEvent], None]
    computed: set[str] = field(default_factory=set)
    _fractions: dict[str, tuple[int, float]] = field(default_factory=dict)

    def compute(self, workers: int, scheduler: str | None, stop: Callable[[], bool]) -> None:
        """Run one task for each path that lacks runs."""
        from studies.execution.grid import Finished, Grid  # dask takes a second to import

        scene = SCENES[self.study.scene]
        tasks = [
            self._task(scene, path) for path in map(self._rest, self.study.paths()) if path.cases
        ]
        unwritable: list[StoreFull | StudyError] = []
        self._fractions = {task.path.id: (len(task.path.cases), 0.0) for task in tasks}
        with Grid(min(workers, len(tasks)), scheduler) as grid:
            for item in grid.run(walk, tasks, lambda: bool(unwritable) or stop()):
                if not isinstance(item, Finished):
                    self._hear(item.content)
                elif item.error is None:
                    self._keep(tasks[item.position].path.id, item.result)
                elif isinstance(item.error, StoreFull | StudyError):
                    unwritable.append(item.error)
                else:
                    self._give_up(tasks[item.position], item.error)
        for error in unwritable:  # by the name the user gave, not the worker's
            directory = str(self.store.directory)
            if isinstance(error, StoreFull):
                raise StoreFull(directory)
            raise StudyError("directory", directory, error.allowed)

    def _task(self, scene: Scene, path: LoadingPath) -> PathTask:
        stale = self.store.modified(case.id for case in path.cases)
        return PathTask(scene, path, self.store.directory.resolve(), solver_hash(), stale)

    def _rest(self, path: LoadingPath) -> LoadingPath:
        cases = tuple(case for case in path.cases if case.id in self.wanted)
        return LoadingPath(path.id, path.parameters, cases)

    def _hear(self, content: Mapping[str, Any]) -> None:
        path = content["path"]
        if "row" in content:
            self._keep(path, [content["row"]])
            return
        cases, before = self._fractions[path]
        fraction = max(before, content["fraction"])
        self._fractions[path] = (cases, fraction)
        self.emit(
            StudyEvent(
                kind="path", progress=self._progress(), path=path, fraction=fraction,
            )
        )  # fmt: skip

    def _keep(self, path: str, rows: Sequence[Mapping[str, Any]]) -> None:
        fresh = [row for row in rows if row["id"] not in self.computed]
        if fresh:
            self.store.catalogue.put(fresh)
        for row in fresh:
            self.computed.add(row["id"])
            self.emit(
                StudyEvent(
                    kind="run", progress=self._progress(), path=path, run=row["id"],
                    status=row["status"], message=row["message"],
                )
            )  # fmt: skip

    def _give_up(self, task: PathTask, error: Exception) -> None:
        """Record the runs of a path whose task did not survive."""
        left = [case for case in task.path.cases if case.id not in self.computed]
        broken = (layout.broken_dataset(task.scene, case, str(error)) for case in left)
        self._keep(task.path.id, [self.store.write_run(dataset) for dataset in broken])

    def _progress(self) -> float:
        """Return the fraction of the study that is done, runs found finished included."""
        total = self.study.size
        walked = sum(cases * fraction for cases, fraction in self._fractions.values())
        return (total - len(self.wanted) + max(walked, len(self.computed))) / total
