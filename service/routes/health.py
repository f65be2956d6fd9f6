"""Whether the service can do its work."""

from __future__ import annotations

import tempfile
from http import HTTPStatus

from fastapi import APIRouter, Response

from service.dependencies import TheJobs, TheRunner, TheSettings
from service.errors import QueueLost
from service.schemas import Health

router = APIRouter(tags=["health"])


@router.get("/health", responses={503: {"model": Health}})
def health(settings: TheSettings, runner: TheRunner, jobs: TheJobs, response: Response) -> Health:
    """Tell whether studies can be stored and computed; 503 when they cannot."""
    writable = readable = True
    try:
        with tempfile.TemporaryFile(dir=settings.data) as probe:
            probe.write(b"1")
    except OSError:
        writable = False
    waiting = {}
    try:
        waiting = jobs.waiting()
    except (QueueLost, OSError):
        readable = False
    ready = writable and readable and runner.alive
    if not ready:
        response.status_code = HTTPStatus.SERVICE_UNAVAILABLE
    return Health(
        status="failing" if not ready else "waiting" if waiting else "ready",
        data_writable=writable,
        queue_readable=readable,
        executor_alive=runner.alive,
        waiting=waiting,
    )
