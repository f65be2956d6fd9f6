"""HTTP methods that follow from others: HEAD from GET, and OPTIONS from all."""

from __future__ import annotations

from fastapi import Request
from fastapi.routing import iter_route_contexts
from starlette.routing import Match
from starlette.types import ASGIApp, Message, Receive, Scope, Send


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
