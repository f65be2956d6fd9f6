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
    """Return a middleware that hands over no more than ``limit`` bytes of a body, declared or not.

    Paths of ``longest`` have limits of their own.

    How long the body may take is `service.connections`' concern.
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
