"""Pictures of runs, for answers."""

from __future__ import annotations

import hashlib
import io
import threading
from pathlib import Path

import solver
from service.schemas import MapQuery
from studies import open_netcdf

DRAWING = threading.Lock()
"""Matplotlib shares fonts and the text cache among figures: one is drawn at a time."""


def tag(path: Path, query: MapQuery) -> str:
    """Return an entity tag that changes with the run's file, the query and the version."""
    state = path.stat()
    content = f"{solver.__version__} {state.st_mtime_ns} {state.st_size} {query!r}"
    return f'"{hashlib.sha256(content.encode()).hexdigest()[:32]}"'


def draw(path: Path, query: MapQuery) -> bytes:
    """Return a field of the run in ``path`` as PNG.

    Raises
    ------
    StudyError
        If the run has no such field, or the field no such component.
    """
    from studies.views.plots.maps import map_figure  # matplotlib takes a second to import

    picture = io.BytesIO()
    with DRAWING, open_netcdf(path) as run:
        map_figure(run, **query.model_dump()).savefig(picture, format="png")
    return picture.getvalue()
