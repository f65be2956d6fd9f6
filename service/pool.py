"""The process that owns store and workers while studies are computed: ``python -m service.pool``.

Studies share its workers and its lock of the store. It gets its order, and starts both, with the
first study, and ends after some time without one. Before its order it loads what workers need, so
that the first study does not wait for it.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import sys
from asyncio.subprocess import Process
from dataclasses import dataclass, field
from typing import Any, Self

from service import processes
from service.processes import Starter
from service.settings import Settings
from studies.errors import StoreBusy, StoreFull, StudyError

OWN = "own"
"""Argument of a process that will start workers of its own."""

START_SECONDS = 60.0
"""Longest time for the start of the workers [s]."""


class PoolAway(RuntimeError):
    """There is no pool, for the reason given; waiting may help."""


@dataclass(slots=True)
class Pool:
    """The service's side of the process.

    Attributes
    ----------
    settings : how many workers, or which scheduler
    starter : starts the process
    """

    settings: Settings
    starter: Starter
    _process: Process | None = None
    _access: dict[str, Any] = field(default_factory=dict)
    _one: asyncio.Lock = field(default_factory=asyncio.Lock)

    @classmethod
    def of(cls, settings: Settings, lock: int) -> Self:
        """Return the pool for these settings; the process inherits the directory's lock."""
        own = () if settings.outside_access else (OWN,)
        return cls(settings, Starter("service.pool", lock, own))

    async def prepare(self) -> None:
        """Start the process that the next study will need, unless there is one."""
        async with self._one:
            if self._process is None:
                await self.starter.prepare()

    async def access(self) -> dict[str, Any]:
        """Return the access to the workers; the process is started if there is none.

        Raises
        ------
        PoolAway
            If it cannot be started.
        """
        async with self._one:
            if self._process is None or self._process.returncode is not None:
                self._access = await self._start()
            return self._access

    async def close(self) -> None:
        """End the process that has an order, if there is one."""
        async with self._one:
            if self._process is not None:
                await processes.end(self._process, self.settings.grace_seconds)
                self._process = None

    async def _start(self) -> dict[str, Any]:
        order = {
            "data": str(self.settings.data.resolve()),
            "workers": self.settings.workers,
            "memory": self.settings.worker_memory,
            "access": self.settings.outside_access,
            "grace": self.settings.grace_seconds,
        }
        try:
            self._process = await self.starter.give(order)
        except OSError as error:
            raise PoolAway(f"the workers cannot be started: {error.strerror}") from error
        said: dict[str, Any] = {}
        with contextlib.suppress(TimeoutError, ValueError):
            async with asyncio.timeout(START_SECONDS):
                assert self._process.stdout is not None
                said = json.loads(await self._process.stdout.readline())
        if said.get("kind") == "access":
            return said["content"]
        await processes.end(self._process, self.settings.grace_seconds)
        reason = said.get("content", {}).get("reason", "see the log of the service")
        raise PoolAway(f"the workers have not started: {reason}")


def main() -> None:
    """Lock the store, and run the workers unless there is a scheduler, until the service stops."""
    from studies import Store
    from studies.execution.cluster import own_workers, prepare_workers

    outlet = processes.claim_stdout()
    if OWN in sys.argv:
        prepare_workers()
    order = processes.read_order()
    stop = processes.watch_stdin(order["grace"])
    try:
        with contextlib.ExitStack() as held:
            held.enter_context(Store(order["data"]).writing(tidy=False))
            access = order["access"]
            if access is None:
                own = own_workers(order["workers"] or os.cpu_count() or 1, order["memory"])
                access = held.enter_context(own).to_dict()
            outlet.send("access", access)
            stop.wait()
    except (StoreBusy, StoreFull, StudyError, RuntimeError) as error:
        outlet.send("away", {"reason": str(error)})


if __name__ == "__main__":
    main()
