"""A look at the data directory that holds nobody up."""

from __future__ import annotations

import asyncio
import tempfile
from contextlib import suppress
from pathlib import Path

from anyio import CapacityLimiter, move_on_after
from anyio.to_thread import run_sync

from service.errors import QueueLost
from service.jobs import Jobs
from studies.errors import StoreFull

SECONDS = 5.0
"""Time in which the data directory must answer."""


class Probe:
    """Looks at the data directory, once for all who ask meanwhile."""

    def __init__(self) -> None:
        self.limiter = CapacityLimiter(1)
        self.underway: asyncio.Task[tuple[bool, dict[str, str] | None]] | None = None

    async def look(self, directory: Path, jobs: Jobs) -> tuple[bool, dict[str, str] | None]:
        """Return what `look` does, or that nothing can be written or read when that takes long."""
        if self.underway is None or self.underway.done():
            looking = run_sync(look, directory, jobs, limiter=self.limiter)
            self.underway = asyncio.create_task(looking)
        with move_on_after(SECONDS):
            return await asyncio.shield(self.underway)
        return False, None


def look(directory: Path, jobs: Jobs) -> tuple[bool, dict[str, str] | None]:
    """Return whether files can be written in a directory, and what waits, None if unreadable."""
    writable, waiting = True, None
    try:
        with tempfile.TemporaryFile(dir=directory) as probe:
            probe.write(b"1")
    except OSError:
        writable = False
    with suppress(QueueLost, StoreFull, OSError):
        waiting = jobs.waiting()
    return writable, waiting
