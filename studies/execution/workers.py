"""The workers of dask: those of a cluster started here, or of an existing scheduler."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from multiprocessing import connection
from typing import Any

import dask
import psutil
from dask.base import compute
from dask.delayed import delayed
from dask.utils import parse_bytes, parse_timedelta
from distributed import Client, LocalCluster, Security, Worker
from distributed.comm.addressing import get_address_host_port
from distributed.system import MEMORY_LIMIT

from solver.files import read_file
from solver.parts import own_files
from studies.errors import GridLost, Unusable
from studies.execution.access import CONFIGURATION, Access, reported_if_late
from studies.execution.forks import SHARED, Fork, Forks, interrupts_blocked
from studies.execution.script import GUARD, check_script
from studies.scratch import scratch

_LOOKS = 0.2
"""Seconds between two looks: at an interrupt while workers start, and at the workers."""

_ABSENT = 30.0
"""Seconds without a sign of life of a worker started here until it is replaced."""

_TOO_MUCH = 0.95
"""Share of its memory above which a worker is ended."""

_CLOSED: Mapping[str, Any] = {
    # dask's pages show what is computed, without a password.
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
}


@contextmanager
def own_workers(workers: int, memory: str | None = None, need: int = 0) -> Iterator[Access]:
    """Start worker processes of one thread each on this machine; they end with the context.

    Scheduler and workers listen on the loopback device only, and accept only connections with the
    credentials, which are new each time and are kept in memory.

    Parameters
    ----------
    workers : number of processes
    memory : largest memory of each, such as ``"2GB"``; by default its share of the machine's
    need : bytes that each is expected to need; fewer are started where all would need more than the
        machine has

    Yields
    ------
    Access
        usable by any process of this machine

    Raises
    ------
    StudyError
        if the running script would start workers in each worker again
    """
    check_script()
    with ExitStack() as ends, ThreadPoolExecutor(1) as starter:
        # Each worker loads a user's own files that add parts: they may have changed.
        forks = ends.enter_context(contextlib.closing(Forks(()))) if own_files() else SHARED
        forks.prepare()
        workers = min(workers, max(1, MEMORY_LIMIT // need)) if need else workers
        security = Security.temporary()
        folder = ends.enter_context(scratch())
        own = {**CONFIGURATION, **_CLOSED, "temporary-directory": str(folder)}
        ends.enter_context(dask.config.set(own))
        most = parse_bytes(memory) if memory else MEMORY_LIMIT // max(workers, 1)

        def start() -> LocalCluster:
            """Start the scheduler; it is closed at the end even if nobody waits for it any more."""
            with interrupts_blocked():
                cluster = LocalCluster(
                    n_workers=0,
                    host="127.0.0.1",
                    protocol="tls://",
                    security=security,
                    dashboard_address="127.0.0.1:0",  # any free port: None would claim 8787
                    scheduler_kwargs={"dashboard": False},
                    silence_logs=logging.CRITICAL,
                )
                return ends.enter_context(cluster)

        # Logs are no longer silenced when the cluster has closed, and some connections still close.
        logging.getLogger("distributed.batched").setLevel(logging.CRITICAL)
        # An interrupt while the thread itself starts would leave a thread that nobody waits for.
        starter.submit(int).result()
        starting = starter.submit(start)
        # An interrupt that arrives just before the wait does not end it: so this looks again.
        while wait([starting], timeout=_LOOKS).not_done:
            pass
        cluster = starting.result()
        given = cluster.scheduler_address, security, most, dict(dask.config.config)
        staff = _Staff(forks, workers, cluster.scheduler, most, given)
        with staff.working():
            yield Access(
                cluster.scheduler_address,
                security.tls_ca_file,
                security.tls_client_cert,
                security.tls_client_key,
            )


@dataclass(slots=True)
class _Staff:
    """The workers of a scheduler, and who replaces those that end, or are of no use.

    A worker is of no use if the scheduler has given it up, if it does not appear there, or if it
    takes too much memory.
    """

    forks: Forks
    count: int
    scheduler: Any
    memory: int
    given: tuple[Any, ...]
    own: dict[Fork, float] = field(default_factory=dict)
    """When a worker began; infinity once it is known to the scheduler."""

    @contextmanager
    def working(self) -> Iterator[None]:
        """Start them, and keep them until the end of the context."""
        closing, close = connection.Pipe(duplex=False)
        try:
            self._fill()
        except OSError as error:  # as where a thread of the script asks for them
            raise RuntimeError(
                "worker processes did not start; they import the calling script again, so it "
                f"must do its work under: {GUARD}"
            ) from error
        keeper = threading.Thread(target=self._keep, args=(closing,), daemon=True)
        try:
            with interrupts_blocked():
                keeper.start()
            while len(self.scheduler.workers) < self.count:
                time.sleep(0.01)
            yield
        finally:
            close.close()
            if keeper.ident:
                keeper.join()
            for each in self.own:
                each.kill()
            for each in self.own:
                each.end.poll(None)

    def _fill(self) -> None:
        while len(self.own) < self.count:
            self.own[self.forks.start(_work, *self.given)] = time.monotonic()

    def _keep(self, closing: connection.Connection) -> None:
        while not closing.poll(0):
            connection.wait([closing, *(each.end for each in self.own)], _LOOKS)
            there = {each.pid for each in list(self.scheduler.workers.values())}
            for each, begun in list(self.own.items()):
                if each.pid in there:
                    self.own[each] = math.inf
                elif begun == math.inf or time.monotonic() - begun > _ABSENT:
                    each.kill()
                with contextlib.suppress(psutil.Error):
                    if psutil.Process(each.pid).memory_info().rss > _TOO_MUCH * self.memory:
                        each.kill()
                if each.returncode is not None:
                    del self.own[each]
            if not closing.poll(0):
                with contextlib.suppress(OSError):  # it is tried again
                    self._fill()


def _work(address: str, security: Security, memory: int, configuration: dict[str, Any]) -> None:
    """Work for a scheduler."""

    async def work() -> None:
        async with Worker(
            address, host="127.0.0.1", protocol="tls://", nthreads=1, security=security,
            memory_limit=memory,
        ) as worker:  # fmt: skip
            await worker.finished()

    # The error of a task goes to who asked for it. The option of `Worker` silences the handlers of
    # dask alone, and a service has its own.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with dask.config.set(configuration):
        asyncio.run(work())


def connect(access: Access, patience: float | None = None) -> Client:
    """Return a client of a scheduler.

    A message says soon that it has not answered.

    Parameters
    ----------
    patience : seconds within which it must answer, if they are less than Dask's setting
        ``distributed.comm.timeouts.connect`` (30 s, if nothing is set)

    Raises
    ------
    StudyError
        when the certificates cannot be used
    GridLost
        when no scheduler answers
    """
    security = None
    if access.ca and access.cert:
        security = Security(
            require_encryption=True,
            tls_ca_file=access.ca,
            tls_client_cert=access.cert,
            tls_client_key=access.key,
        )
        names = [each for each in (access.ca, access.cert, access.key) if each]
        try:
            for name in (each for each in names if "\n" not in each):
                read_file(name)  # OpenSSL would wait for a pipe
            security.get_connection_args("client")
        except (OSError, ValueError) as error:
            files = ", ".join("(in memory)" if "\n" in each else each for each in names)
            raise Unusable("certificates", files, f"cannot be used: {error}") from None
    try:
        get_address_host_port(access.address)  # a refused client closes badly
        with reported_if_late(f"no scheduler answers at {access.address} yet: waiting"):
            usual = parse_timedelta(dask.config.get("distributed.comm.timeouts.connect"))
            within = usual if patience is None else min(patience, usual)
            given = {"timeout": within, "security": security, "set_as_default": False}
            return Client(access.address, **given)
    except (OSError, ValueError) as error:
        raise GridLost(f"no scheduler answers at {access.address}: {error}") from error


def called(calls: Sequence[Callable[[], Any]], workers: int) -> list[Any]:
    """Call functions in separate processes, and return their results in order."""
    check_script()
    later = [delayed(call)() for call in calls]
    return list(compute(*later, scheduler="processes", num_workers=workers))
