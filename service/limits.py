"""The largest body a request may have.

FastAPI's own ``max_body_size`` answers in plain text when the length is declared; this one
raises where the body is read, so that the answer is a problem document.
"""

from __future__ import annotations

from http import HTTPStatus

from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send


class BodyLimit:
    """Middleware that refuses to hand over more than ``limit`` bytes of a body."""

    def __init__(self, app: ASGIApp, limit: int) -> None:
        self.app = app
        self.limit = limit

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Count the bytes of the body, declared or not, as the application reads it."""
        received = 0

        async def counted() -> Message:
            nonlocal received
            message = await receive()
            received += len(message.get("body", b""))
            if received > self.limit:
                raise HTTPException(
                    HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
                    f"the body is larger than {self.limit} bytes",
                )
            return message

        await self.app(scope, counted if scope["type"] == "http" else receive, send)
