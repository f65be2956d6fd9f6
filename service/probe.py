"""Check of the data directory, with a time limit."""

from __future__ import annotations

import asyncio
import tempfile
from contextlib import suppress
from typing import Any

from anyio import CapacityLimiter, move_on_after
from anyio.to_thread import run_sync

from service.errors import QueueLost
from service.jobs import Jobs
from studies.errors import CatalogueDamaged, StoreBusy, StoreFull
from studies.storage.store import Store

SECONDS = 5.0
"""Time within which the check must end [s]."""


class Probe:
    """Checks the data directory; simultaneous requests share one check."""

    def __init__(self) -> None:
        self.limiter = CapacityLimiter(1)
        self.underway: asyncio.Task[dict[str, Any]] | None = None

    async def check(self, store: Store, jobs: Jobs) -> dict[str, Any]:
        """Return what `look` finds; nothing if that takes too long."""
        if self.underway is None or self.underway.done():
            looking = run_sync(look, store, jobs, limiter=self.limiter)
            self.underway = asyncio.create_task(looking)
        with move_on_after(SECONDS):
            return await asyncio.shield(self.underway)
        return {}


def look(store: Store, jobs: Jobs) -> dict[str, Any]:
    """Return how a data directory and its files are, as entries of `Health` that are not false."""
    found: dict[str, Any] = {}
    with suppress(OSError), tempfile.TemporaryFile(dir=store.directory) as probe:
        probe.write(b"1")
        probe.flush()  # a full disk is told here
        found["data_writable"] = True
    with suppress(QueueLost, StoreFull, OSError):
        found["waiting"] = jobs.waiting()
        found["queue_readable"] = not jobs.damaged
    with suppress(CatalogueDamaged, StoreBusy, StoreFull, OSError):
        store.catalogue.runs(limit=1)
        found["catalogue_readable"] = not store.catalogue.damaged
    return found
