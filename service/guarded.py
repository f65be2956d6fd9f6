"""Call functions in a separate process, one after the other, with limits of time and memory.

A large study takes seconds and memory to check, and a malicious mesh could take both without end.
Meanwhile the service answers other requests.
"""

from __future__ import annotations

import resource
import signal
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import TypeVar

from anyio import BrokenWorkerProcess, CapacityLimiter, fail_after
from anyio.to_process import run_sync

from service.errors import Busy
from studies import StudyError

BYTES = 8 * 2**30
"""Address space of the process."""

Found = TypeVar("Found")


class Guarded:
    """A queue of calls to such a process.

    Parameters
    ----------
    field : the input that errors name: ``study``, ``scene``
    waiting : number of calls that may wait
    seconds : longest time of a call
    """

    def __init__(self, field: str, waiting: int, seconds: float) -> None:
        self.field, self.waiting, self.seconds = field, waiting, seconds
        self.one = CapacityLimiter(1)

    @asynccontextmanager
    async def turn(self) -> AsyncIterator[None]:
        """Wait until no other call is carried out; raise `Busy` if too many wait."""
        if self.one.statistics().tasks_waiting >= self.waiting:
            waiting = f"{self.waiting} requests to read a {self.field} wait already"
            raise Busy(f"{waiting}: ask later")
        async with self.one:
            yield

    async def call(
        self, function: Callable[..., Found], *given: object, name: object, advice: str = ""
    ) -> Found:
        """Return ``function(*given)``, called during a `turn`; all of it must be picklable.

        Parameters
        ----------
        name, advice : value and advice in the error if a limit is exceeded

        Raises
        ------
        StudyError
            if time or memory did not suffice; errors of the function are raised too
        Busy
            if the process was killed
        """
        try:
            with fail_after(self.seconds):
                return await run_sync(_limited, function, *given, cancellable=True)
        except BrokenWorkerProcess:
            raise Busy(f"the process that reads a {self.field} has ended: ask again") from None
        except (TimeoutError, MemoryError):
            allowed = f"must be read within {self.seconds:g} s and {BYTES >> 30} GiB of memory"
            raise StudyError(self.field, name, allowed + advice) from None


def _limited(function: Callable[..., Found], *given: object) -> Found:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is the service's to handle
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    return function(*given)
