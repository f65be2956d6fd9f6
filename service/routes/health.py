"""Whether the service can do its work."""

from __future__ import annotations

import tempfile
from http import HTTPStatus

from fastapi import APIRouter, Response

from service.dependencies import TheRunner, TheSettings
from service.schemas import Health

router = APIRouter(tags=["health"])


@router.get("/health", responses={503: {"model": Health}})
def health(settings: TheSettings, runner: TheRunner, response: Response) -> Health:
    """Tell whether studies can be stored and computed; 503 when they cannot."""
    try:
        with tempfile.TemporaryFile(dir=settings.data) as probe:
            probe.write(b"1")
        writable = True
    except OSError:
        writable = False
    ready = writable and runner.alive
    if not ready:
        response.status_code = HTTPStatus.SERVICE_UNAVAILABLE
    return Health(
        status="ready" if ready else "failing",
        data_writable=writable,
        executor_alive=runner.alive,
    )
