"""One run as labelled variables, with names, units and flags by the CF conventions."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from solver.parameters import is_number
from solver.results.quantities import IN_SPACE, QUANTITIES
from solver.results.record import Record
from solver.scenes import Scene
from studies.definition.cases import USUAL_AXES, Case
from studies.definition.parameters import completed, parameters_of
from studies.definition.vocabulary import ERROR, KEEP, LABEL_ATTRIBUTES, SYMMETRIC
from studies.storage import ugrid
from studies.storage.provenance import provenance

INTEGER_FILL = -1


class Variable(NamedTuple):
    """Values over named dimensions, with attributes."""

    dims: tuple[str, ...]
    values: np.ndarray
    attrs: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class RunContent:
    """The content of a run's file; ``xr.Dataset(content.variables, attrs=content.attrs)`` has it.

    A worker makes and writes it without xarray, which would take longer to load than a small run.
    """

    variables: Mapping[str, Variable]
    attrs: Mapping[str, Any]


def axis_attributes(scene: Scene, axis: str) -> dict[str, str]:
    """Return the CF attributes of a sweep axis, from the scene's own description."""
    known = parameters_of(scene)[axis]
    given = {"long_name": known.description, "units": known.unit}
    return {key: value for key, value in given.items() if value}


def axis_array(values: Sequence[Any]) -> np.ndarray:
    """Return numbers as numbers, None as NaN, and anything else as text."""
    values = [np.nan if value is None else value for value in values]
    if all(map(is_number, values)):
        return np.asarray(values)
    return np.array([v if isinstance(v, str) else json.dumps(v) for v in values], dtype=object)


def attributes_of(name: str, scene: Scene | None = None) -> dict[str, str]:
    """Return the CF attributes of a variable or coordinate; an unknown one gets its name as text.

    A ``scene`` may declare its own quantities.
    """
    usual = {"long_name": name.replace("_", " ")}
    if name in LABEL_ATTRIBUTES:
        return usual | dict(LABEL_ATTRIBUTES[name])
    own = {each.name: each for each in scene.quantities} if scene else {}
    quantity = own.get(name) or QUANTITIES.get(name) or IN_SPACE.get(name)
    return quantity.attributes if quantity else usual


def usual_dimensions(scene: Scene) -> tuple[str, ...]:
    """Return the sweep dimensions every run of the scene has."""
    known = parameters_of(scene)
    return tuple(name for name in USUAL_AXES if name in known)


def run_content(
    scene: Scene,
    case: Case,
    outcome: Record | str,
    keep: str = "",
    how: Mapping[str, Any] | None = None,
) -> RunContent:
    """Return the content of the file of a run: its record, or the reason why there is none.

    It does not depend on the study, except for ``keep``: with it a complete run has the fields at
    the nodes, and the state from which a longer one goes on. ``how`` are attributes that say how it
    was computed (`ran.how`).
    """
    sweep, attrs = usual_dimensions(scene), dict[str, Any]()
    record = None if isinstance(outcome, str) else outcome
    said = (record.status.name.lower(), record.message) if record else (ERROR, str(outcome))
    every: dict[str, tuple[Any, Any, Mapping[str, Any]]] = {
        name: (sweep, np.full((1,) * len(sweep), text, dtype=object), attributes_of(name))
        for name, text in zip(("status", "message"), said, strict=True)
    }
    for name in sweep:
        every[name] = name, [case.values[name]], axis_attributes(scene, name)
    if record:
        every |= _results(scene, record, sweep)
        attrs[SYMMETRIC] = int(record.symmetric)
        if keep and record.mesh is not None:
            every |= ugrid.variables(record.mesh()) | ugrid.states(record.state())
            attrs[KEEP] = keep
    title = f"{scene.name}: {scene.summary}"
    known = provenance(title, scene, completed(scene, case.values))
    return RunContent(
        {
            name: Variable((dims,) if isinstance(dims, str) else dims, np.asarray(values), words)
            for name, (dims, values, words) in every.items()
        },
        {**known, "id": case.id, **attrs, **(how or {})},
    )


def _results(
    scene: Scene, record: Record, sweep: tuple[str, ...]
) -> dict[str, tuple[Any, np.ndarray, Mapping[str, Any]]]:
    """Return coordinates, fields and numbers of a record."""
    ones = (1,) * len(sweep)
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
    return variables


def storage_of(variable: Variable) -> dict[str, Any]:
    """Return how netCDF stores a variable: compressed numbers, checksums, a value for absent ones.

    The entries are arguments of `netCDF4.Dataset.createVariable`.
    """
    kind = variable.values.dtype
    if kind.kind == "f":
        packed = {"zlib": True, "complevel": 1, "shuffle": True, "fletcher32": True}
        return {"datatype": kind, "fill_value": np.nan, **(packed if variable.dims else {})}
    if kind.kind == "i":
        whole = {"datatype": kind, "fill_value": np.int32(INTEGER_FILL)}
        return {**whole, "fletcher32": bool(variable.dims)}
    return {"datatype": str}


def summary(attributes: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the catalogue's entry of a run: identity, status, parameters and figures.

    Parameters
    ----------
    attributes : global attributes of the run's data set
    values : its variables that have one value
    """
    scalars = {
        name: _plain(value) for name, value in values.items() if name not in {"status", "message"}
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


def _scalar(name: str, number: float) -> np.ndarray:
    if name in QUANTITIES and QUANTITIES[name].count:
        return np.asarray(number if np.isfinite(number) else INTEGER_FILL, dtype=np.int32)
    return np.asarray(number, dtype=float)


def _plain(number: float) -> float | None:
    """Return a number as a JSON value: None for one that is absent. Counts are integers."""
    absent = number == INTEGER_FILL if isinstance(number, int) else not np.isfinite(number)
    return None if absent else number
