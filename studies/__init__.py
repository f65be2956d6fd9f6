"""Studies: a scene swept over parameters, computed in parallel, kept as labelled data.

``study.toml`` -> `Study` -> cases -> paths -> `run_study` -> `Store` -> `open_study`
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from studies.errors import GridLost, StoreBusy, StudyError

if TYPE_CHECKING:
    from studies.design import Case, Path
    from studies.parameters import scene_schema
    from studies.reading import open_netcdf, open_study
    from studies.run import StudyEvent, StudyOutcome, run_study
    from studies.store import Store
    from studies.study import Study

_HOMES = {
    "Case": "design",
    "Path": "design",
    "Store": "store",
    "Study": "study",
    "StudyEvent": "run",
    "StudyOutcome": "run",
    "open_netcdf": "reading",
    "open_study": "reading",
    "run_study": "run",
    "scene_schema": "parameters",
}

__all__ = [
    "Case",
    "GridLost",
    "Path",
    "Store",
    "StoreBusy",
    "Study",
    "StudyError",
    "StudyEvent",
    "StudyOutcome",
    "open_netcdf",
    "open_study",
    "run_study",
    "scene_schema",
]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used: reading a study file needs no xarray."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"studies.{_HOMES[name]}"), name)
