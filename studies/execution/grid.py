"""Work spread over the workers of a scheduler."""

from __future__ import annotations

import contextlib
import queue
import threading
import time
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Self

from dask.task_spec import Task
from distributed import Client, Future, KilledWorker, get_worker

from studies.errors import GridLost
from studies.execution.cluster import Access, connect
from studies.execution.limits import Limits
from studies.execution.proof import Unfit

Report = Callable[[dict[str, Any]], None]
"""Sends a small message from a task to the caller."""
StopCheck = Callable[[], bool]
"""Tells a task whether it shall stop."""
Function = Callable[[Any, Report, StopCheck], Any]

_POLL = 0.2
"""Seconds between two looks at whether to stop."""
_LOOK = 1.0
"""Seconds between two looks at what the workers do."""
_QUIET = 10.0
"""Seconds without a worker that takes the work until this is told."""
_BEGIN = 60.0
"""Seconds that a worker may take to load what it needs for its first task."""
_GRACE = 5.0
"""Seconds that running tasks are given to stop; a frozen worker never does."""
_SPARE = 2
"""Tasks that wait at the scheduler, so that no worker waits for the next one."""
_RESTART = 30.0
"""Seconds within which the keeper of a worker must have killed it."""
_STARTS = 2
"""Starts of a task that ended with the death of the worker, before the task is blamed."""
_ROUNDS = 3
"""The same for a task that dies before a word of its start gets through; dask counts two each."""

_WORKER_DIED = (
    "the worker process died each time it computed this loading path; if memory ran out, "
    "use fewer workers or allow each more memory"
)
_NO_WORKER = "no worker is connected to the scheduler: start one, or wait while they start again"
_NOT_TAKEN = "of the workers that are connected ({}) none takes the work: see their logs"
_SILENT = "the scheduler does not answer"


@dataclass(frozen=True, slots=True)
class Message:
    """What a running task reported."""

    content: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Waiting:
    """No worker takes the work, for this `reason`; an empty one says that it goes on."""

    reason: str


@dataclass(frozen=True, slots=True)
class Finished:
    """End of a task, with the error that took it down if there was one."""

    task: Any
    error: Exception | None = None


@dataclass(slots=True)
class _Ticket:
    """A task that was handed out.

    Attributes
    ----------
    task, future : what was handed out
    worker : where it runs; empty while it waits for a worker
    begun, heard : when it began there, and when it last reported [s]
    computing : whether it has reported anything there
    starts, rounds : how often a worker began it, and how often dask gave it up
    """

    task: Any
    future: Future[Any] | None = None
    worker: str = ""
    begun: float = 0.0
    heard: float = 0.0
    computing: bool = False
    starts: int = 0
    rounds: int = 0

    def overdue(self, limits: Limits) -> str:
        """Return which limit the task has passed, in words; nothing when none."""
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


class Grid:
    """The workers of a scheduler.

    Parameters
    ----------
    access : to the scheduler
    """

    def __init__(self, access: Access) -> None:
        self._client = connect(access)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *reason: object) -> None:
        self._client.close()

    def run(
        self,
        function: Function,
        tasks: Iterable[Any],
        should_stop: StopCheck,
        limits: Limits | None = None,
        priority: int = 0,
    ) -> Iterator[Message | Waiting | Finished]:
        """Run ``function(task, report, should_stop)`` for every task; yield what happens.

        Only so many tasks as there are workers, and a few more, are at the scheduler at a time:
        others who use it get their turn, and `tasks` may be a long generator. A `function` that
        raises `Unfit` is called again later, on whichever worker is free.

        When `should_stop` turns true, waiting tasks are dropped and running ones told to stop;
        the iteration ends when these have, or soon.

        Raises
        ------
        GridLost
            when the scheduler is gone or has forgotten the tasks, or when no worker took the work
            for as long as `limits` allow
        """
        handed_out = _HandedOut(self._client, function, limits or Limits(), priority)
        try:
            yield from handed_out.carry_out(iter(tasks), should_stop)
        finally:
            handed_out.close()


