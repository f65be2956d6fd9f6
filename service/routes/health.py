"""Whether the service can do its work."""

from __future__ import annotations

import tempfile
from http import HTTPStatus
from pathlib import Path

from anyio import move_on_after
from anyio.to_thread import run_sync
from fastapi import APIRouter, Response

from service.dependencies import TheProbe, TheRunner, TheSettings
from service.schemas import Health

router = APIRouter(tags=["health"])

PROBE_SECONDS = 5.0
"""Time in which the data directory must answer."""


@router.get("/health", responses={503: {"model": Health}})
async def health(
    settings: TheSettings, runner: TheRunner, probe: TheProbe, response: Response
) -> Health:
    """Tell whether studies can be stored and computed; 503 when they cannot."""
    writable = False
    with move_on_after(PROBE_SECONDS):  # a file system that hangs would hold more than this up
        writable = await run_sync(look, settings.data, limiter=probe, abandon_on_cancel=True)
    ready = writable and runner.alive
    if not ready:
        response.status_code = HTTPStatus.SERVICE_UNAVAILABLE
    return Health(
        status="ready" if ready else "failing",
        data_writable=writable,
        executor_alive=runner.alive,
    )


def look(directory: Path) -> bool:
    """Tell whether a file can be written in a directory."""
    try:
        with tempfile.TemporaryFile(dir=directory) as probe:
            probe.write(b"1")
    except OSError:
        return False
    return True
