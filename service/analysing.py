"""What fits models to the runs of a study; called in processes apart, as `service.reading` is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from service.schemas import Prediction, PredictQuery
from studies.definition.study import Study
from studies.errors import StudyError
from studies.storage.store import Store
from studies.views.predict import answer
from studies.views.reading import open_netcdf
from studies.views.sensitivity import sensitivity
from studies.views.sensitivity import told as told_indices

MOST_FITTED = 1000
"""Largest number of runs to which a request may fit polynomials, which takes seconds."""


def predicted(
    path: Path, content: dict[str, Any], directory: Path, aside: Path | None, query: PredictQuery
) -> Prediction:
    """Return what `predict` tells; called in a process."""
    asked, store = query.model_dump(), Store(directory, aside=aside)
    at = {name: asked.pop(name) for name in query.model_extra or {}}
    study = Study.known(content, store.scene)
    with open_netcdf(path) as runs:
        found = answer(runs, study, store, at=at, **asked)
    add = None if found.enough else found.run.to_dict()
    told = {name: getattr(found, name) for name in Prediction.model_fields.keys() - {"add"}}
    return Prediction(**told, add=add)


def indices(path: Path, of: str) -> dict[str, Any]:
    """Return what `tell_sensitivity` tells; called in a process."""
    with open_netcdf(path) as runs:
        if (size := runs["status"].size) > MOST_FITTED:
            allowed = f"at most {MOST_FITTED} are fitted here: fetch the data set, and fit it there"
            raise StudyError("runs", size, allowed)
        return told_indices(sensitivity(runs, of))
