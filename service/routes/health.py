"""Whether the service can do its work."""

from __future__ import annotations

from http import HTTPStatus
from typing import Literal

from fastapi import APIRouter, Response

from service.dependencies import TheCaller, TheJobs, TheProbe, TheRunner, TheSettings
from service.schemas import Health

router = APIRouter(tags=["health"])


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

    Without a key, where keys are required, the answer is the status alone.
    """
    writable, waiting = await probe.check(settings.data, jobs)
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