class _HandedOut:
    """The tasks of one call that the scheduler has, and what is heard of them."""

    def __init__(self, client: Client, function: Function, limits: Limits, priority: int) -> None:
        self._client = client
        self._function = function
        self._limits = limits
        self._priority = priority
        self._tickets: dict[str, _Ticket] = {}
        self._inbox: queue.SimpleQueue[dict[str, Any] | Future[Any]] = queue.SimpleQueue()
        self._topic = uuid.uuid4().hex
        client.subscribe_topic(self._topic, lambda event: self._inbox.put(event[1]))
        self._room = _SPARE
        self._reason = ""
        self._unfit: set[str] = set()
        self._known: dict[str, float] = {}
        self._worked = self._quiet = time.monotonic()
        self._replacing: list[threading.Thread] = []

    def carry_out(
        self, tasks: Iterator[Any], should_stop: StopCheck
    ) -> Iterator[Message | Waiting | Finished]:
        """Hand out the tasks one after the other, and yield what happens."""
        looked = float("-inf")
        while not should_stop():
            if time.monotonic() - looked > _LOOK:
                yield from self._look()
                looked = time.monotonic()
            while len(self._tickets) < self._room and (task := next(tasks, None)) is not None:
                self._hand_out(_Ticket(task))
            if not self._tickets:
                return
            with contextlib.suppress(queue.Empty):
                item = self._inbox.get(timeout=_POLL)
                yield from self._hear(item) if isinstance(item, dict) else self._end(item)
        yield from self._stop()

    def close(self) -> None:
        """Drop the tasks that are left."""
        self._client.unsubscribe_topic(self._topic)
        for ticket in self._tickets.values():
            _drop(ticket)
        for thread in self._replacing:
            thread.join(_RESTART)

    def _hand_out(self, ticket: _Ticket) -> None:
        key = f"path-{uuid.uuid4().hex}"
        # As a producer of data it waits at the scheduler until a worker is free, however few
        # tasks there are. Otherwise it would wait at one worker, which may be slow, or frozen.
        graph = {
            key: Task(
                key, _call, self._function, self._topic, key, ticket.task, _data_producer=True
            )
        }
        (future,) = self._client.get(
            graph, [key], sync=False, priority=self._priority, fifo_timeout=0
        )
        ticket.future, ticket.worker, ticket.computing = future, "", False
        self._tickets[key] = ticket
        future.add_done_callback(self._inbox.put)

    def _hear(self, item: dict[str, Any]) -> Iterator[Message | Waiting]:
        """Take in what a task says; without content it has begun."""
        ticket, content = self._tickets.get(item["key"]), item["content"]
        if ticket is not None:
            ticket.heard = time.monotonic()
            if item["kind"] == "begun":
                ticket.worker, ticket.begun, ticket.computing = item["worker"], ticket.heard, False
                ticket.starts += 1
            elif content and ticket.worker:
                ticket.computing = True
                if self._reason:
                    self._reason = ""
                    yield Waiting("")
        if content:
            yield Message(content)

    def _end(self, future: Future[Any]) -> Iterator[Waiting | Finished]:
        """Take in that dask is done with a task."""
        ticket = self._tickets.pop(str(future.key), None)
        if ticket is None:
            return
        error = future.exception() if future.status == "error" else None
        if future.cancelled():
            raise GridLost("the scheduler dropped the tasks")
        _drop(ticket)  # or the task would be repeated if the worker died with the result
        if isinstance(error, Unfit):
            ticket.starts -= 1
            yield from self._refused(ticket.worker, f"the worker {ticket.worker} {error}")
            self._hand_out(ticket)
        elif isinstance(error, KilledWorker):
            ticket.rounds += 1
            if ticket.starts < _STARTS and ticket.rounds < _ROUNDS:
                self._hand_out(ticket)  # it was there when others took the worker down
            else:
                yield Finished(ticket.task, RuntimeError(_WORKER_DIED))
        else:
            yield Finished(ticket.task, error)

    def _refused(self, worker: str, reason: str) -> Iterator[Waiting]:
        """Tell that a worker refused, once for each, and once when nothing goes on."""
        idle = not any(ticket.computing for ticket in self._tickets.values())
        if worker not in self._unfit or (idle and not self._reason):
            self._unfit.add(worker)
            self._reason = reason
            yield Waiting(reason)

    def _look(self) -> Iterator[Waiting | Finished]:
        """See which workers there are and what they do, and act on what has lasted too long."""
        at_workers = self._processing()
        reason = _SILENT
        if at_workers is not None:
            self._room = len(at_workers) + _SPARE
            reason = _NOT_TAKEN.format(len(at_workers)) if at_workers else _NO_WORKER
            for key, ticket in self._tickets.items():
                if key not in at_workers.get(ticket.worker, ()):
                    ticket.worker, ticket.computing = "", False  # the worker is gone
        for key, ticket in list(self._tickets.items()):
            if passed := ticket.overdue(self._limits):
                del self._tickets[key]
                _drop(ticket)
                self._replace(ticket.worker)
                yield Finished(ticket.task, RuntimeError(passed))
        now = time.monotonic()
        if self._taken(at_workers or {}, now):
            self._quiet = now
        lasted = now - self._quiet
        if lasted > _QUIET and not self._reason:
            self._reason = reason
            yield Waiting(reason)
        if self._limits.patience is not None and lasted > self._limits.patience:
            raise GridLost(f"{self._reason or reason} (waited {lasted:.0f} s)")

    def _taken(self, at_workers: Mapping[str, Iterable[str]], now: float) -> bool:
        """Tell whether a worker computes, for us or for others, or is about to begin."""
        self._known = {worker: self._known.get(worker, now) for worker in at_workers}
        queued = {key for key, ticket in self._tickets.items() if not ticket.worker}
        others = any(key not in self._tickets for keys in at_workers.values() for key in keys)
        if others or not self._tickets or any(t.computing for t in self._tickets.values()):
            self._worked = now
            return True
        # A worker that has just come may be killed again; one that stays is loading the program.
        return (
            now - self._worked < _BEGIN
            and not self._unfit
            and any(
                now - self._known[worker] > _QUIET / 2 and not queued.isdisjoint(keys)
                for worker, keys in at_workers.items()
            )
        )

    def _processing(self) -> dict[str, Any] | None:
        """Return the keys at each worker; nothing when the scheduler does not answer."""
        try:
            found: dict[str, Any] = self._ask("processing", _QUIET / 2, workers=None)
        except (OSError, TimeoutError):
            return None
        return found

    def _ask(self, what: str, seconds: float, **content: Any) -> Any:
        """Call the scheduler, which must answer in time."""
        return self._client.sync(
            getattr(self._client.scheduler, what), callback_timeout=seconds, **content
        )

    def _replace(self, worker: str) -> None:
        """Have a worker killed and started anew, without waiting for it."""
        for ticket in self._tickets.values():
            if ticket.worker == worker:
                ticket.starts -= 1  # its next death is no doing of this task

        def restart() -> None:
            with contextlib.suppress(Exception):  # it is removed when its keeper is gone too
                self._ask(
                    "restart_workers", 2 * _RESTART, workers=[worker], timeout=_RESTART,
                    wait_for_workers=False, on_error="return", stimulus_id=self._topic,
                )  # fmt: skip

        self._replacing.append(threading.Thread(target=restart, daemon=True))
        self._replacing[-1].start()

    def _stop(self) -> Iterator[Message]:
        """Drop all tasks, and wait a little for those that run."""
        running = {key for key, ticket in self._tickets.items() if ticket.worker}
        for ticket in self._tickets.values():
            _drop(ticket)
        deadline = time.monotonic() + _GRACE
        while running and time.monotonic() < deadline:
            with contextlib.suppress(queue.Empty):
                item = self._inbox.get(timeout=_POLL)
                if isinstance(item, dict):
                    if item["kind"] == "ended":
                        running.discard(item["key"])
                    elif item["content"]:
                        yield Message(item["content"])


def _drop(ticket: _Ticket) -> None:
    """Tell the scheduler that nobody wants a task any more; where it runs, it is told to stop."""
    if ticket.future is not None:
        ticket.future.release()
        ticket.future = None


def _call(function: Function, topic: str, key: str, task: Any) -> None:
    """Run one task on a worker."""
    worker = get_worker()

    def send(kind: str, content: dict[str, Any] | None = None) -> None:
        worker.log_event(
            topic, {"key": key, "worker": worker.address, "kind": kind, "content": content}
        )

    def should_stop() -> bool:
        known = worker.state.tasks.get(key)
        return known is None or known.state == "cancelled"

    send("begun")
    try:
        function(task, lambda content: send("report", content), should_stop)
    finally:
        send("ended")
