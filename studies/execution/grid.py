"""Distribution of tasks to the workers of a scheduler."""

from __future__ import annotations

import contextlib
import queue
import threading
import time
import uuid
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Self

from dask.task_spec import Task
from distributed import Client, Future, KilledWorker, get_worker

from studies.errors import GridLost
from studies.execution.access import Access
from studies.execution.executor import (
    Event,
    Finished,
    Function,
    Limits,
    Message,
    StopCheck,
    Waiting,
)  # fmt: skip
from studies.execution.task import Unfit
from studies.execution.watch import Ticket, Watch
from studies.execution.workers import connect

_POLL = 0.2
"""Seconds between two checks whether to stop."""
_LOOK = 1.0
"""Seconds between two checks of the workers."""
_HELD_UP = 5.0
"""Seconds between two checks above which this process must have been suspended or blocked."""
_ANSWER = 5.0
"""Seconds within which the scheduler must answer."""
_GRACE = 5.0
"""Seconds that running tasks have to stop; a frozen worker never does."""
_SPARE = 2
"""Number of tasks that wait at the scheduler, so that no worker is idle."""
_HEAD_START = 60.0
"""Seconds by which each submitted task of a study delays its next one, in favour of others."""
_RESTART = 30.0
"""Seconds within which the nanny of a worker, if it has one, must have killed it."""
_DROPPED = 0.02
"""Seconds between two questions whether the scheduler has dropped a task."""
_STARTS = 2
"""Number of starts of a task that ended with the death of the worker, before the task is blamed."""
_ROUNDS = 3
"""The same number for tasks that die before their start is reported; dask counts two each."""

_WORKER_DIED = (
    "the worker process died each time it computed this loading path; if memory ran out, "
    "use fewer workers or allow each more memory"
)


class Grid:
    """The workers of a scheduler."""

    def __init__(self, access: Access, patience: float | None = None) -> None:
        self._client = connect(access, patience)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *reason: object) -> None:
        self._client.close()

    @property
    def workers(self) -> int:
        """Number of tasks that the workers compute at a time; 0 if the scheduler is silent."""
        with contextlib.suppress(OSError, TimeoutError):
            return sum(_asked(self._client, "ncores", workers=None).values())
        return 0

    def run(
        self,
        function: Function,
        tasks: Iterable[Any],
        hear: Callable[[Event], None],
        should_stop: StopCheck,
        limits: Limits,
        priority: int,
    ) -> None:
        """See `Executor`.

        Only so many tasks as there are workers, and a few more, are at the scheduler at a time:
        others who use it get their turn, and `tasks` may be a long generator. If it yields None
        there is no task for now, and it is asked again when another one ends. A report with a
        ``path`` and its ``fraction`` says which loading path of the task is computed; limits hold
        for each path, and anew after a report with ``follows``. A `function` that raises `Unfit` is
        called again later, on whichever worker is free.

        When `should_stop` turns true, it ends when the running tasks have, or soon.

        Raises
        ------
        GridLost
            when the scheduler is gone or has forgotten the tasks, or when no worker took the work
            for as long as `limits` allow
        """
        handed_out = _HandedOut(self._client, function, limits, priority)
        try:
            for event in handed_out.carry_out(iter(tasks), should_stop):
                hear(event)
        finally:
            handed_out.close()


