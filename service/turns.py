"""Turns: what is read and computed for answers, fairly among callers, with limits.

A caller has one call at a time in each queue, and the callers take turns: one who asks a
hundred times waits for its own calls, and others wait for one of them. Each has a budget of
processor time.

What takes long is computed in processes, with limits of time and memory: a large study takes
seconds and memory to check, and a malicious mesh could take both without end. Meanwhile the service
answers other requests.
"""

from __future__ import annotations

import asyncio
import errno
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractAsyncContextManager, asynccontextmanager, contextmanager
from dataclasses import dataclass, replace
from math import ceil, inf
from pathlib import Path
from typing import Any, TypeVar, cast
from weakref import WeakValueDictionary

from anyio import CapacityLimiter, to_thread

from service import sandbox
from service.errors import Busy, TooMany
from service.processes import BEHIND
from service.sandbox import BYTES, Answer
from studies.errors import StudyError

READING, COMPUTING, COMBINING = 2, 2, 1
"""Slots of each queue. Combining has its own, so that no other answer waits for it."""

WAITING = 200
"""Number of calls of a caller that may wait."""

MINUTE = 60.0
"""Time after which a caller has its whole budget again [s]."""

SECONDS = 60.0
"""Longest time of a call in a process, unless it says another one [s]."""

Found = TypeVar("Found")


class Beyond(StudyError):
    """An input that takes more time or memory than is allowed."""


class Turns:
    """Slots that callers share.

    Parameters
    ----------
    slots : number of calls at a time
    seconds : processor time that a caller may take in a minute [s]; None where there is one caller,
        who has all slots and no limits
    """

    def __init__(self, slots: int, seconds: float | None = None) -> None:
        self.slots, self.seconds = CapacityLimiter(slots), seconds
        self.own: WeakValueDictionary[str, asyncio.Lock] = WeakValueDictionary()
        self.waiting = Counter[str]()
        self.refilled: dict[str, float] = {}
        """Time at which the budget of a caller is whole again [s]."""

    @asynccontextmanager
    async def turn(
        self, caller: str, patient: bool = False, begun: bool = False
    ) -> AsyncIterator[Turn]:
        """Give a caller its turn: those who wait are served in order, one call of each.

        What it takes is charged to the caller.

        Parameters
        ----------
        patient : wait for the budget, and do not refuse
        begun : the answer has begun: do not refuse either if many calls wait

        Raises
        ------
        TooMany
            if too many calls of the caller wait, or its budget is used
        """
        if not patient:
            self.remaining(caller)
        if self.seconds is not None and self.waiting[caller] >= WAITING and not begun:
            raise TooMany(f"{WAITING} of your requests wait already: ask later")
        self.waiting[caller] += 1
        own = asyncio.Lock()
        if self.seconds is not None:
            own = self.own.setdefault(caller, own)
        try:
            async with own:
                if patient:
                    await self._refilled(caller)
                async with self.slots:
                    remaining = inf if patient else self.remaining(caller)
                    turn = Turn(remaining, min(int(self.used(caller)), BEHIND))
                    try:
                        yield turn
                    finally:
                        self.charge(caller, turn.spent)
        finally:
            self.waiting[caller] -= 1
            self.waiting += Counter()  # forgets those that have none

    async def _refilled(self, caller: str) -> None:
        """Wait until a caller has processor time."""
        while True:
            try:
                self.remaining(caller)
            except TooMany as error:
                await asyncio.sleep(error.seconds)
            else:
                return

    def remaining(self, caller: str) -> float:
        """Return the processor time that a caller may still take [s]; raise `TooMany` without any.

        The budget refills steadily, in a minute from nothing.
        """
        if self.seconds is None:
            return inf
        remaining, least = self.seconds - self.used(caller), min(1.0, self.seconds / 2)
        if remaining < least:
            used = f"{self.seconds:g} s of processor time in a minute are used"
            later = ceil((least - remaining) / self.seconds * MINUTE)
            raise TooMany(f"{used}: ask later", later)
        return remaining

    def used(self, caller: str) -> float:
        """Return the processor time of its budget that a caller has used [s]; 0 without budgets."""
        until = max(self.refilled.get(caller, 0.0) - time.monotonic(), 0.0)
        return until / MINUTE * (self.seconds or 0.0)

    def charge(self, caller: str, seconds: float) -> None:
        """Take time from the budget of a caller."""
        if self.seconds is not None:
            now = time.monotonic()
            self.refilled = {name: at for name, at in self.refilled.items() if at > now}
            refilled = self.refilled.get(caller, now) + seconds / self.seconds * MINUTE
            self.refilled[caller] = min(refilled, now + 2 * MINUTE)


