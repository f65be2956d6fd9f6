"""The workers: a cluster started here, or an existing scheduler."""

from __future__ import annotations

import json
import logging
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field
from multiprocessing import resource_tracker
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from solver.files import read_file
from studies.errors import GridLost, StudyError, Unusable
from studies.execution.forking import prepare
from studies.execution.script import GUARD, check_script
from studies.scratch import scratch

if TYPE_CHECKING:
    from distributed import Client, LocalCluster

_APPEARS = 60.0
"""Seconds within which a scheduler must write its file."""

_LATE = 3.0
"""Seconds after which it is reported that a scheduler has not answered."""

_LOOKS = 0.2
"""Seconds after which an interrupt is noticed while workers start."""

_ABSENT = 30.0
"""Seconds without a sign of life of a worker started here until it is replaced."""

FROM_THE_START: Mapping[str, int] = {
    # Runs share the cores: several threads of one would wait for each other.
    "OMP_NUM_THREADS": 1,
    "MKL_NUM_THREADS": 1,
    "OPENBLAS_NUM_THREADS": 1,
    # Arrays of some megabytes are allocated and freed in every iteration: with dask's threshold of
    # 64 kB each would return to the system, and clearing pages would take a quarter of the time.
    "MALLOC_TRIM_THRESHOLD_": 2**28,
    "MALLOC_MMAP_THRESHOLD_": 2**26,
}
"""Environment variables of a worker, which are read when it starts or loads libraries."""

CONFIGURATION: Mapping[str, Any] = {
    # A task whose worker died is tried once more; after a second death the task is blamed.
    "distributed.scheduler.allowed-failures": 1,
    # A task waits at the scheduler until a worker is free, so that cancelling reaches it.
    "distributed.scheduler.worker-saturation": 1.0,
    "distributed.nanny.pre-spawn-environ": FROM_THE_START,
    # Every study has its own topic of events, and dask keeps the messages of each topic.
    "distributed.admin.low-level-log-length": 1,
    # dask's pages are closed. Without the statistics for them processes that wait take a quarter of
    # the time: by default each looks at itself 50 times a second, and a worker at its stack 100.
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
    "distributed.worker.profile.enabled": False,
}
"""Settings of the scheduler and the workers started here."""

_LOG = logging.getLogger("studies")

_CLOSED: Mapping[str, Any] = {
    # dask's pages show what is computed, without a password.
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
}


@dataclass(frozen=True, slots=True)
class Access:
    """The address of a scheduler, and the certificates to reach it.

    Attributes
    ----------
    address : address of the scheduler, such as ``"tls://10.0.0.5:8786"``
    ca, cert, key : certificate of the authority that scheduler and workers trust, certificate of
        this client, and its private key; each a PEM text or the name of a file. The key may be left
        out if the file of the certificate contains it

    Raises
    ------
    StudyError
        if the address needs certificates and there are none
    """

    address: str
    ca: str | None = None
    cert: str | None = None
    key: str | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if self.address.startswith("tls://") and not (self.ca and self.cert):
            allowed = (
                "needs certificates: name the file of the authority (--tls-ca) and those of "
                "your own certificate and key (--tls-cert, --tls-key)"
            )
            raise StudyError("scheduler", self.address, allowed)
        if not self.address.startswith("tls://") and (self.ca or self.cert or self.key):
            allowed = "must begin with tls:// if certificates are given"
            raise StudyError("scheduler", self.address, allowed)

    @classmethod
    def of_file(cls, path: Path, ca: str | None, cert: str | None, key: str | None) -> Self:
        """Return the access to the scheduler that has written its address to a file.

        Parameters
        ----------
        path : the file, which ``dask scheduler --scheduler-file`` writes; it is waited for
        ca, cert, key : as the attributes

        Raises
        ------
        GridLost
            if the file does not appear within a minute
        StudyError
            if it tells no address
        """
        deadline = time.monotonic() + _APPEARS
        with _reported_if_late(f"no scheduler has written the file {path} yet: waiting"):
            while not (path.exists() and path.stat().st_size):  # it is written after it appears
                if time.monotonic() > deadline:
                    raise GridLost(f"no scheduler has written the file {path} in {_APPEARS:g} s")
                time.sleep(0.2)
        try:
            address = json.loads(read_file(path))["address"]
        except (OSError, ValueError, LookupError, TypeError):
            allowed = "must be a file that `dask scheduler --scheduler-file` has written"
            raise StudyError("scheduler-file", str(path), allowed) from None
        return cls(str(address), ca, cert, key)

    def to_dict(self) -> dict[str, str | None]:
        """Return the content, to be sent to another process through a pipe."""
        return asdict(self)

    @classmethod
    def from_dict(cls, content: Mapping[str, str | None]) -> Self:
        """Return the access for a content of `to_dict`."""
        return cls(**content)  # type: ignore[arg-type]


