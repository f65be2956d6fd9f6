"""Check of the data directory, with a time limit."""

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
"""Time within which the check must end [s]."""


class Probe:
    """Checks the data directory; simultaneous requests share one check."""

    def __init__(self) -> None:
        self.limiter = CapacityLimiter(1)
        self.underway: asyncio.Task[tuple[bool, dict[str, str] | None]] | None = None

    async def check(self, directory: Path, jobs: Jobs) -> tuple[bool, dict[str, str] | None]:
        """Return the result of `check_directory`, or ``(False, None)`` if it takes too long."""
        if self.underway is None or self.underway.done():
            checking = run_sync(check_directory, directory, jobs, limiter=self.limiter)
            self.underway = asyncio.create_task(checking)
        with move_on_after(SECONDS):
            return await asyncio.shield(self.underway)
        return False, None


def check_directory(directory: Path, jobs: Jobs) -> tuple[bool, dict[str, str] | None]:
    """Return whether files can be written in a directory, and the waiting jobs by id.

    The second is None if the queue cannot be read.
    """
    writable, waiting = True, None
    try:
        with tempfile.TemporaryFile(dir=directory) as probe:
            probe.write(b"1")
    except OSError:
        writable = False
    with suppress(QueueLost, StoreFull, OSError):
        waiting = jobs.waiting()
    return writable, waiting
