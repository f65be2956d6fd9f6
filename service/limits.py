"""The largest body a request may have.

FastAPI's own ``max_body_size`` answers in plain text when the length is declared; this one
raises where the body is read, so that the answer is a problem document.
"""

from __future__ import annotations

from collections.abc import Mapping
from http import HTTPStatus

from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send


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
