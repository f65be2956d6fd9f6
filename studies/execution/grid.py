"""Work spread over the workers of a scheduler."""

from __future__ import annotations

import queue
import time
import uuid
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Self

from distributed import Event, Future, KilledWorker, get_worker
from distributed.client import FutureCancelledError

from studies.errors import GridLost
from studies.execution.cluster import Access, connect

Report = Callable[[dict[str, Any]], None]
"""Sends a small message from a task to the caller."""
StopCheck = Callable[[], bool]
"""Tells a task whether it shall stop."""
Function = Callable[[Any, Report, StopCheck], Any]

_POLL = 0.2
"""Seconds between two looks at whether to stop, on either side."""
_WORKER_DIED = (
    "the worker process died each time it computed this loading path; if memory ran out, "
    "use fewer workers"
)


@dataclass(frozen=True, slots=True)
class Message:
    """What a running task reported."""

    content: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Finished:
    """End of the task at `position`: its result, or the error that took it down."""

    position: int
    result: Any = None
    error: Exception | None = None


class Grid:
    """The workers of a scheduler.

    Parameters
    ----------
    access : of the scheduler
    """

    def __init__(self, access: Access) -> None:
        self._client = connect(access)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *reason: object) -> None:
        self._client.close()

    def run(
        self, function: Function, tasks: Sequence[Any], should_stop: StopCheck
    ) -> Iterator[Message | Finished]:
        """Run ``function(task, report, should_stop)`` for every task; yield what happens.

        When `should_stop` turns true, waiting tasks are dropped and running ones told to stop;
        the iteration ends when these have.

        Raises
        ------
        GridLost
            when the scheduler is gone or has forgotten the tasks
        """
        token = uuid.uuid4().hex
        inbox: queue.SimpleQueue[Message | Future[Any]] = queue.SimpleQueue()
        stop = Event(f"stop-{token}", client=self._client)
        self._client.subscribe_topic(token, lambda event: inbox.put(Message(event[1])))
        call = partial(_call, function, token)
        keys = [f"sim-{uuid.uuid4().hex}" for _ in tasks]
        futures = dict(zip(keys, self._client.map(call, tasks, key=keys, pure=False), strict=True))
        positions = {key: position for position, key in enumerate(keys)}
        for future in futures.values():
            future.add_done_callback(inbox.put)
        try:
            stopping = False
            while futures:
                if not stopping and should_stop():
                    stopping = True
                    stop.set()
                    for key in self._drop_idle(futures.values()):
                        del futures[key]
                try:
                    item = inbox.get(timeout=_POLL)
                except queue.Empty:
                    continue
                if isinstance(item, Message):
                    yield item
                elif item.key in futures:
                    yield _finished(item, positions[item.key])
                    # Let go, or the task would be repeated if the worker died with the result.
                    futures.pop(item.key).release()
        finally:
            self._client.unsubscribe_topic(token)
            self._client.cancel(list(futures.values()))

    def _drop_idle(self, futures: Iterable[Future[Any]]) -> list[str]:
        """Cancel the tasks that no worker has begun; return their keys."""
        begun = {key for keys in self._client.processing().values() for key in keys}
        idle = [each for each in futures if not each.done() and each.key not in begun]
        self._client.cancel(idle)
        return [str(each.key) for each in idle]


def _call(function: Function, token: str, task: Any) -> Any:
    """Run one task on a worker."""
    worker = get_worker()
    stop = Event(f"stop-{token}")
    asked = 0.0
    answer = False

    def should_stop() -> bool:
        nonlocal asked, answer
        if not answer and time.monotonic() - asked > _POLL:
            answer, asked = stop.is_set(), time.monotonic()
        return answer

    return function(task, partial(worker.log_event, token), should_stop)


def _finished(future: Future[Any], position: int) -> Finished:
    try:
        return Finished(position, future.result())
    except FutureCancelledError as error:
        raise GridLost(f"the scheduler dropped the tasks: {error}") from error
    except KilledWorker:
        return Finished(position, error=RuntimeError(_WORKER_DIED))
    except Exception as error:
        return Finished(position, error=error)
