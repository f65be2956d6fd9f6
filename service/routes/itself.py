"""The service itself: whether it works, its metrics, its description without the internet."""

from __future__ import annotations

from http import HTTPStatus
from typing import Literal

from fastapi import APIRouter
from fastapi.responses import HTMLResponse, PlainTextResponse, Response
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest
from starlette.staticfiles import StaticFiles

from service.dependencies import (
    TheCaller,
    TheJobs,
    TheMetrics,
    TheProbe,
    TheRunner,
    TheStore,
    in_turn,
)
from service.schemas import Health

router = APIRouter(tags=["health"])
others = APIRouter()
"""What needs a key, where keys are required."""


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


@others.get("/metrics", tags=["metrics"], response_class=PlainTextResponse)
@in_turn
def metrics(figures: TheMetrics) -> Response:
    """Return metrics in the text format of Prometheus."""
    return Response(generate_latest(figures.registry), media_type=CONTENT_TYPE_LATEST)


ASSETS = StaticFiles(packages=[("fastapi_offline", "static")])
"""Swagger UI, to be mounted where the page is."""

# Links without a host or a first slash hold under every root path. No script stands in the page.
PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<title>Residua</title>
<link rel="icon" href="docs/favicon.png">
<link rel="stylesheet" href="docs/swagger-ui.css">
<div id="page"></div>
<script src="docs/swagger-ui-bundle.js"></script>
<script src="docs/start.js"></script>
</html>
"""
SCRIPT = 'SwaggerUIBundle({url: "openapi.json", dom_id: "#page", deepLinking: true});\n'


@others.get("/docs", include_in_schema=False)
async def page() -> HTMLResponse:
    """Return the page."""
    return HTMLResponse(PAGE)


@others.get("/docs/start.js", include_in_schema=False)
async def start() -> Response:
    """Return the script that starts it."""
    return Response(SCRIPT, media_type="text/javascript")
