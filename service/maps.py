"""Pictures of runs and studies as PNG, drawn one at a time."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Awaitable, Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from anyio import CapacityLimiter
from anyio.to_thread import run_sync
from fastapi.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

import solver
from service.errors import Busy
from service.files import UNCHANGED, tagged, unchanged
from service.schemas import LineQuery, MapQuery, PlotQuery, SketchQuery
from solver.errors import ModelError
from solver.scenes import Scene
from studies import StudyError
from studies.storage.runfile import verify
from studies.storage.seal import digest

WAITING = 200
"""Number of readings and pictures that may wait for their turn."""

PNG = "image/png"
PICTURE: dict[int | str, dict[str, Any]] = {200: {"content": {PNG: {}}}, **UNCHANGED}
"""What a route of a picture answers."""

Read = TypeVar("Read")
Drawn = TypeVar("Drawn")
Draw = Callable[[], Awaitable[bytes]]
"""Draws a picture."""


class Pictures:
    """Draws pictures, one at a time, and keeps the latest ones.

    Matplotlib shares fonts and the text cache among figures, so two cannot be drawn at once; and
    the netCDF library ends the process if two threads read files. So all reading is `alone`.
    Methods raise `Busy` if too many others wait.

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

    async def get(self, tag: str, draw: Draw) -> bytes:
        """Return the picture with this tag; it is drawn unless it is kept or being drawn."""
        if tag in self.kept:
            self.kept.move_to_end(tag)
            return self.kept[tag]
        if tag not in self.underway:
            if len(self.underway) > self.queue:
                raise Busy(f"{self.queue} pictures wait to be drawn already")
            self.underway[tag] = asyncio.ensure_future(self._kept(tag, draw))
        return await asyncio.shield(self.underway[tag])

    async def alone(self, read: Callable[..., Read], *arguments: Any) -> Read:
        """Return what ``read`` returns, called in a thread while no other one reads or draws."""
        if self.present > WAITING:
            raise Busy(f"{WAITING} readings of runs wait already")
        self.present += 1
        try:
            return await run_sync(read, *arguments, limiter=self.pencil)
        finally:
            self.present -= 1

    async def _kept(self, tag: str, draw: Draw) -> bytes:
        try:
            picture = await draw()
        finally:
            del self.underway[tag]
        self.kept[tag] = picture
        self.size += len(picture)
        while self.size > self.memory:
            self.size -= len(self.kept.popitem(last=False)[1])
        return picture

    async def answer(self, request: Request, what: object, draw: Draw) -> Response:
        """Return the answer with the picture of ``what``, unless the caller has it.

        Parameters
        ----------
        what : all that the picture depends on, but the version
        """
        headers = tagged((solver.__version__, what))
        if known := unchanged(request, headers):
            return known
        picture = await self.get(headers["etag"], draw)
        return Response(picture, media_type=PNG, headers=dict(headers))

    async def of_file(
        self, request: Request, path: Path, query: Drawn, draw: Callable[[Path, Drawn], bytes]
    ) -> Response:
        """Return the answer with a picture of the file of a run or a study, drawn `alone`."""
        what = path.name, await run_in_threadpool(digest, path), query
        return await self.answer(request, what, partial(self.alone, draw, path, query))


def draw_map(path: Path, query: MapQuery) -> bytes:
    """Return a map of the run in ``path`` as PNG.

    Raises
    ------
    StudyError
        If the run has no such field, or the field no such component or stage.
    """
    from studies import open_netcdf
    from studies.views.plots.maps import map_figure  # matplotlib takes a second to import
    from studies.views.plots.saved import png

    verify(path)
    with open_netcdf(path) as run:
        return png(map_figure(run, **query.model_dump(exclude={"resolution"})), query.resolution)


def draw_lines(path: Path, query: LineQuery) -> bytes:
    """Return lines of the run in ``path`` as PNG; raise `StudyError` as `picture` does."""
    from studies import open_netcdf
    from studies.views.plots.fields import check_field, line_fields
    from studies.views.plots.picture import picture
    from studies.views.plots.saved import png

    verify(path)
    with open_netcdf(path) as run:
        check_field(query.field, line_fields(run))
        asked = query.model_dump(include={"field", "component", "zoom"})
        return png(picture(run, selection=query.selection, **asked), query.resolution)


def draw_study(path: Path, query: PlotQuery) -> bytes:
    """Return a field of the study in ``path`` as PNG; raise `StudyError` as `picture` does."""
    from studies import open_netcdf
    from studies.views.kept import drawn_from
    from studies.views.plots.picture import picture
    from studies.views.plots.saved import png

    with (
        open_netcdf(path) as dataset,
        drawn_from(path, dataset, query.field, query.selection) as (found, left),
    ):
        asked = query.model_dump(include={"field", "component", "zoom", "window", "over"})
        return png(picture(found, selection=left, **asked), query.resolution)


def draw_scene(scene: Scene, values: Mapping[str, Any], query: SketchQuery) -> bytes:
    """Return a scene before loading as PNG, for these values of its parameters.

    Raises
    ------
    StudyError
        If a parameter or the part is refused, or the scene has nothing to draw.
    """
    from studies.views.plots.saved import png
    from studies.views.plots.setup import setup_figure

    try:
        figure = setup_figure(scene, values, query.zoom, query.window)
    except ModelError as error:
        raise StudyError(error.field, error.value, error.allowed) from None
    return png(figure, query.resolution)
