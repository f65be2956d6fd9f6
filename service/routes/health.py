"""Whether the service can do its work."""

from __future__ import annotations

import tempfile
from http import HTTPStatus
from typing import Literal

from fastapi import APIRouter, Response

from service.dependencies import TheCaller, TheRunner, TheSettings
from service.schemas import Health

router = APIRouter(tags=["health"])


@router.get("/health", responses={503: {"model": Health}}, response_model_exclude_unset=True)
def health(
    settings: TheSettings, runner: TheRunner, caller: TheCaller, response: Response
) -> Health:
    """Tell whether studies can be stored and computed; 503 when they cannot.

    A caller without a key, where keys are asked, is told the status alone.
    """
    try:
        with tempfile.TemporaryFile(dir=settings.data) as probe:
            probe.write(b"1")
        writable = True
    except OSError:
        writable = False
    ready = writable and runner.alive
    if not ready:
        response.status_code = HTTPStatus.SERVICE_UNAVAILABLE
    status: Literal["ready", "failing"] = "ready" if ready else "failing"
    if caller is None:
        return Health(status=status)
    return Health(
        status=status,
        data_writable=writable,
        executor_alive=runner.alive,
    )
