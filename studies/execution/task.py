"""What a worker does: walk one loading path, and write each run as soon as it is known."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from solver.results.record import Record
from solver.scenes import Scene
from studies.definition.cases import Case, LoadingPath
from studies.definition.identity import solver_hash
from studies.errors import StoreFull, StudyError
from studies.storage import dataset as layout
from studies.storage.store import Store

NO_RECORD = "the scene ended its loading path without a record of this run"


@dataclass(frozen=True, slots=True)
class PathTask:
    """A loading path to walk, or what is left of it, and where its runs are written.

    Attributes
    ----------
    scene, path : what to compute
    directory : of the store
    source : `solver_hash` of the process that started the study; a worker whose own differs
        refuses the task
    stale : by id, the time of change [ns] of the files that the study replaces; a file that has
        another one was written by a worker that died on this task, and is kept
    """

    scene: Scene
    path: LoadingPath
    directory: Path
    source: str
    stale: Mapping[str, int] = field(default_factory=dict)


class StopAsked(Exception):
    """Raised inside a loading path to leave it, because the study was asked to stop."""


def walk(
    task: PathTask, report: Callable[[dict[str, Any]], None], should_stop: Callable[[], bool]
) -> list[dict[str, Any]]:
    """Compute the runs of a loading path, and return their catalogue rows.

    A run whose file exists is not computed again: where a worker died, the next one continues.
    When the scene raises an error, the runs that have no record yet are written as broken, with
    the error as their message. A record that cannot be written breaks its own run only.

    Raises
    ------
    StoreFull, StudyError
        when nothing can be written to the store, which is no run's fault
    """
    if task.source != solver_hash():
        raise RuntimeError(
            "the worker has another version of the solver than the process that started the study: "
            "install the same one for both and restart the worker"
        )
    store = Store(task.directory)
    rows: list[dict[str, Any]] = []

    def keep(row: dict[str, Any]) -> None:
        rows.append(row)
        with contextlib.suppress(Exception):  # the rows returned tell it too
            report({"path": task.path.id, "row": row})

    def monitor(fraction: float) -> None:
        try:
            report({"path": task.path.id, "fraction": float(fraction)})
            stop = should_stop()
        except Exception as error:  # nobody listens: the worker is closing, which is no run's fault
            raise StopAsked from error
        if stop:
            raise StopAsked

    owed: dict[Any, Case] = {}
    written = store.modified(case.id for case in task.path.cases)
    for case in task.path.cases:
        fresh = written.get(case.id) != task.stale.get(case.id)
        row = store.found(case.id) if fresh else None
        if row:
            keep(row)
        else:
            owed[case.values[task.scene.branch]] = case
    reason = NO_RECORD
    try:
        if owed:
            monitor(0.0)
            for record in task.scene.path(task.path.parameters, list(owed), monitor):
                value = getattr(record.parameters, task.scene.branch)
                row = _written(store, task.scene, owed[value], record)
                del owed[value]
                keep(row)
    except StopAsked:
        return rows
    except (StoreFull, StudyError):
        raise
    except Exception as error:
        reason = _reason(error)
    for case in owed.values():
        keep(store.write_run(layout.broken_dataset(task.scene, case, reason)))
    return rows


def _written(store: Store, scene: Scene, case: Case, record: Record) -> dict[str, Any]:
    """Write the run a record tells of, as broken when the record cannot be written."""
    try:
        return store.write_run(layout.run_dataset(scene, case, record))
    except (StoreFull, StudyError):
        raise
    except Exception as error:
        return store.write_run(layout.broken_dataset(scene, case, _reason(error)))


def _reason(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"
