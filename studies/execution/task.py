"""The task of a worker: compute loading paths, and write each run as soon as it is done."""

from __future__ import annotations

import contextlib
import time
import uuid
from collections import deque
from collections.abc import Callable, Container, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from solver.memory import release
from solver.results.record import Record
from solver.scenes import Scene
from studies.definition.cases import Case, LoadingPath
from studies.definition.identity import loaded, solver_hash
from studies.definition.place import Limit, Place
from studies.definition.study import Study
from studies.errors import StoreFull, StudyError, Unusable, without_folders
from studies.storage.ran import now
from studies.storage.store import Store

NO_RECORD = "the scene ended its loading path without a record of this run"


_WORTH, _SILENCE = 0.01, 1.0
"""Progress of a path after which a message is sent, and seconds after which one is sent in any
case. A message costs as much as a short increment."""

REFUSAL_SECONDS = 1.0
"""Time that a worker waits before it refuses a task; meanwhile other workers get the paths."""


@dataclass(frozen=True, slots=True)
class PathTask:
    """Loading paths to compute one after the other, and the directory of their runs.

    Attributes
    ----------
    scene, paths : the scene and its loading paths, or the rest of them
    directory : directory of the store, or its address
    source : `solver_hash` of the process that started the study; a worker with another one refuses
        the task, and the study waits for another worker
    keep : what is kept in addition to the results of the scene
    proof : proof that the worker sees the directory; None if this is certain
    stale : by id, the time of change [ns] of files that the study replaces; a file with another
        time was written by a worker that died on this task, and is kept
    limit : tells the run behind which no other of its path is needed; None if all are
    place : of a path that goes on, the place whose program asks for its runs: the path has no cases
    code : digests of the scene's modules that the process which made this task has loaded; a worker
        with others refuses it too
    """

    scene: Scene
    paths: tuple[LoadingPath, ...]
    directory: Path | str
    source: str
    keep: str = ""
    proof: Proof | None = None
    stale: Mapping[str, int] = field(default_factory=dict)
    limit: Limit | None = None
    place: Place[Any] | None = None
    code: Mapping[str, str] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "code", loaded(self.scene))

    def __dask_tokenize__(self) -> tuple[Any, ...]:
        """Return an identity of this task, so that dask need not hash its content."""
        paths = [path.id for path in self.paths]
        return type(self).__name__, self.source, paths, [case.id for case in self.cases]

    @property
    def cases(self) -> list[Case]:
        """The cases of all paths."""
        return [case for path in self.paths for case in path.cases]

    def stored(self, store: Store, known: Container[str] = ()) -> dict[str, dict[str, Any]]:
        """Return, by id, the rows of the runs that this task has stored, without those known."""
        times = store.modified(case.id for case in self.cases if case.id not in known)
        fresh = [run_id for run_id, at in times.items() if at != self.stale.get(run_id)]
        return {run_id: row for run_id in fresh if (row := store.found(run_id))}


class StopAsked(Exception):
    """Raised inside a loading path to end it, because the study was stopped."""


def walk(
    task: PathTask, report: Callable[[dict[str, Any]], None], should_stop: Callable[[], bool]
) -> None:
    """Compute the runs of loading paths, and report their catalogue rows.

    A run whose file exists is not computed again, so that the next worker continues after one that
    died. If the scene raises an error, the runs without a record are written with the status
    ``error`` and the error as their message. A record that cannot be written, or whose file would
    differ, gives only its own run this status. The next path follows when all runs of a path are
    stored: of a task that ends early, the first path that lacks one was being computed. Between two
    paths the process keeps no more than `solver.memory.most_kept`.

    Raises
    ------
    StoreFull, StudyError
        if the store cannot be written to, which is not the fault of a run
    FileDiffers
        if even the file of a run with the status ``error`` differs
    """
    if task.proof is not None:
        task.proof.check(should_stop)
    if task.source != solver_hash():
        time.sleep(REFUSAL_SECONDS)
        raise Unfit(
            "has another version of the solver than the process that started the study; install "
            "the same one for both and restart the worker"
        )
    own = loaded(task.scene)
    if other := [name for name, found in own.items() if found != task.code.get(name, found)]:
        time.sleep(REFUSAL_SECONDS)
        raise Unfit(
            f"has another version of {other[0]} than the process that started the study; start "
            "both again, with the same file"
        )
    store = Store(task.directory)
    stored = task.stored(store)
    with contextlib.suppress(StopAsked):
        for path in task.paths:
            try:
                _walk(task, path, store, stored, report, should_stop)
            finally:
                release()


def compute_here(study: Study, store: Store) -> None:
    """Compute the runs of a small study in this process; nothing but the runs is stored.

    Raises
    ------
    StoreBusy
        when another process computes into the same store
    """
    with store.writing():
        for path in study.paths():
            task = PathTask(study.problem, (path,), store.address, solver_hash(), study.keep)
            walk(task, lambda _: None, lambda: False)
        store.sound(study.run_ids())


