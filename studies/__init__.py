"""Studies: a scene swept over parameters, computed in parallel, kept as labelled data.

``study.toml`` -> `Study` -> cases -> paths -> `run_study` -> `Store` -> `open_study`
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from studies.errors import GridLost, StoreBusy, StudyError

if TYPE_CHECKING:
    from studies.definition.design import Case, Path
    from studies.definition.parameters import scene_schema
    from studies.definition.study import Study
    from studies.execution.run import StudyEvent, StudyOutcome, run_study
    from studies.storage.store import Store
    from studies.views.reading import open_netcdf, open_study

_HOMES = {
    "Case": "definition.design",
    "Path": "definition.design",
    "Store": "storage.store",
    "Study": "definition.study",
    "StudyEvent": "execution.run",
    "StudyOutcome": "execution.run",
    "open_netcdf": "views.reading",
    "open_study": "views.reading",
    "run_study": "execution.run",
    "scene_schema": "definition.parameters",
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
