"""Pictures of runs as PNG, drawn one at a time."""

from __future__ import annotations

import asyncio
import hashlib
import io
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from anyio import CapacityLimiter
from anyio.to_thread import run_sync

import solver
from service.errors import Busy
from service.schemas import MapQuery
from studies.storage.runfile import verify
from studies.storage.seal import digest

WAITING = 200
"""Number of readings and pictures that may wait for their turn."""

Read = TypeVar("Read")


class Pictures:
    """Draws pictures, one at a time, and keeps the latest ones.

    Matplotlib shares fonts and the text cache among figures, so two cannot be drawn at once; and
    the netCDF library ends the process if two threads read files. So all reading is `alone`.

    Parameters
    ----------
    queue : number of pictures that may wait to be drawn
    memory : total size of the pictures that are kept [bytes]
    """

    def __init__(self, queue: int, memory: int) -> None:
        self.queue = queue
        self.memory = memory
        self.size = self.present = 0
        self.pencil = CapacityLimiter(1)
        self.kept: OrderedDict[str, bytes] = OrderedDict()
        self.underway: dict[str, asyncio.Task[bytes]] = {}

    async def get(self, tag: str, path: Path, query: MapQuery) -> bytes:
        """Return the picture with this tag; it is drawn unless it is kept or being drawn.

        Raises
        ------
        Busy
            If too many others wait.
        StudyError
            If the run has no such field, or the field no such component.
        """
        if tag in self.kept:
            self.kept.move_to_end(tag)
            return self.kept[tag]
        if tag not in self.underway:
            if len(self.underway) > self.queue:
                raise Busy(f"{self.queue} pictures wait to be drawn already")
            self.underway[tag] = asyncio.create_task(self._draw(tag, path, query))
        return await asyncio.shield(self.underway[tag])

    async def alone(self, read: Callable[..., Read], *arguments: Any) -> Read:
        """Return what ``read`` returns, called in a thread while no other one reads or draws.

        Raises
        ------
        Busy
            If too many others wait.
        """
        if self.present > WAITING:
            raise Busy(f"{WAITING} readings of runs wait already")
        self.present += 1
        try:
            return await run_sync(read, *arguments, limiter=self.pencil)
        finally:
            self.present -= 1

    async def _draw(self, tag: str, path: Path, query: MapQuery) -> bytes:
        try:
            picture = await self.alone(draw, path, query)
        finally:
            del self.underway[tag]
        self.kept[tag] = picture
        self.size += len(picture)
        while self.size > self.memory:
            self.size -= len(self.kept.popitem(last=False)[1])
        return picture


def tag(path: Path, query: MapQuery) -> str:
    """Return an entity tag that changes with the run's file, the query and the version."""
    content = f"{path.name} {solver.__version__} {digest(path)} {query!r}"
    return f'"{hashlib.sha256(content.encode()).hexdigest()[:32]}"'


def draw(path: Path, query: MapQuery) -> bytes:
    """Return a field of the run in ``path`` as PNG.

    Raises
    ------
    StudyError
        If the run has no such field, or the field no such component.
    """
    from studies import open_netcdf
    from studies.views.plots.maps import map_figure  # matplotlib takes a second to import

    picture = io.BytesIO()
    verify(path)
    with open_netcdf(path) as run:
        figure = map_figure(run, **query.model_dump(exclude={"resolution"}))
        figure.savefig(picture, format="png", dpi=query.resolution)
    return picture.getvalue()
