"""What computes the tasks of a study, within limits: `Executor`; `Here` is this process.

Workers of dask are in `studies.execution.grid`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Protocol

from solver.memory import bytes_in, release
from studies.errors import StoreFull, StudyError

Report = Callable[[dict[str, Any]], None]
"""Sends a small message from a task to the caller."""
StopCheck = Callable[[], bool]
"""Returns whether a task shall stop."""
Function = Callable[[Any, Report, StopCheck], Any]


@dataclass(frozen=True, slots=True)
class Message:
    """A report of a running task."""

    content: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Finished:
    """End of a task, with its error if it failed, and the loading path at fault if it is known."""

    task: Any
    error: Exception | None = None
    path: str = ""


@dataclass(frozen=True, slots=True)
class Waiting:
    """No worker accepts tasks, for this `reason`; an empty reason says that work goes on."""

    reason: str


Event = Message | Finished | Waiting


class Executor(Protocol):
    """Computes tasks."""

    @property
    def workers(self) -> int:
        """Number of tasks that are computed at a time."""

    def run(
        self,
        function: Function,
        tasks: Iterable[Any],
        hear: Callable[[Event], None],
        should_stop: StopCheck,
        limits: Limits,
        priority: int,
    ) -> None:
        """Call ``function(task, report, should_stop)`` for every task.

        Parameters
        ----------
        tasks : may be a long generator. If it yields None there is no task for now, and it is asked
            again when another one ends
        hear : called, in this thread, with what happens: the reports, and the end of each task
        should_stop : when it turns true, tasks that wait are dropped and running ones stopped
        limits, priority : as in `run_study`; an executor may not know them
        """


@dataclass(slots=True)
class Here:
    """Computes in this process, one task after the other.

    Attributes
    ----------
    seconds : processor time after which no other task is begun [s]
    over : whether this time has passed
    """

    seconds: float
    over: bool = False
    workers: int = 1

    def run(
        self,
        function: Function,
        tasks: Iterable[Any],
        hear: Callable[[Event], None],
        should_stop: StopCheck,
        limits: Limits,
        priority: int,
    ) -> None:
        """See `Executor`; nothing ends a task that hangs."""
        until = time.process_time() + self.seconds
        failed: list[Exception] = []  # a task takes an error of its reports for its worker's end

        def report(content: dict[str, Any]) -> None:
            try:
                hear(Message(content))
            except Exception as error:
                failed.append(error)
                raise

        for task in tasks:
            if task is None or should_stop():
                return
            error: Exception | None = None
            try:
                function(task, report, lambda: bool(failed) or should_stop())
            except (StoreFull, StudyError) as raised:
                error = raised
            for each in failed:
                raise each
            hear(Finished(task, error))
            if time.process_time() > until:
                release(0)
                self.over = True
                return


LOADED = 240_000_000
"""Bytes of a worker that has loaded all libraries; up to 70 MB less where the system maps less of
their files."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Bounds on the work of a study; None sets no bound.

    Attributes
    ----------
    stall_seconds : longest time of a loading path without progress on a worker [s]; after it its
        runs are stored as ``error`` and the worker is replaced
    path_seconds : longest total time of a loading path on a worker, or of each run of a search [s],
        with the same consequence
    memory : largest memory of each worker process started here, such as ``"2GB"``; by default its
        share of the machine's. A worker that needs more is killed and replaced
    patience : longest time to wait for a worker [s]; after it `GridLost` is raised

    Raises
    ------
    StudyError
        if a time is not above zero, or `memory` is not a size or less than `LOADED`
    """

    stall_seconds: float | None = 900.0
    path_seconds: float | None = None
    memory: str | None = None
    patience: float | None = None

    def __post_init__(self) -> None:
        for name in ("stall_seconds", "path_seconds", "patience"):
            value = getattr(self, name)
            if value is not None and not value > 0.0:
                raise StudyError(name, value, "must be greater than 0")
        if self.memory is None:
            return
        if not (size := bytes_in(self.memory)):
            raise StudyError("memory", self.memory, "must be a size such as 500MB or 2GB")
        if size < LOADED:
            allowed = f"must be at least {LOADED / 1e6:.0f}MB, which a worker needs for libraries"
            raise StudyError("memory", self.memory, f"{allowed}, and more for its runs")

    def check_without_workers(self) -> None:
        """Refuse limits that need workers, because there are none; the usual ones are let pass.

        Raises
        ------
        StudyError
            naming the limit
        """
        for name in ("stall_seconds", "path_seconds", "memory"):
            if (value := getattr(self, name)) not in (None, getattr(Limits(), name)):
                raise StudyError(name, value, "must be left out with 0 workers: it ends a worker")
