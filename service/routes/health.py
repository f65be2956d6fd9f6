"""Whether the service can do its work."""

from __future__ import annotations

from http import HTTPStatus
from typing import Literal

from fastapi import APIRouter, Response

from service.dependencies import TheCaller, TheJobs, TheProbe, TheRunner, TheStore
from service.schemas import Health

router = APIRouter(tags=["health"])


WELL = ("data_writable", "queue_readable", "catalogue_readable", "executor_alive")


@router.get("/health", responses={503: {"model": Health}}, response_model_exclude_unset=True)
async def health(
    runner: TheRunner,
    jobs: TheJobs,
    store: TheStore,
    probe: TheProbe,
    caller: TheCaller,
    response: Response,
) -> Health:
    """Tell whether studies can be stored and computed; 503 when they cannot.

    Without a key, where keys are required, the answer is the status alone.
    """
    found = await probe.check(store, jobs) | {"executor_alive": runner.alive}
    well = {name: found.get(name, False) for name in WELL}
    status: Literal["ready", "waiting", "failing"] = "waiting" if found.get("waiting") else "ready"
    if not all(well.values()):
        response.status_code, status = HTTPStatus.SERVICE_UNAVAILABLE, "failing"
    if caller is None:
        return Health(status=status)
    return Health(status=status, waiting=found.get("waiting", {}), **well)
