"""The numbers that ``accuracy`` set for parameters that a study leaves out."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from solver.errors import ModelError
from studies.definition.identity import solver_hash
from studies.definition.parameters import Parameter, completed, parameters_of, plain
from studies.errors import StudyError
from studies.scenes.registry import scene_of
from studies.views.columns import or_none, value_text
from studies.views.picking import sweep_axes, sweep_coordinates

BY_ACCURACY = "by accuracy"
"""What sets a parameter that is left out."""

_MOST = 500
"""Largest number of runs whose parameters are made: those of a scene file take a millisecond."""


def set_by_accuracy(dataset: xr.Dataset) -> dict[str, str]:
    """Return the number of each parameter that is left out as text, or its range over the runs.

    The text is empty where the number is not known: the data set is of another version of the
    solver, does not tell all parameters of its runs, as that of a search, or has too many runs.
    """
    given = json.loads(dataset.attrs.get("parameters", "{}"))
    names = [name for name, value in given.items() if value is None]
    if not names or "accuracy" not in {*given, *dataset.coords}:
        return {}
    found: dict[str, list[Any]] = {name: [] for name in names}
    if dataset.attrs.get("solver_source") == solver_hash() and dataset["status"].size <= _MOST:
        try:
            scene = scene_of(dataset.attrs)
            known = parameters_of(scene)
            if known.keys() <= {*given, *dataset.coords}:
                for own in _runs(dataset, given, known):
                    whole = completed(scene, own)
                    for name in names:
                        found[name].append(whole[name])
        except (StudyError, ModelError):  # a scene that is not here, or of another time
            found = {name: [] for name in names}
    return {name: _ranged(numbers) for name, numbers in found.items()}


def _runs(
    dataset: xr.Dataset, given: dict[str, Any], known: dict[str, Parameter]
) -> Iterator[dict[str, Any]]:
    """Yield the parameters of each run."""
    swept = {n: axis for n, axis in sweep_coordinates(dataset).items() if n in known}
    values = {
        name: [plain(or_none(each), known[name].default) for each in dataset[name].to_numpy()]
        for name in swept
    }
    for at in np.ndindex(dataset["status"].shape):
        place = dict(zip(sweep_axes(dataset), at, strict=True))
        yield given | {name: values[name][place[axis]] for name, axis in swept.items()}


def _ranged(numbers: list[Any]) -> str:
    texts = [value_text(each) for each in (min(numbers), max(numbers))] if numbers else []
    return " to ".join(dict.fromkeys(texts))
