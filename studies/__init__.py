"""Studies: a scene swept over parameters, computed in parallel, kept as labelled data.

``study.toml`` -> `Study` -> cases -> loading paths -> `run_study` -> `Store` -> `open_study`
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.late import front
from studies.errors import (
    CatalogueDamaged,
    FileDamaged,
    GridLost,
    StoreBusy,
    StoreFull,
    StudyError,
)

if TYPE_CHECKING:
    from studies.client import Client
    from studies.definition.cases import Case, LoadingPath
    from studies.definition.parameters import scene_schema
    from studies.definition.study import Study
    from studies.execution.access import Access
    from studies.execution.estimate import Bounds, Estimate, estimate
    from studies.execution.function import sweep
    from studies.execution.limits import Limits
    from studies.execution.run import StudyEvent, StudyOutcome, run_study
    from studies.execution.workers import own_workers
    from studies.kinds.fit.shown import fit
    from studies.storage.store import Store
    from studies.views.differing import Difference, diff
    from studies.views.picking import to_grid
    from studies.views.predict import predict
    from studies.views.reading import open_netcdf, open_study
    from studies.views.sensitivity import sensitivity
    from studies.views.solution import to_xarray
    from studies.views.tables import summary

_HOMES = {
    "Access": "execution.access",
    "Case": "definition.cases",
    "Client": "client",
    "Limits": "execution.limits",
    "Bounds": "execution.estimate",
    "Difference": "views.differing",
    "Estimate": "execution.estimate",
    "LoadingPath": "definition.cases",
    "Store": "storage.store",
    "Study": "definition.study",
    "StudyEvent": "execution.run",
    "StudyOutcome": "execution.run",
    "diff": "views.differing",
    "estimate": "execution.estimate",
    "fit": "kinds.fit.shown",
    "open_netcdf": "views.reading",
    "open_study": "views.reading",
    "own_workers": "execution.workers",
    "predict": "views.predict",
    "run_study": "execution.run",
    "scene_schema": "definition.parameters",
    "sensitivity": "views.sensitivity",
    "summary": "views.tables",
    "sweep": "execution.function",
    "to_dataframe": "views.solution",
    "to_grid": "views.picking",
    "to_xarray": "views.solution",
}

__all__ = [
    "Access",
    "Bounds",
    "Case",
    "CatalogueDamaged",
    "Client",
    "Difference",
    "Estimate",
    "FileDamaged",
    "GridLost",
    "Limits",
    "LoadingPath",
    "Store",
    "StoreBusy",
    "StoreFull",
    "Study",
    "StudyError",
    "StudyEvent",
    "StudyOutcome",
    "diff",
    "estimate",
    "fit",
    "open_netcdf",
    "open_study",
    "own_workers",
    "predict",
    "run_study",
    "scene_schema",
    "sensitivity",
    "summary",
    "sweep",
    "to_dataframe",
    "to_grid",
    "to_xarray",
]

# A public name is imported when it is first used.
__getattr__ = front(__name__, _HOMES)