def prepare_workers(more: Sequence[str] = ()) -> str:
    """Begin to load what the workers of `own_workers` need, in the process that is forked for them.

    Return the method of `multiprocessing` to start them. ``more`` are modules to load in addition.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [])
    _ignore_interrupts()
    try:
        return prepare(FROM_THE_START, more)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _ignore_interrupts() -> None:
    """Block Ctrl-C for this thread, and for the threads and processes that it starts.

    Ctrl-C reaches every process of the terminal, also one that has only just begun; only the
    calling process shall react to it.
    """
    resource_tracker.ensure_running()  # it would unblock Ctrl-C when it starts
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])


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
    method = prepare_workers()
    with ExitStack() as ends, ThreadPoolExecutor(1, initializer=_ignore_interrupts) as starter:
        import dask  # takes half a second to import, while the workers' process loads the solver
        import distributed.utils
        from distributed import LocalCluster, Security
        from distributed.system import MEMORY_LIMIT

        workers = min(workers, max(1, MEMORY_LIMIT // need)) if need else workers
        distributed.utils._forkserver_preload_set = True  # or dask would load pandas everywhere
        started = {"distributed.worker.multiprocessing-method": method}
        security = Security.temporary()
        folder = ends.enter_context(scratch())
        own = {**CONFIGURATION, **_CLOSED, **started, "temporary-directory": str(folder)}
        ends.enter_context(dask.config.set(own))

        def start() -> LocalCluster:
            """Start the cluster; it is closed at the end even if nobody waits for it any more."""
            cluster = LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                host="127.0.0.1",
                protocol="tls://",
                security=security,
                dashboard_address="127.0.0.1:0",  # any free port: None would claim 8787
                scheduler_kwargs={"dashboard": False},
                env={**os.environ, **FROM_THE_START},  # through a pipe
                silence_logs=logging.CRITICAL,
                memory_limit=memory or MEMORY_LIMIT // max(workers, 1),
            )
            return ends.enter_context(cluster)

        # An interrupt while the thread itself starts would leave a thread that nobody waits for.
        starter.submit(int).result()
        starting = starter.submit(start)
        # An interrupt that arrives just before the wait does not end it: so this looks again.
        while wait([starting], timeout=_LOOKS).not_done:
            pass
        try:
            cluster = starting.result()
        except RuntimeError as error:  # as where a thread of the script asks for them
            raise RuntimeError(
                "worker processes did not start; they import the calling script again, so it "
                f"must do its work under: {GUARD}"
            ) from error
        with _kept(cluster, workers):
            yield Access(
                cluster.scheduler_address,
                security.tls_ca_file,
                security.tls_client_cert,
                security.tls_client_key,
            )


@contextmanager
def _kept(cluster: LocalCluster, workers: int) -> Iterator[None]:
    """Replace workers that disappear: dask does not restart one that is killed while it starts."""
    scheduler: Any = cluster.scheduler
    closing = threading.Event()
    away: dict[Any, float] = {}

    def keep() -> None:
        while not closing.wait(_ABSENT / 10):
            present = {each.name for each in list(scheduler.workers.values())}
            for name in list(cluster.worker_spec):
                if name in present:
                    away.pop(name, None)
                elif time.monotonic() - away.setdefault(name, time.monotonic()) > _ABSENT:
                    del cluster.worker_spec[name], away[name]
            if len(cluster.worker_spec) < workers:
                cluster.scale(workers)

    keeper = threading.Thread(target=keep, name="keeper of the workers", daemon=True)
    keeper.start()
    try:
        yield
    finally:
        closing.set()
        keeper.join()


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
    import dask
    from dask.utils import parse_timedelta
    from distributed import Client, Security
    from distributed.comm.addressing import get_address_host_port

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
        with _reported_if_late(f"no scheduler answers at {access.address} yet: waiting"):
            usual = parse_timedelta(dask.config.get("distributed.comm.timeouts.connect"))
            within = usual if patience is None else min(patience, usual)
            given = {"timeout": within, "security": security, "set_as_default": False}
            return Client(access.address, **given)
    except (OSError, ValueError) as error:
        raise GridLost(f"no scheduler answers at {access.address}: {error}") from error


@contextmanager
def _reported_if_late(message: str) -> Iterator[None]:
    """Log a message once if the context lasts for some seconds."""
    late = threading.Timer(_LATE, _LOG.warning, [message])
    late.daemon = True
    late.start()
    try:
        yield
    finally:
        late.cancel()


def called(calls: Sequence[Callable[[], Any]], workers: int) -> list[Any]:
    """Call functions in separate processes, and return their results in order.

    Raises
    ------
    StudyError
        if the running script would start processes in each process again
    """
    check_script()
    from dask.base import compute
    from dask.delayed import delayed

    later = [delayed(call)() for call in calls]
    return list(compute(*later, scheduler="processes", num_workers=workers))