@dataclass(slots=True)
class Turn:
    """The turn of a caller.

    Attributes
    ----------
    remaining : processor time that the caller may take [s]
    nice : niceness of a process: who has used a second of a minute waits for who has not, and who
        has used five as studies do
    spent : processor time that the turn has taken [s]
    """

    remaining: float
    nice: int = 0
    spent: float = 0.0

    async def here(self, function: Callable[..., Found], *given: object) -> Found:
        """Return ``function(*given)``, called in a thread."""

        def timed() -> Found:
            begun = time.thread_time()
            try:
                return function(*given)
            finally:
                self.spent += time.thread_time() - begun

        return await to_thread.run_sync(timed, limiter=CapacityLimiter(1))

    async def apart(
        self,
        function: Callable[..., Found],
        *given: object,
        field: str,
        name: object,
        seconds: float = SECONDS,
        advice: str = "",
    ) -> Found:
        """Return ``function(*given)``, called in a process; all of it must be picklable.

        Parameters
        ----------
        field : the input that errors name: ``study``, ``scene``
        name, advice : value and advice in the error if a limit is exceeded
        seconds : longest time [s]

        Raises
        ------
        Beyond
            if time or memory did not suffice; errors of the function are raised too
        Busy
            if the process was killed, or waited for the processors for most of the time
        """
        with self._refused(field, name, seconds, advice):
            found, failed, spent = await sandbox.call(
                function, *given, seconds=seconds, nice=self.nice
            )
        self.spent += spent
        if isinstance(failed, MemoryError):
            raise beyond(field, name, None, advice)
        if failed is not None:
            raise failed
        return cast("Found", found)

    async def shut_in(
        self, function: Callable[..., str], *given: object, folder: Path, cpu: float, seconds: float
    ) -> Answer:
        """Return what `sandbox.call_shut_in` does; errors as of `apart`, for a scene."""
        begun = time.monotonic()
        with self._refused("scene", "scene.toml", seconds):
            answer = await sandbox.call_shut_in(
                function, *given, folder=folder, cpu=cpu, seconds=seconds, nice=self.nice
            )
        self.spent += cpu if answer.failed == errno.ETIME else time.monotonic() - begun
        return answer

    @contextmanager
    def _refused(
        self, field: str, name: object, seconds: float, advice: str = ""
    ) -> Iterator[None]:
        """Charge a call without an answer its time, and raise what it is told."""
        begun = time.monotonic()
        try:
            yield
        except BaseException as error:  # without an answer nobody knows
            self.spent += time.monotonic() - begun
            if isinstance(error, sandbox.Ended):
                raise Busy(f"the process that reads a {field} has ended: ask again") from None
            if isinstance(error, sandbox.Overdue):
                if error.used < seconds / 2:
                    had = f"{error.used:.2g} s of processor time in {seconds:g} s"
                    raise Busy(f"the process that reads a {field} had {had}: ask again") from None
                raise beyond(field, name, seconds, advice) from None
            raise


@dataclass(frozen=True, slots=True)
class Share:
    """What a caller has of the slots.

    Attributes
    ----------
    turns, caller : the slots, and whose share it is
    patient, begun : as of `Turns.turn`
    """

    turns: Turns
    caller: str
    patient: bool = False
    begun: bool = False

    def turn(self) -> AbstractAsyncContextManager[Turn]:
        """Give the caller its turn."""
        return self.turns.turn(self.caller, self.patient, self.begun)

    async def here(self, function: Callable[..., Found], *given: object) -> Found:
        """Return what `Turn.here` does, in the caller's turn."""
        async with self.turn() as turn:
            return await turn.here(function, *given)

    async def each(self, pieces: Iterator[Found]) -> AsyncIterator[Found]:
        """Yield the pieces of an answer that has begun, each made in a turn."""
        share = replace(self, patient=True, begun=True)
        while (piece := await share.here(next, pieces, None)) is not None:
            yield piece

    async def read(self, function: Callable[..., Found], *given: object) -> Found:
        """Return what a function returns that opens a file, called in a process."""
        return await self.apart(function, *given, field="file", name=self.caller)

    async def apart(self, function: Callable[..., Found], *given: object, **limits: Any) -> Found:
        """Return what `Turn.apart` does, in the caller's turn."""
        async with self.turn() as turn:
            return await turn.apart(function, *given, **limits)


def beyond(field: str, name: object, seconds: float | None, advice: str = "") -> Beyond:
    """Return the error for what takes more than this time; None: more memory than is allowed."""
    limit = f"within {seconds:g} s" if seconds else f"with {BYTES / 2**30:.3g} GiB of memory"
    return Beyond(field, name, f"must be read {limit}{advice}")
