"""Whether the service can do its work."""

from __future__ import annotations

import tempfile
from contextlib import suppress
from http import HTTPStatus
from pathlib import Path
from typing import Literal

from anyio import move_on_after
from anyio.to_thread import run_sync
from fastapi import APIRouter, Response

from service.dependencies import TheCaller, TheJobs, TheProbe, TheRunner, TheSettings
from service.errors import QueueLost
from service.jobs import Jobs
from service.schemas import Health

router = APIRouter(tags=["health"])

PROBE_SECONDS = 5.0
"""Time in which the data directory must answer."""


@router.get("/health", responses={503: {"model": Health}}, response_model_exclude_unset=True)
async def health(
    settings: TheSettings,
    runner: TheRunner,
    jobs: TheJobs,
    probe: TheProbe,
    caller: TheCaller,
    response: Response,
) -> Health:
    """Tell whether studies can be stored and computed; 503 when they cannot.

    A caller without a key, where keys are asked, is told the status alone.
    """
    writable, waiting = False, None
    with move_on_after(PROBE_SECONDS):  # a file system that hangs would hold more than this up
        writable, waiting = await run_sync(
            look, settings.data, jobs, limiter=probe, abandon_on_cancel=True
        )
    ready = writable and waiting is not None and runner.alive
    if not ready:
        response.status_code = HTTPStatus.SERVICE_UNAVAILABLE
    status: Literal["ready", "waiting", "failing"] = "waiting" if waiting else "ready"
    if not ready:
        status = "failing"
    if caller is None:
        return Health(status=status)
    return Health(
        status=status,
        data_writable=writable,
        queue_readable=waiting is not None,
        executor_alive=runner.alive,
        waiting=waiting or {},
    )


def look(directory: Path, jobs: Jobs) -> tuple[bool, dict[str, str] | None]:
    """Return whether files can be written in a directory, and what waits, None if unreadable."""
    writable, waiting = True, None
    try:
        with tempfile.TemporaryFile(dir=directory) as probe:
            probe.write(b"1")
    except OSError:
        writable = False
    with suppress(QueueLost, OSError):
        waiting = jobs.waiting()
    return writable, waiting
