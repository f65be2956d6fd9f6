"""The state of submitted tasks, and whether any worker accepts them."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from studies.errors import GridLost
from studies.execution.executor import Limits, Waiting

_QUIET = 10.0
"""Seconds without a worker that accepts tasks until this is reported."""
_BEGIN = 60.0
"""Seconds that a worker may take to load the program for its first task."""

_NO_WORKER = "no worker is connected to the scheduler: start one, or wait while they start again"
_NOT_TAKEN = "of the workers that are connected ({}) none takes the work: see their logs"
_SILENT = "the scheduler does not answer"


@dataclass(slots=True)
class Ticket:
    """A submitted task.

    Attributes
    ----------
    task, future : the task, and its dask future
    worker : the worker that runs it; empty while it waits for a worker
    path : the loading path of the task that is computed; empty until the first is reported
    begun, heard : time of the start of this path there, and of its last report [s]
    computing : whether it has reported anything there
    starts, rounds : how often a worker began this path, and how often dask gave it up
    """

    task: Any
    future: Any = None
    worker: str = ""
    path: str = ""
    begun: float = 0.0
    heard: float = 0.0
    computing: bool = False
    starts: int = 0
    rounds: int = 0

    def walks(self, path: str, anew: bool = False) -> None:
        """Note that a path of the task is computed; time and starts count from its begin.

        They count ``anew`` at each run of a search, which asks for one after the other.
        """
        if anew or (self.path and path != self.path):
            self.begun, self.starts, self.rounds = self.heard, 1, 0
        self.path = path

    def overdue(self, limits: Limits) -> str:
        """Return the limit that the task has exceeded, as text; empty if none."""
        now = time.monotonic()
        if not self.worker:
            return ""
        if limits.stall_seconds is not None and now - self.heard > limits.stall_seconds:
            passed = f"made no progress for {limits.stall_seconds:g} s (limit stall_seconds)"
        elif limits.path_seconds is not None and now - self.begun > limits.path_seconds:
            passed = f"took longer than {limits.path_seconds:g} s (limit path_seconds)"
        else:
            return ""
        return f"the loading path {passed}; its worker was replaced"


class Watch:
    """Reports that no worker accepts tasks, and gives up after some time.

    Parameters
    ----------
    patience : seconds to wait; None waits without end
    """

    def __init__(self, patience: float | None) -> None:
        self._patience = patience
        self._reason = ""
        self._refusals: set[str] = set()
        self._since: dict[str, float] = {}
        self._worked = self._quiet = time.monotonic()

    def goes_on(self) -> Iterator[Waiting]:
        """Note that a task computes."""
        self._worked = self._quiet = time.monotonic()
        if self._reason:
            self._reason = ""
            yield Waiting("")

    def refused(self, reason: str, others: Iterable[Ticket]) -> Iterator[Waiting]:
        """Report that a worker refused: once for each, and if none of the `others` computes."""
        idle = not any(other.computing for other in others)
        if reason not in self._refusals or (idle and not self._reason):
            self._refusals.add(reason)
            self._reason = reason
            yield Waiting(reason)

    def look(
        self,
        at_workers: Mapping[str, Iterable[str]] | None,
        tickets: Mapping[str, Ticket],
        held_up: float = 0.0,
    ) -> Iterator[Waiting]:
        """Evaluate the task keys at each worker; None if the scheduler does not answer.

        Time for which this process was `held_up` does not count [s].

        Raises
        ------
        GridLost
            if no worker has accepted tasks for longer than `patience`
        """
        reason = _NOT_TAKEN.format(len(at_workers)) if at_workers else _NO_WORKER
        if at_workers is None:
            reason = _SILENT
        now = time.monotonic()
        self._worked, self._quiet = self._worked + held_up, self._quiet + held_up
        if self._taken(at_workers or {}, tickets, now):
            self._quiet = now
        lasted = now - self._quiet
        if lasted > _QUIET and not self._reason:
            self._reason = reason
            yield Waiting(reason)
        if self._patience is not None and lasted > self._patience:
            raise GridLost(f"{self._reason or reason} (waited {lasted:.0f} s)")

    def _taken(
        self, at_workers: Mapping[str, Iterable[str]], tickets: Mapping[str, Ticket], now: float
    ) -> bool:
        """Whether a worker computes, for this study or others, or is about to begin."""
        self._since = {worker: self._since.get(worker, now) for worker in at_workers}
        others = any(key not in tickets for keys in at_workers.values() for key in keys)
        if others or not tickets or any(ticket.computing for ticket in tickets.values()):
            self._worked = now
            return True
        # A new worker may be killed again; one that stays is loading the program.
        queued = {key for key, ticket in tickets.items() if not ticket.worker}
        return (
            now - self._worked < _BEGIN
            and not self._refusals
            and any(
                now - self._since[worker] > _QUIET / 2 and not queued.isdisjoint(keys)
                for worker, keys in at_workers.items()
            )
        )
