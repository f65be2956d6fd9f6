"""Refuse JSON objects with a name that occurs twice; Python's reader silently keeps the last."""

from __future__ import annotations

import json
from collections.abc import Callable, Coroutine
from typing import Any

from fastapi import Request, Response
from fastapi.routing import APIRoute

from studies import StudyError
from studies.toml import DEEPEST, depth


class StrictRequest(Request):
    """A request that refuses a JSON object with two members of one name."""

    async def json(self) -> Any:
        """Return the body, read as JSON."""
        content = json.loads(await self.body(), object_pairs_hook=_distinct)
        if (levels := depth(content)) > DEEPEST:
            allowed = f"must have lists and objects at most {DEEPEST} deep"
            raise StudyError("body", f"{levels} deep", allowed)
        return content


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
