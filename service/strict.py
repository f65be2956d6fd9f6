"""Refuse JSON that is nested too deep, or has a name twice: Python's reader keeps the last."""

from __future__ import annotations

import json
from collections.abc import Callable, Coroutine
from typing import Any

from fastapi import Request, Response
from fastapi.routing import APIRoute

from studies.errors import StudyError
from studies.toml import check_depth


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
