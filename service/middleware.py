"""What stands around all answers: security headers, the largest body, HEAD and OPTIONS.

FastAPI's own ``max_body_size`` answers in plain text when the length is declared; `body_limit`
raises where the body is read, so that the answer is a problem document.
"""

from __future__ import annotations

from collections.abc import Mapping
from http import HTTPStatus

from fastapi import Request
from fastapi.routing import iter_route_contexts
from starlette.datastructures import MutableHeaders
from starlette.exceptions import HTTPException
from starlette.routing import Match
from starlette.types import ASGIApp, Message, Receive, Scope, Send

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
