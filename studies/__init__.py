"""Studies: a scene swept over parameters, computed in parallel, kept as labelled data.

``study.toml`` -> `Study` -> cases -> loading paths -> `run_study` -> `Store` -> `open_study`
"""

from __future__ import annotations

from solver.late import front

_HOMES = {
    "Access": "execution.access",
    "Bounds": "execution.estimate",
    "Case": "definition.cases",
    "CatalogueDamaged": "errors",
    "Client": "client",
    "diff": "views.differing",
    "Difference": "views.differing",
    "Estimate": "execution.estimate",
    "estimate": "execution.estimate",
    "FileDamaged": "errors",
    "fit": "kinds.fit.shown",
    "GridLost": "errors",
    "Limits": "execution.executor",
    "LoadingPath": "definition.cases",
    "open_netcdf": "views.reading",
    "open_study": "views.reading",
    "own_workers": "execution.workers",
    "predict": "views.predict",
    "run_study": "execution.run",
    "scene_schema": "definition.parameters",
    "sensitivity": "views.sensitivity",
    "Store": "storage.store",
    "StoreBusy": "errors",
    "StoreFull": "errors",
    "Study": "definition.study",
    "StudyError": "errors",
    "StudyEvent": "execution.run",
    "StudyOutcome": "execution.run",
    "summary": "views.tables",
    "sweep": "execution.function",
    "to_dataframe": "views.solution",
    "to_grid": "views.picking",
    "to_xarray": "views.solution",
}

__all__ = list(_HOMES)

# A public name is imported when it is first used.
__getattr__ = front(__name__, _HOMES)
