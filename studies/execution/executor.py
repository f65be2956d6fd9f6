"""What computes the tasks of a study: `Executor`; `Here` is this process.

Workers of dask are in `studies.execution.grid`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Protocol

from solver.memory import release
from studies.errors import StoreFull, StudyError
from studies.execution.limits import Limits

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
