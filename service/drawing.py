"""Pictures of runs, studies and scenes as PNG; called in processes apart, see `service.sandbox`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from service.schemas import LineQuery, MapQuery, PlotQuery, SketchQuery
from solver.errors import ModelError
from solver.scenes import Scene
from studies.definition.parameters import read_values
from studies.definition.study import Study
from studies.errors import StudyError
from studies.scenes.registry import scene_named
from studies.storage.runfile import verify
from studies.storage.store import Store
from studies.views.plots.fields import check_field, line_fields
from studies.views.plots.maps import map_figure
from studies.views.plots.picture import drawn_from, picture
from studies.views.plots.setup import setup_figure
from studies.views.plots.sheets import png
from studies.views.reading import open_netcdf


def draw_map(path: Path, query: MapQuery) -> bytes:
    """Return a map of the run in ``path`` as PNG."""
    verify(path)
    with open_netcdf(path) as run:
        return png(map_figure(run, **query.model_dump(exclude={"resolution"})), query.resolution)


def draw_lines(path: Path, query: LineQuery) -> bytes:
    """Return lines of the run in ``path`` as PNG; raise `StudyError` as `picture` does."""
    verify(path)
    with open_netcdf(path) as run:
        check_field(query.field, line_fields(run))
        asked = query.model_dump(include={"field", "component", "zoom"})
        return png(picture(run, selection=query.selection, **asked), query.resolution)


def draw_study(path: Path, query: PlotQuery) -> bytes:
    """Return a field of the study in ``path`` as PNG; raise `StudyError` as `picture` does."""
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
    try:
        figure = setup_figure(scene, values, query.zoom, query.window)
    except ModelError as error:
        raise StudyError(error.field, error.value, error.allowed) from None
    return png(figure, query.resolution)


def drawn(directory: Path, name: str, query: SketchQuery) -> bytes:
    """Return the picture of a scene of a store as PNG; called in a process.

    Its meshes may be those of a stranger, and its parameters are the caller's.
    """
    scene = Store(directory).scene(name) or scene_named(name)
    return draw_scene(scene, read_values(scene, query.selection), query)


def pictured(directory: Path, content: dict[str, Any]) -> bytes:
    """Return the scene of the first run of a study as PNG; called in a process."""
    first = next(iter(Study.known(content, Store(directory).scene).cases()))
    return draw_scene(first.scene, first.values, SketchQuery())