class _HandedOut:
    """The tasks of one call that the scheduler has, and what is heard of them."""

    def __init__(self, client: Client, function: Function, limits: Limits, priority: int) -> None:
        self._client, self._function = client, function
        self._limits, self._priority = limits, priority
        self._tickets: dict[str, Ticket] = {}
        self._inbox: queue.SimpleQueue[dict[str, Any] | Future[Any]] = queue.SimpleQueue()
        self._topic = uuid.uuid4().hex
        client.subscribe_topic(self._topic, lambda event: self._inbox.put(event[1]))
        self._room = _SPARE
        self._watch = Watch(limits.patience)
        self._replacing: list[threading.Thread] = []

    def carry_out(self, tasks: Iterator[Any], should_stop: StopCheck) -> Iterator[Event]:
        """Hand out the tasks one after the other, and yield what happens."""
        looked = time.monotonic() - 2 * _LOOK
        while not should_stop():
            since = time.monotonic() - looked
            if since > _LOOK:
                yield from self._check_workers(since if since > _HELD_UP else 0.0)
                looked = time.monotonic()
            while len(self._tickets) < self._room and (task := next(tasks, None)) is not None:
                self._hand_out(Ticket(task))
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
            thread.join(_GRACE)

    def _hand_out(self, ticket: Ticket) -> None:
        key = f"path-{uuid.uuid4().hex}"
        # As a producer of data it waits at the scheduler until a worker is free, however few
        # tasks there are. Otherwise it would wait at one worker, which may be slow, or frozen.
        content = self._function, self._topic, key, ticket.task
        graph = {key: Task(key, _call, *content, _data_producer=True)}
        # A new study does not wait behind the waiting tasks of another study, and a study that
        # submits tasks again and again does not always go first.
        priority = self._priority - (time.time() + _HEAD_START * len(self._tickets)) / 1e11
        (future,) = self._client.get(graph, [key], sync=False, priority=priority, fifo_timeout=0)
        ticket.future, ticket.worker, ticket.computing = future, "", False
        self._tickets[key] = ticket
        future.add_done_callback(self._inbox.put)

    def _hear(self, item: dict[str, Any]) -> Iterator[Message | Waiting]:
        """Process a message of a task; one without content says that it has begun."""
        ticket, content = self._tickets.get(item["key"]), item["content"]
        if ticket is not None:
            ticket.heard = time.monotonic()
            if item["kind"] == "begun":
                ticket.worker, ticket.begun, ticket.computing = item["worker"], ticket.heard, False
                ticket.starts += 1
            elif content and ticket.worker:
                ticket.computing = True
                if "fraction" in content or "follows" in content:
                    ticket.walks(content["path"], anew="follows" in content)
                yield from self._watch.goes_on()
        if content:
            yield Message(content)

    def _end(self, future: Future[Any]) -> Iterator[Waiting | Finished]:
        """Process the end of a task in dask."""
        ticket = self._tickets.pop(str(future.key), None)
        if ticket is None:
            return
        error = future.exception() if future.status == "error" else None
        if future.cancelled():
            raise GridLost("the scheduler dropped the tasks")
        _drop(ticket)  # or the task would be repeated if the worker died with the result
        if isinstance(error, Unfit):
            ticket.starts -= 1
            yield from self._watch.refused(str(error), self._tickets.values())
            self._hand_out(ticket)
        elif isinstance(error, KilledWorker):
            ticket.rounds += 1
            if ticket.starts < _STARTS and ticket.rounds < _ROUNDS:
                self._hand_out(ticket)  # another task may have killed the worker
            else:
                yield Finished(ticket.task, RuntimeError(_WORKER_DIED))
        else:
            yield Finished(ticket.task, error)

    def _check_workers(self, held_up: float) -> Iterator[Waiting | Finished]:
        """Check the workers, and replace those whose task exceeds a limit.

        The seconds for which this process was suspended (``held_up``) do not count: messages of
        that time have not been processed yet.
        """
        for ticket in self._tickets.values():
            ticket.begun, ticket.heard = ticket.begun + held_up, ticket.heard + held_up
        at_workers = self._processing()
        if at_workers is not None:
            for key, ticket in self._tickets.items():
                if key not in at_workers.get(ticket.worker, ()):
                    ticket.worker, ticket.computing = "", False  # the worker is gone
        for key, ticket in list(self._tickets.items()):
            if passed := ticket.overdue(self._limits):
                _drop(self._tickets.pop(key))
                self._replace(ticket.worker, key)
                yield Finished(ticket.task, RuntimeError(passed), ticket.path)
        yield from self._watch.look(at_workers, self._tickets, held_up)

    def _processing(self) -> dict[str, Any] | None:
        """Return the task keys at each worker; None if the scheduler does not answer."""
        with contextlib.suppress(OSError, TimeoutError):
            self._room = _SPARE + sum(_asked(self._client, "ncores", workers=None).values())
            return self._at_workers()
        return None

    def _at_workers(self) -> dict[str, Any]:
        return dict(_asked(self._client, "processing", workers=None))

    def _replace(self, worker: str, key: str) -> None:
        """Restart a worker, without waiting for it, when the scheduler has dropped its task.

        The scheduler would give a task that it still has to another worker, which nobody watches.
        """
        for ticket in self._tickets.values():
            if ticket.worker == worker:
                ticket.starts -= 1  # the death is not the fault of this task, which begins again
                ticket.worker, ticket.computing = "", False

        def restart() -> None:
            with contextlib.suppress(Exception):  # it is removed if its nanny is gone too
                until = time.monotonic() + _RESTART
                while any(key in keys for keys in self._at_workers().values()):
                    if time.monotonic() > until:
                        break
                    time.sleep(_DROPPED)
                _asked(
                    self._client, "restart_workers", 2 * _RESTART, workers=[worker],
                    timeout=_RESTART, wait_for_workers=False, on_error="return",
                    stimulus_id=self._topic,
                )  # fmt: skip

        self._replacing.append(threading.Thread(target=restart, daemon=True))
        self._replacing[-1].start()

    def _stop(self) -> Iterator[Message]:
        """Cancel all tasks, and wait a little for those that run."""
        running = {key for key, ticket in self._tickets.items() if ticket.worker}
        for ticket in self._tickets.values():
            _drop(ticket)
        deadline = time.monotonic() + _GRACE
        while running and time.monotonic() < deadline:
            with contextlib.suppress(queue.Empty):
                item = self._inbox.get(timeout=_POLL)
                if isinstance(item, dict) and item["content"]:
                    yield Message(item["content"])
                elif isinstance(item, dict) and item["kind"] == "ended":
                    running.discard(item["key"])


def _asked(client: Client, what: str, seconds: float = _ANSWER, **content: Any) -> Any:
    """Call the scheduler, which must answer in time, and return its answer."""
    return client.sync(getattr(client.scheduler, what), callback_timeout=seconds, **content)


def _drop(ticket: Ticket) -> None:
    """Cancel a task that is not needed any more; if it runs, it stops."""
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
    except Unfit as error:
        raise Unfit(f"the worker {worker.address} {error}") from None
    finally:
        send("ended")
