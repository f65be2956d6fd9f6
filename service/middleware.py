"""What stands around all answers: security headers, the largest body, strict JSON, HEAD, OPTIONS.

FastAPI's own ``max_body_size`` answers in plain text when the length is declared; `body_limit`
raises where the body is read, so that the answer is a problem document.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Coroutine, Mapping
from http import HTTPStatus
from typing import Any

from fastapi import Request, Response
from fastapi.routing import APIRoute, iter_route_contexts
from starlette.datastructures import MutableHeaders
from starlette.exceptions import HTTPException
from starlette.routing import Match
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from studies.errors import StudyError
from studies.toml import check_depth

OURS_ALONE = "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
HEADERS = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-resource-policy": "same-origin",
    "content-security-policy": f"default-src 'none'; {OURS_ALONE}",
}
PAGE = (
    "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    f"{OURS_ALONE}"
)
"""Content security policy of the interactive documentation: only scripts of this service."""

CHARTS = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; connect-src 'self'; form-action 'self'; "
    "frame-ancestors 'none'; base-uri 'none'"
)
"""Content security policy of the pages under ``/ui``: charts set styles, forms are sent here."""


class SecurityHeaders:
    """Middleware that adds the headers to every answer that does not set them itself."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, and add the headers to the answer."""

        async def secured(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                if headers.get("content-type", "").startswith("text/html"):
                    headers.setdefault("content-security-policy", PAGE)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        await self.app(scope, receive, secured)


def body_limit(app: ASGIApp, limit: int, longest: Mapping[str, int]) -> ASGIApp:
    """Return a middleware that passes on at most ``limit`` bytes of a body, declared or not.

    Paths in ``longest`` have other limits. The time limit of a body is in `service.connections`.
    """

    async def answer(scope: Scope, receive: Receive, send: Send) -> None:
        received = 0
        path = scope.get("path", "").removeprefix(scope.get("root_path", "")).rstrip("/")
        most = longest.get(path, limit)

        async def counted() -> Message:
            nonlocal received
            message = await receive()
            received += len(message.get("body", b""))
            if received > most:
                raise HTTPException(
                    HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"the body is larger than {most} bytes"
                )
            return message

        await app(scope, counted if scope["type"] == "http" else receive, send)

    return answer


def head_is_get(app: ASGIApp) -> ASGIApp:
    """Return a middleware that answers HEAD as GET is answered, without the body.

    It must be outside of middleware that depends on the method, such as access control.
    """

    async def answer(scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["method"] != "HEAD":
            return await app(scope, receive, send)
        complete = False

        async def head_only(message: Message) -> None:
            nonlocal complete
            if message["type"] == "http.response.start":
                await send(message)
            elif not complete:  # from here on the application sees that the client has left
                complete = True
                await send({"type": "http.response.body"})

        scope["method"] = "GET"
        scope["headers"] = [each for each in scope["headers"] if each[0] != b"range"]  # of GET only
        try:
            await app(scope, receive, head_only)
        finally:
            scope["method"] = "HEAD"  # for outer middleware, which has the same scope

    return answer


def offered(request: Request, known: str) -> str:
    """Return all methods of a request's path for ``Allow``; ``known`` are those of one route."""
    methods = {"OPTIONS", *known.split(", ")}
    for route in iter_route_contexts(request.app.routes):
        if route.methods and route.matches(request.scope)[0] is not Match.NONE:
            methods |= route.methods
    if "GET" in methods:
        methods.add("HEAD")
    return ", ".join(sorted(methods))


class StrictRequest(Request):
    """A request that refuses such JSON."""

    async def json(self) -> Any:
        """Return the body, read as JSON."""
        body = await self.body()
        text = body.decode(json.detect_encoding(body), "surrogatepass")
        try:
            check_depth(text)
        except ValueError as error:
            raise StudyError(
                "body", f"{text[:50]}…", f"must not be nested so deep: {error}"
            ) from None
        return json.loads(text, object_pairs_hook=_distinct)


class StrictRoute(APIRoute):
    """A route whose handler gets a `StrictRequest`."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return the handler."""
        handle = super().get_route_handler()

        async def strict(request: Request) -> Response:
            return await handle(StrictRequest(request.scope, request.receive))

        return strict


def _distinct(members: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in members:
        if name in found:
            raise StudyError(name, value, "occurs twice in one JSON object: keep one")
        found[name] = value
    return found
