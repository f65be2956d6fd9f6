"""The description of the service as a page that works without the internet."""

from __future__ import annotations

from fastapi import APIRouter
from fastapi.responses import HTMLResponse, Response
from starlette.staticfiles import StaticFiles

router = APIRouter(prefix="/docs", include_in_schema=False)

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


@router.get("")
async def page() -> HTMLResponse:
    """Return the page."""
    return HTMLResponse(PAGE)


@router.get("/start.js")
async def start() -> Response:
    """Return the script that starts it."""
    return Response(SCRIPT, media_type="text/javascript")
