"""Pictures of runs and studies as PNG, each drawn in a process and kept."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from starlette.requests import Request
from starlette.responses import Response

import solver
from service.files import UNCHANGED, tagged, unchanged
from service.schemas import LineQuery, MapQuery, PlotQuery, SketchQuery
from service.turns import Share
from solver.errors import ModelError
from solver.scenes import Scene
from studies import StudyError
from studies.storage.runfile import verify
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
        self.memory, self.size = memory, 0
        self.kept: OrderedDict[str, bytes] = OrderedDict()

    async def get(
        self, tag: str, share: Share, draw: Callable[..., bytes], *given: object, name: object
    ) -> bytes:
        """Return the picture with this tag, drawn in the turn of a caller unless it is kept."""
        picture = self._kept(tag)
        if picture is None:
            async with share.turn() as turn:
                picture = self._kept(tag)  # it may have been drawn meanwhile
                if picture is None:
                    picture = await turn.apart(draw, *given, field="picture", name=name)
                    self._keep(tag, picture)
        return picture

    def _kept(self, tag: str) -> bytes | None:
        if tag in self.kept:
            self.kept.move_to_end(tag)
        return self.kept.get(tag)

    def _keep(self, tag: str, picture: bytes) -> None:
        self.size += len(picture) - len(self.kept.get(tag, b""))
        self.kept[tag] = picture
        while self.size > self.memory:
            self.size -= len(self.kept.popitem(last=False)[1])

    async def answer(
        self,
        request: Request,
        what: object,
        share: Share,
        draw: Callable[..., bytes],
        *given: object,
        name: object,
    ) -> Response:
        """Return the answer with the picture of ``what``, unless the caller has it.

        Parameters
        ----------
        what : all that the picture depends on, but the version
        """
        headers = tagged((solver.__version__, what))
        if known := unchanged(request, headers):
            return known
        picture = await self.get(headers["etag"], share, draw, *given, name=name)
        return Response(picture, media_type=PNG, headers=dict(headers))

    async def of_file(
        self,
        request: Request,
        path: Path,
        query: Drawn,
        reading: Share,
        computing: Share,
        draw: Callable[[Path, Drawn], bytes],
    ) -> Response:
        """Return the answer with a picture of the file of a run or a study."""
        what = path.name, await reading.here(digest, path), query
        return await self.answer(request, what, computing, draw, path, query, name=path.stem)


def draw_map(path: Path, query: MapQuery) -> bytes:
    """Return a map of the run in ``path`` as PNG.

    Raises
    ------
    StudyError
        If the run has no such field, or the field no such component or stage.
    """
    from studies import open_netcdf
    from studies.views.plots.maps import map_figure  # matplotlib takes a second to import
    from studies.views.plots.sheets import png

    verify(path)
    with open_netcdf(path) as run:
        return png(map_figure(run, **query.model_dump(exclude={"resolution"})), query.resolution)


def draw_lines(path: Path, query: LineQuery) -> bytes:
    """Return lines of the run in ``path`` as PNG; raise `StudyError` as `picture` does."""
    from studies import open_netcdf
    from studies.views.plots.fields import check_field, line_fields
    from studies.views.plots.picture import picture
    from studies.views.plots.sheets import png

    verify(path)
    with open_netcdf(path) as run:
        check_field(query.field, line_fields(run))
        asked = query.model_dump(include={"field", "component", "zoom"})
        return png(picture(run, selection=query.selection, **asked), query.resolution)


def draw_study(path: Path, query: PlotQuery) -> bytes:
    """Return a field of the study in ``path`` as PNG; raise `StudyError` as `picture` does."""
    from studies import open_netcdf
    from studies.views.plots.picture import drawn_from, picture
    from studies.views.plots.sheets import png

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
    from studies.views.plots.setup import setup_figure
    from studies.views.plots.sheets import png

    try:
        figure = setup_figure(scene, values, query.zoom, query.window)
    except ModelError as error:
        raise StudyError(error.field, error.value, error.allowed) from None
    return png(figure, query.resolution)
