"""Pictures of runs, for answers."""

from __future__ import annotations

import hashlib
import io
import threading
from pathlib import Path

import xarray as xr

import solver
from service.errors import BadField
from service.schemas import MapQuery
from studies.store import ENGINE

DRAWING = threading.Lock()
"""Matplotlib shares fonts and the text cache among figures: one is drawn at a time."""

DOTS_PER_INCH = 150


def tag(path: Path, query: MapQuery) -> str:
    """Return an entity tag that changes with the run's file, the query and the version."""
    state = path.stat()
    content = f"{solver.__version__} {state.st_mtime_ns} {state.st_size} {query!r}"
    return f'"{hashlib.sha256(content.encode()).hexdigest()[:32]}"'


def draw(path: Path, query: MapQuery) -> bytes:
    """Return a field of the run in ``path`` as PNG.

    Raises
    ------
    BadField
        If the run has no such field, or the field no such component.
    """
    from studies.plots import map_figure  # matplotlib takes a second to import

    with xr.open_dataset(path, engine=ENGINE, cache=False) as run:
        check(run, query)
        with DRAWING:
            figure = map_figure(run.load(), field=query.field, component=query.component)
            picture = io.BytesIO()
            figure.savefig(picture, format="png", dpi=DOTS_PER_INCH)
    return picture.getvalue()


def check(run: xr.Dataset, query: MapQuery) -> None:
    """Raise a `BadField` unless ``run`` has what ``query`` asks for."""
    fields = [str(name) for name, field in run.data_vars.items() if {"x", "y"} <= set(field.dims)]
    if query.field not in fields:
        known = f"one of {', '.join(fields)}" if fields else "nothing: the run has no fields"
        raise BadField("field", query.field, known)
    if "component" in run[query.field].dims:
        components = [str(label) for label in run["component"].values]
        if query.component not in components:
            raise BadField("component", query.component, f"one of {', '.join(components)}")
    elif query.component is not None:
        raise BadField("component", query.component, f"left out: {query.field} has none")
