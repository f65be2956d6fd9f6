"""Work spread over processes or machines; the only module that knows dask."""

from __future__ import annotations

import logging
import queue
import tempfile
import time
import uuid
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Any, Self

import dask
from distributed import Client, Event, Future, KilledWorker, LocalCluster, get_worker
from distributed.client import FutureCancelledError
from distributed.comm.addressing import get_address_host_port

from studies.errors import GridLost

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

_CONNECT = 10.0
"""Seconds within which a scheduler must answer."""

_CONFIGURATION = {
    # A task whose worker died is tried once more; a second death is the task's own doing.
    "distributed.scheduler.allowed-failures": 1,
    # A task waits at the scheduler until a worker is free, so that cancelling reaches it.
    "distributed.scheduler.worker-saturation": 1.0,
    # Arrays of some megabytes come and go in every iteration: dask's threshold of 64 kB would hand
    # each back to the system, and a quarter of the time would go into clearing pages.
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 2**28,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 2**26,
    # Ctrl-C reaches every process of the terminal; the caller alone decides what it means.
    "distributed.worker.preload": ["import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)"],
}


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
    """Workers of our own (one thread a process), or those of a running scheduler.

    Parameters
    ----------
    workers : number of worker processes of our own
    scheduler : address of a running scheduler; its workers are used instead
    """

    def __init__(self, workers: int, scheduler: str | None = None) -> None:
        self._workers = workers
        self._scheduler = scheduler
        self._open = ExitStack()

    def __enter__(self) -> Self:
        with ExitStack() as opening:
            address = self._scheduler or self._own_workers(opening)
            try:
                if self._scheduler:
                    get_address_host_port(self._scheduler)  # a refused client closes badly
                self._client = opening.enter_context(
                    Client(address, set_as_default=False, timeout=_CONNECT)
                )
            except (OSError, ValueError) as error:
                raise GridLost(f"no scheduler answers at {address}: {error}") from error
            self._open = opening.pop_all()
        return self

    def _own_workers(self, opening: ExitStack) -> LocalCluster:
        scratch = opening.enter_context(
            tempfile.TemporaryDirectory(prefix="residua-", ignore_cleanup_errors=True)
        )
        opening.enter_context(dask.config.set(_CONFIGURATION))
        try:
            return opening.enter_context(
                LocalCluster(
                    n_workers=self._workers,
                    threads_per_worker=1,
                    processes=True,
                    host="127.0.0.1",
                    dashboard_address="127.0.0.1:0",  # any free port: None would claim 8787
                    local_directory=scratch,
                    silence_logs=logging.CRITICAL,
                )
            )
        except RuntimeError as error:
            raise RuntimeError(
                "worker processes did not start; they import the calling script anew, so it must "
                "do its work under: if __name__ == '__main__':"
            ) from error

    def __exit__(self, *reason: object) -> None:
        self._open.close()

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
