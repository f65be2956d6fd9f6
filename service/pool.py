"""The process that owns store and workers while studies are computed.

Studies share its workers and its lock of the store. It gets its order, and starts both, with the
first study, and ends after some time without one.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from service import processes
from service.processes import Process, Starter
from service.settings import Settings
from solver.late import Late
from studies.definition.study import Study
from studies.errors import StoreBusy, StoreFull, StudyError
from studies.execution.access import Access
from studies.execution.estimate import memory_needed
from studies.execution.forks import LOADING_SECONDS, SHARED
from studies.storage.store import Store

OWN_WORKERS = Late("studies.execution.workers:own_workers")
"""What uses dask, which the service itself does not."""


class PoolAway(RuntimeError):
    """There is no pool, for the reason given; waiting may help."""


@dataclass(slots=True)
class Pool:
    """The service's side of the process."""

    settings: Settings
    starter: Starter
    _process: Process | None = None
    _access: Access | None = None
    _one: asyncio.Lock = field(default_factory=asyncio.Lock)

    async def access(self, study: dict[str, Any]) -> Access:
        """Return the access to the workers; the process is started if there is none.

        Parameters
        ----------
        study : the study that asks, as ``Study.to_dict`` gives it. By the memory that it needs
            fewer workers are started than there are cores, unless the settings tell how many

        Raises
        ------
        PoolAway
            If it cannot be started.
        """
        async with self._one:
            if self._process is None or self._process.returncode is not None:
                await self._end()
                self._access = await self._start(study)
            assert self._access is not None
            return self._access

    async def close(self) -> None:
        """End the process that has an order, if there is one."""
        async with self._one:
            await self._end()

    async def _end(self) -> None:
        if self._process is not None:
            await processes.end(self._process, self.settings.grace_seconds)
            self._process = None

    async def _start(self, study: dict[str, Any]) -> Access:
        order = {
            "study": study,
            "data": self.settings.data,
            "workers": self.settings.workers,
            "memory": self.settings.worker_memory,
            "access": self.settings.outside_access,
            "grace": self.settings.grace_seconds,
        }
        try:
            self._process = await self.starter.start("service.pool", order)
        except OSError as error:
            raise PoolAway(f"the workers cannot be started: {error.strerror}") from error
        said: dict[str, Any] = {}
        with contextlib.suppress(TimeoutError, ValueError):
            async with asyncio.timeout(LOADING_SECONDS):
                said = json.loads(await self._process.stdout.readline())
        if said.get("kind") == "access":
            return Access(**said["content"])
        await self._end()
        reason = said.get("content", {}).get("reason", "see the log of the service")
        raise PoolAway(f"the workers have not started: {reason}")


def main(order: Mapping[str, Any]) -> None:
    """Lock the store, and run the workers unless there is a scheduler, until the service stops."""
    outlet = processes.claim_stdout()
    if order["access"] is None:
        SHARED.prepare()  # as a fork of this process, which has one thread
    stop = processes.watch_stdin(order["grace"])
    try:
        with contextlib.ExitStack() as held:
            store = Store(order["data"])
            held.enter_context(store.writing(tidy=False))
            access = order["access"]
            if access is None:
                workers, need = order["workers"], 0
                if workers is None:
                    workers = os.cpu_count() or 1
                    with contextlib.suppress(StudyError):  # it will be refused
                        need = memory_needed(Study.known(order["study"], store.scene))
                own = OWN_WORKERS(workers, order["memory"], need)
                access = held.enter_context(own)
            outlet.send("access", asdict(access))
            stop.wait()
    except (StoreBusy, StoreFull, StudyError, RuntimeError) as error:
        outlet.send("away", {"reason": str(error)})
