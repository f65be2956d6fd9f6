"""Call functions in other processes, two at a time, with limits of time and memory.

A large study takes seconds and memory to check, and a malicious mesh could take both without end.
Meanwhile the service answers other requests.
"""

from __future__ import annotations

import copyreg
import os
import pickle
import resource
import signal
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from io import BytesIO
from math import ceil
from pathlib import Path
from typing import TypeVar, cast
from weakref import WeakValueDictionary

from anyio import BrokenWorkerProcess, CapacityLimiter, Lock, fail_after
from anyio.to_process import run_sync

from service.errors import Busy
from solver.files import read_file
from studies import StudyError

READERS = 2
"""Number of calls of a queue at a time."""

MINUTE = 60.0
"""Time after which a caller has its whole budget again [s]."""

Found = TypeVar("Found")


class Beyond(StudyError):
    """An input that takes more time or memory than is allowed."""


def memory(groups: Path = Path("/proc/self/cgroup"), mounted: Path = Path("/sys/fs/cgroup")) -> int:
    """Return the memory that this process and those it starts may have [bytes].

    The smallest limit of its control groups, of version 2 or 1, or all of the machine. In a
    container the path of a group may be that outside, and its files are at the top.
    """
    found = [os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")]
    with suppress(OSError):
        for line in read_file(groups).decode().splitlines():
            _, kinds, path = line.split(":", 2)
            if kinds and "memory" not in kinds.split(","):
                continue
            top, name = (
                (mounted / "memory", "memory.limit_in_bytes") if kinds else (mounted, "memory.max")
            )
            own = top / path.lstrip("/")
            for folder in (own, *own.parents):
                with suppress(OSError, ValueError):  # no such file, or "max"
                    found.append(int(read_file(folder / name)))
    return min(found)


BYTES = min(max(memory() // 5, 2**30), 8 * 2**30)
"""Address space of a process [bytes]: the service and those of two queues share the memory."""


class Guarded:
    """A queue of calls to such processes.

    Parameters
    ----------
    field : the input that errors name: ``study``, ``scene``
    waiting : number of calls that may wait
    seconds : longest time of a call
    """

    def __init__(self, field: str, waiting: int, seconds: float) -> None:
        self.field, self.waiting, self.seconds = field, waiting, seconds
        self.present, self.readers = 0, CapacityLimiter(READERS)
        self.one: WeakValueDictionary[str, Lock] = WeakValueDictionary()

    @asynccontextmanager
    async def turn(self, caller: str = "") -> AsyncIterator[None]:
        """Wait until a process is free, and a named caller's turn before has ended.

        Raises
        ------
        Busy
            if too many wait
        """
        if self.present >= READERS + self.waiting:
            waiting = f"{self.waiting} requests to read a {self.field} wait already"
            raise Busy(f"{waiting}: ask later")
        own = self.one.setdefault(caller, Lock()) if caller else Lock()
        self.present += 1
        try:
            async with own, self.readers:
                yield
        finally:
            self.present -= 1

    async def call(
        self, function: Callable[..., Found], *given: object, name: object, advice: str = ""
    ) -> Found:
        """Return ``function(*given)``, called during a `turn`; all of it must be picklable.

        Parameters
        ----------
        name, advice : value and advice in the error if a limit is exceeded

        Raises
        ------
        Beyond
            if time or memory did not suffice; errors of the function are raised too
        Busy
            if the process was killed
        """
        try:
            with fail_after(self.seconds):
                answer = await run_sync(_limited, function, *given, cancellable=True)
            found, error = pickle.loads(answer)
            if error is not None:
                raise error
            return cast("Found", found)
        except BrokenWorkerProcess:
            raise Busy(f"the process that reads a {self.field} has ended: ask again") from None
        except (TimeoutError, MemoryError):
            raise beyond(self.field, name, self.seconds, advice) from None


def beyond(field: str, name: object, seconds: float, advice: str = "") -> Beyond:
    """Return the error for what takes more than this time, or more memory than is allowed."""
    allowed = f"must be read within {seconds:g} s and {BYTES / 2**30:.3g} GiB of memory"
    return Beyond(field, name, allowed + advice)


def _limited(function: Callable[..., object], *given: object) -> bytes:
    """Return what a function returns, and None, or None and the error that it raises, as a pickle.

    An error is pickled by its own rule. That of `tblib`, which Dask sets for all errors, adds what
    the error came from; in the errors of pydantic that has no end.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is the service's to handle
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    answer: tuple[object, Exception | None]
    try:
        answer = function(*given), None
    except Exception as error:
        answer = None, error
    out = BytesIO()
    pickler = pickle.Pickler(out)
    pickler.dispatch_table = {
        kind: rule
        for kind, rule in copyreg.dispatch_table.items()
        if not issubclass(kind, BaseException)
    }
    pickler.dump(answer)
    return out.getvalue()


class Budget:
    """Processor time that each caller has: some seconds at once, and again within a minute.

    Parameters
    ----------
    seconds : the budget of a caller [s]
    """

    def __init__(self, seconds: float) -> None:
        self.seconds, self.least = seconds, min(1.0, seconds / 2)
        self.even: dict[str, float] = {}

    def left(self, caller: str) -> float:
        """Return what a caller has left [s]; raise `Busy` if that is nearly nothing."""
        whole = max(self.even.get(caller, 0.0) - time.monotonic(), 0.0)
        left = self.seconds * (1.0 - whole / MINUTE)
        if left < self.least:
            used = f"{self.seconds:g} s of processor time in a minute are used"
            raise Busy(f"{used}: ask later", ceil((self.least - left) / self.seconds * MINUTE))
        return left

    def charge(self, caller: str, seconds: float) -> None:
        """Take time from the budget of a caller."""
        now = time.monotonic()
        self.even = {name: at for name, at in self.even.items() if at > now}
        self.even[caller] = self.even.get(caller, now) + seconds / self.seconds * MINUTE
