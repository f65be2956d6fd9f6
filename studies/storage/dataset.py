"""One run as a labelled data set, with names, units and flags by the CF conventions."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.results.quantities import IN_SPACE, QUANTITIES
from solver.results.record import Record
from solver.scenes import Scene
from studies.definition.cases import USUAL_AXES, Case
from studies.definition.parameters import completed, parameters_of
from studies.definition.vocabulary import ERROR, KEEP, LABEL_ATTRIBUTES, SYMMETRIC
from studies.storage import ugrid
from studies.storage.provenance import provenance

if TYPE_CHECKING:
    import xarray as xr

INTEGER_FILL = -1


def axis_attributes(scene: Scene, axis: str) -> dict[str, str]:
    """Return the CF attributes of a sweep axis, from the scene's own description."""
    known = parameters_of(scene)[axis]
    given = {"long_name": known.description, "units": known.unit}
    return {key: value for key, value in given.items() if value}


def attributes_of(name: str, scene: Scene | None = None) -> dict[str, str]:
    """Return the CF attributes of a variable or coordinate; an unknown one gets its name as text.

    A ``scene`` may declare its own quantities.
    """
    own = {each.name: each for each in scene.quantities} if scene else {}
    quantity = QUANTITIES.get(name) or own.get(name) or IN_SPACE.get(name)
    known = quantity.attributes if quantity else {"long_name": name.replace("_", " ")}
    return known | dict(LABEL_ATTRIBUTES.get(name, {}))


def usual_dimensions(scene: Scene) -> tuple[str, ...]:
    """Return the sweep dimensions every run of the scene has."""
    known = parameters_of(scene)
    return tuple(name for name in USUAL_AXES if name in known)


def run_dataset(scene: Scene, case: Case, record: Record, keep: str = "") -> xr.Dataset:
    """Return the data set of a run.

    It does not depend on the study, except for ``keep``: with it a complete run has the fields at
    the nodes.
    """
    sweep = usual_dimensions(scene)
    ones = (1,) * len(sweep)
    status = record.status.name.lower()
    variables: dict[str, tuple[Any, np.ndarray, Mapping[str, Any]]] = {
        name: (name, np.asarray(labels), attributes_of(name))
        for name, labels in record.coordinates.items()
    }
    for name, (dimensions, values) in record.fields.items():
        if unnamed := set(dimensions) - set(record.coordinates):
            raise ValueError(f"{name} has dimensions without coordinates: {sorted(unnamed)}")
        array = np.asarray(values, dtype=float).reshape(*ones, *np.shape(values))
        variables[name] = (*sweep, *dimensions), array, attributes_of(name, scene)
    for name, number in record.scalars.items():
        variables[name] = sweep, _scalar(name, number).reshape(ones), attributes_of(name, scene)
    frame = _frame(scene, case, sweep, status, record.message)
    if keep and record.mesh is not None:
        variables |= ugrid.variables(record.mesh())
        frame = frame.assign_attrs({KEEP: keep})
    return frame.assign(variables).assign_attrs({SYMMETRIC: int(record.symmetric)})


def broken_dataset(scene: Scene, case: Case, message: str) -> xr.Dataset:
    """Return the data set of a run without a record: status and message only."""
    return _frame(scene, case, usual_dimensions(scene), ERROR, message)


def encoding(dataset: xr.Dataset) -> dict[str, dict[str, Any]]:
    """Return how to store each variable: compressed numbers, a fill value for counts."""
    packed = {"zlib": True, "complevel": 1, "shuffle": True}
    chosen: dict[str, dict[str, Any]] = {}
    for name, variable in dataset.variables.items():
        if variable.dtype.kind == "f":
            fill = {} if name in dataset.coords else {"_FillValue": np.nan}
            chosen[str(name)] = {**packed, **fill} if variable.ndim else fill
        elif variable.dtype.kind == "i":
            chosen[str(name)] = {"_FillValue": np.int32(INTEGER_FILL)}
    return chosen


def summary(attributes: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the catalogue's entry of a run: identity, status, parameters and figures.

    Parameters
    ----------
    attributes : global attributes of the run's data set
    values : its variables that have one value
    """
    scalars = {
        name: _plain(name, value)
        for name, value in values.items()
        if name not in {"status", "message"}
    }
    return {
        "id": attributes["id"],
        "scene": attributes["scene"],
        "status": values["status"],
        "message": values["message"],
        "parameters": json.loads(attributes["parameters"]),
        "scalars": scalars,
        "path": f"runs/{attributes['id']}.nc",
        "created": attributes["created"],
        "cpu_seconds": scalars.get("cpu_seconds"),
        "solver_source": attributes["solver_source"],
        KEEP: attributes.get(KEEP, ""),
    }


def _frame(
    scene: Scene, case: Case, sweep: tuple[str, ...], status: str, message: str
) -> xr.Dataset:
    """Return a data set without the results of the solver."""
    import xarray as xr  # takes half a second, and is needed only to make a data set

    ones = (1,) * len(sweep)
    outcome, text = (np.full(ones, each, dtype=object) for each in (status, message))
    title = f"{scene.name}: {scene.summary}"
    return xr.Dataset(
        {
            "status": (sweep, outcome, attributes_of("status")),
            "message": (sweep, text, attributes_of("message")),
        },
        coords={name: (name, [case.values[name]], axis_attributes(scene, name)) for name in sweep},
        attrs=provenance(title, scene, completed(scene, case.values)) | {"id": case.id},
    )


def _is_count(name: str) -> bool:
    return name in QUANTITIES and QUANTITIES[name].count


def _scalar(name: str, number: float) -> np.ndarray:
    if _is_count(name):
        return np.asarray(number if np.isfinite(number) else INTEGER_FILL, dtype=np.int32)
    return np.asarray(number, dtype=float)


def _plain(name: str, number: float) -> float | None:
    """Return a number as a JSON value: None for one that is absent."""
    absent = number == INTEGER_FILL if _is_count(name) else not np.isfinite(number)
    return None if absent else number