def _walk(
    task: PathTask,
    path: LoadingPath,
    store: Store,
    stored: Mapping[str, dict[str, Any]],
    report: Callable[[dict[str, Any]], None],
    should_stop: Callable[[], bool],
) -> None:
    """Compute those runs of a loading path that are not stored; see `walk`."""
    follows = {} if task.place is None else {"follows": True}  # its path goes on

    def keep(row: dict[str, Any]) -> None:
        with contextlib.suppress(Exception):  # the file has the row too
            report({"path": path.id, "row": row, **follows})

    reported, since = -1.0, 0.0

    def monitor(fraction: float) -> None:
        nonlocal reported, since
        now = time.monotonic()
        try:
            if fraction >= min(reported + _WORTH, 1.0) or now >= since + _SILENCE:
                report({"path": path.id, "fraction": float(fraction)})
                reported, since = fraction, now
            stop = should_stop()
        except Exception as error:  # the worker is closing, which is not the fault of a run
            raise StopAsked from error
        if stop:
            raise StopAsked

    if task.place is not None:
        _follow(task, path, task.place, store, keep, monitor)
        return
    for case in path.cases:
        if case.id in stored:
            keep(stored[case.id])
    branch = task.scene.branch  # of a scene without one there is a single run
    cases = (case for case in path.cases if case.id not in stored)
    owed: dict[Any, Case] = {case.values.get(branch): case for case in cases}
    rows, behind = dict(stored), deque(path.cases)

    def ended() -> bool:
        """Tell the limit of the next runs that are known, in order; return whether one is last."""
        while task.limit is not None and behind and behind[0].id in rows:
            if task.limit(rows[behind.popleft().id]):
                return True
        return False

    if ended():
        return
    reason, began = NO_RECORD, now()
    try:
        if owed:
            monitor(0.0)
            known = store.begun(next(iter(owed.values())))
            begun = known[1:] if known else ()  # a scene of its own kind need not know it
            for record in task.scene.path(path.parameters, list(owed), monitor, *begun):
                value = getattr(record.parameters, branch, None)
                row = _written(store, task, owed[value], record, began)
                began = now()
                del owed[value]
                keep(row)
                rows[row["id"]] = row
                if ended():
                    return
    except (StopAsked, StoreFull, StudyError):
        raise
    except Exception as error:
        reason = _reason(error)
    for case in owed.values():
        keep(store.write_run(case, reason, began=began))


def _follow(
    task: PathTask,
    path: LoadingPath,
    place: Place[Any],
    store: Store,
    keep: Callable[[dict[str, Any]], None],
    monitor: Callable[[float], None],
) -> None:
    """Compute the runs that a program asks for, one after the other, on one path; see `walk`."""
    program, owed, began = place.program, deque[Case](), now()

    def known(row: dict[str, Any]) -> None:
        place.hear(row)
        keep(row)

    def lacking() -> Case | None:
        while wanted := program.wants:
            (case,) = place.runs(wanted[:1]).cases()
            row = store.found(case.id)
            if row is not None and place.stands(row):
                known(row)
            elif refusal := place.refusal(wanted[0]):
                program.refuse(wanted[0], refusal)  # the study's own one finds the same
            else:
                return case
        return None

    def values() -> Iterator[float]:
        while case := lacking():
            monitor(0.0)
            owed.append(case)
            yield program.wants[0]

    reason = NO_RECORD
    try:
        for record in task.scene.follow(path.parameters, values(), program.largest, monitor):
            known(_written(store, task, owed.popleft(), record, began))
            began = now()
    except (StopAsked, StoreFull, StudyError):
        raise
    except Exception as error:
        reason = _reason(error)
    # a scene may fail before it asks for a value
    if case := owed.popleft() if owed else lacking():
        known(store.write_run(case, reason, began=began))


def _written(
    store: Store, task: PathTask, case: Case, record: Record, began: str
) -> dict[str, Any]:
    """Write the run of a record, with the status ``error`` if the record cannot be written."""
    try:
        return store.write_run(case, record, task.keep, began)
    except (StoreFull, StudyError):
        raise
    except Exception as error:
        return store.write_run(case, _reason(error), began=began)


def _reason(error: Exception) -> str:
    return without_folders(f"{type(error).__name__}: {error}")


_PATIENCE = 2.0
"""Seconds that a worker looks for the token. Meanwhile other workers get the paths."""
_POLL = 0.2
"""Seconds between two checks."""


class Unfit(Exception):
    """A worker cannot do the task; another one can, or the same one later."""


@dataclass(frozen=True, slots=True)
class Proof:
    """A token that only a worker with access to the directory can read.

    Attributes
    ----------
    store : the directory of the store, or its address
    study : id of the study
    token : name of the file of the token, new each time the study is computed
    directory : directory of the store, as the user gave it
    """

    store: Path | str
    study: str
    token: str
    directory: str

    def check(self, should_stop: Callable[[], bool]) -> None:
        """Look for the token, for a short while.

        Raises
        ------
        Unfit
            if it is not found
        """
        deadline = time.monotonic() + _PATIENCE
        while not self._seen():
            if should_stop() or time.monotonic() > deadline:
                raise Unfit(
                    f"does not see the directory {self.directory}; mount it there under the same "
                    "path"
                )
            time.sleep(_POLL)

    def _seen(self) -> bool:
        try:
            return Store(self.store).study_path(self.study, self.token).is_file()
        except (OSError, Unusable):
            return False


@contextmanager
def proof_of(store: Store, study_id: str) -> Iterator[Proof]:
    """Keep a token in the directory of a study while its paths are computed."""
    token = f"token-{uuid.uuid4().hex}"
    with store.appearing(study_id, token) as part:
        part.touch()
    try:
        yield Proof(store.address, study_id, token, str(store.blobs.address))
    finally:
        store.discard_study(study_id, "token-*")  # with those of processes that were killed
