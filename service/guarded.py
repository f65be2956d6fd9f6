"""Functions called in a process of its own, one after the other, with limits of time and memory.

To name every run of a large study takes seconds and memory; a mesh can be made so that reading it
takes either without end. Other requests are answered meanwhile, and the service lives on.
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
    field : what is read, as errors name it: ``study``, ``scene``
    waiting : calls that may wait
    seconds : time that a call may take
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
        """Return ``function(*given)`` in one's `turn`; all of it must be picklable.

        Parameters
        ----------
        name, advice : what an error of the limits names, and what it tells to do

        Raises
        ------
        StudyError
            where time or memory did not suffice; besides it what the function raises
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
