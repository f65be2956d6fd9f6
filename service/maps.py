"""Pictures of runs and studies as PNG, each drawn in a process and kept."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from starlette.requests import Request
from starlette.responses import Response

import solver
from service.cache import Cache
from service.files import UNCHANGED, tagged, unchanged
from service.turns import Share
from studies.storage.seal import digest

PNG = "image/png"
PICTURE: dict[int | str, dict[str, Any]] = {200: {"content": {PNG: {}}}, **UNCHANGED}
"""What a route of a picture answers."""

Drawn = TypeVar("Drawn")


class Pictures:
    """Draws pictures, and keeps the latest ones.

    Parameters
    ----------
    memory : total size of the pictures that are kept [bytes]
    """

    def __init__(self, memory: int) -> None:
        self.kept = Cache[bytes](memory, len)

    async def get(
        self, tag: str, share: Share, draw: Callable[..., bytes], *given: object, name: object
    ) -> bytes:
        """Return the picture with this tag, drawn in the turn of a caller unless it is kept."""
        if (picture := self.kept.get(tag)) is not None:
            return picture
        async with share.turn() as turn:
            if (picture := self.kept.get(tag)) is not None:  # it was drawn meanwhile
                return picture
            drawn: bytes = await turn.apart(draw, *given, field="picture", name=name)
            return self.kept.put(tag, drawn)


@dataclass(frozen=True, slots=True)
class Drawing:
    """The pictures that a request asks for, in the turns of its caller."""

    pictures: Pictures
    request: Request
    reading: Share
    computing: Share

    async def answer(
        self, what: object, draw: Callable[..., bytes], *given: object, name: object
    ) -> Response:
        """Return the answer with the picture of ``what``, unless the caller has it.

        Parameters
        ----------
        what : all that the picture depends on, but the version
        """
        headers = tagged((solver.__version__, what))
        if known := unchanged(self.request, headers):
            return known
        picture = await self.pictures.get(headers["etag"], self.computing, draw, *given, name=name)
        return Response(picture, media_type=PNG, headers=dict(headers))

    async def of_file(
        self, path: Path, query: Drawn, draw: Callable[[Path, Drawn], bytes]
    ) -> Response:
        """Return the answer with a picture of the file of a run or a study."""
        what = path.name, await self.reading.here(digest, path), query
        return await self.answer(what, draw, path, query, name=path.stem)
