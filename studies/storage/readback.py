"""Read the file of a run back, and compare it with the record that was audited.

The audit checks the record in memory; this module checks the way from there to the file. The
required content follows from the record and from the declarations of its quantities, not from the
code that writes. h5py reads the file, which the netCDF library has written. A reader of netCDF
scales, shifts and masks values by attributes: attributes that no run needs are refused.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from solver.results.mesh_fields import NO_NODE, MeshFields
from solver.results.quantities import IN_SPACE, QUANTITIES
from solver.results.record import Record
from solver.scenes import Scene
from solver.tensors import AXES, components
from studies.definition.cases import Case
from studies.definition.parameters import build, parameters_of
from studies.definition.vocabulary import ERROR, KEEP, LABEL_ATTRIBUTES, SYMMETRIC
from studies.errors import FileDiffers
from studies.storage import dataset as layout
from studies.storage import runfile

_DECODED = ("scale_factor", "add_offset", "missing_value", "valid_min", "valid_max", "valid_range",
            "_Unsigned", "calendar", "dtype")  # fmt: skip
"""Attributes by which readers change values."""
_BARE = b"This is a netCDF dimension but not a netCDF variable"
"""Name that HDF5 has for a dimension without a coordinate."""


@dataclass(frozen=True, slots=True)
class _Required:
    """What a variable must be: its dimensions, values, and attributes; others are free."""

    dims: tuple[str, ...]
    values: np.ndarray
    attributes: Mapping[str, Any] = field(default_factory=dict)


def verified(path: Path, case: Case, outcome: Record | str, keep: str = "") -> dict[str, Any]:
    """Return the catalogue's row of a run from its file, if the file has the expected content.

    Parameters
    ----------
    path : path of the file, under any name
    outcome : the record of the run, or the reason why there is none
    keep : what is kept in addition to the results of the scene

    Raises
    ------
    FileDiffers
        if the file has any other content
    """
    sweep = layout.usual_dimensions(case.scene)
    expected = dict(_expected(case, outcome, sweep, keep))
    try:
        attributes, values, found = _read(path, expected)
        found += _of_the_whole(attributes, case, outcome, keep)
    except (OSError, RuntimeError, LookupError, TypeError, ValueError) as error:  # all of h5py
        reason = f"it cannot be read: {type(error).__name__}: {error}"
        raise FileDiffers(case.id, [reason]) from None
    if found:
        raise FileDiffers(case.id, sorted(found))
    single = {
        name: values[name].item()
        for name, each in expected.items()
        if each.dims == sweep and name not in sweep
    }
    return layout.summary(attributes, single)


def _read(
    path: Path, expected: Mapping[str, _Required]
) -> tuple[dict[str, Any], dict[str, np.ndarray], list[str]]:
    """Return the attributes of a file, the values of its variables, and the differences."""
    import h5py  # not needed by a complete study

    values: dict[str, np.ndarray] = {}
    with h5py.File(path, "r") as file:
        attributes = runfile.global_attributes(file)
        every = {name: file[name] for name in file}
        scales = {each.id: name for name, each in every.items() if each.is_scale}
        there = {name: each for name, each in every.items() if not _is_bare(each, scales)}
        found = [f"{name} is missing" for name in expected.keys() - there.keys()]
        found += [f"{name} is not expected" for name in there.keys() - expected.keys()]
        own = {name for name, each in expected.items() if not _of_mesh(name, each.dims)}
        if set(runfile.variables(file)) != own:
            found.append("the list of its variables differs")
        for name in there.keys() & expected.keys():
            values[name], wrong = _compared(name, there[name], expected[name], scales)
            found += wrong
    return attributes, values, found


def _expected(
    case: Case, outcome: Record | str, sweep: tuple[str, ...], keep: str
) -> Iterator[tuple[str, _Required]]:
    """Yield names of variables and their expected content."""
    known = parameters_of(case.scene)
    record = None if isinstance(outcome, str) else outcome
    parameters = record.parameters if record else case.parameters
    status, message = (
        (record.status.name.lower(), record.message) if record else (ERROR, str(outcome))
    )
    ones = (1,) * len(sweep)
    for name in sweep:
        words = {"long_name": known[name].description, "units": known[name].unit}
        attributes = {key: text or None for key, text in words.items()}
        yield name, _Required((name,), np.array([getattr(parameters, name)]), attributes)
    for name, text in (("status", status), ("message", message)):
        value = np.full(ones, text, dtype=object)
        yield name, _Required(sweep, value, LABEL_ATTRIBUTES[name])
    if record is None:
        return
    for name, labels in record.coordinates.items():
        yield name, _Required((name,), np.asarray(labels), _words(name, case.scene))
    for name, (dims, array) in record.fields.items():
        full = np.reshape(np.asarray(array, dtype=float), ones + np.shape(array))
        yield name, _Required((*sweep, *dims), full, _words(name, case.scene))
    for name, number in record.scalars.items():
        yield name, _Required(sweep, np.full(ones, number, dtype=float), _words(name, case.scene))
    if keep and record.mesh is not None:
        yield from _expected_mesh(record.mesh())
        for name, array in record.state().items():
            dims = tuple(f"mesh_state_{name}_{k}" for k in range(array.ndim))
            yield f"mesh_state_{name}", _Required(dims, array)


def _words(name: str, scene: Scene) -> dict[str, Any]:
    """Return the declared attributes of a quantity; an undeclared one gets its name."""
    own = (each for each in scene.quantities if each.name == name)
    declared = next(own, None) or QUANTITIES.get(name) or IN_SPACE.get(name)
    if declared is None:
        return {"long_name": name.replace("_", " "), "units": None}
    flags = list(declared.flags) if declared.flags else []
    return {
        "long_name": declared.long_name,
        "units": declared.units or None,
        "standard_name": declared.standard_name or None,
        "flag_values": [flag.value for flag in flags] or None,
        "flag_meanings": " ".join(flag.name.lower() for flag in flags) or None,
        **declared.beside,
    }


def _expected_mesh(fields: MeshFields) -> Iterator[tuple[str, _Required]]:
    """Yield the expected variables of the mesh; absent node numbers are NaN."""
    cells = [nodes for _, nodes in fields.bodies.values()]
    table = np.full((sum(map(len, cells)), max(c.shape[1] for c in cells)), np.nan)
    first = 0
    for nodes in cells:
        table[first : first + len(nodes), : nodes.shape[1]] = nodes
        first += len(nodes)
    faces, of = fields.faces
    numbers = np.arange(len(fields.bodies))
    of_cell = np.repeat(numbers, [len(c) for c in cells])
    flags = {
        "flag_values": numbers.tolist(),
        "flag_meanings": " ".join(name.replace(" ", "_") for name in fields.bodies),
    }
    elements = json.dumps({name: element for name, (element, _) in fields.bodies.items()})
    corners = np.where(faces == NO_NODE, np.nan, faces)
    yield "mesh", _Required((), np.zeros(()), {"face_node_connectivity": "mesh_face_nodes"})
    yield "mesh_face_nodes", _Required(("mesh_face", "mesh_corner"), corners, {"start_index": 0})
    yield "mesh_body", _Required(("mesh_face",), of, flags)
    yield "mesh_cell_nodes", _Required(("mesh_cell", "mesh_cell_node"), table, {"start_index": 0})
    yield "mesh_cell_body", _Required(("mesh_cell",), of_cell, flags | {"elements": elements})
    yield "time", _Required(("time",), np.arange(len(fields.stages), dtype=float), {"units": None})
    stages = np.array(list(fields.stages), dtype=object)
    yield "mesh_stage", _Required(("time",), stages)
    for axis, x in zip(AXES, fields.X, strict=False):
        yield f"mesh_node_{axis}", _Required(("mesh_node",), x, {"units": "mm"})
    at = list(fields.stages.values())
    parts = {f"displacement_{a}": ("mm", [s["displacement"][k] for s in at])
             for k, a in enumerate(AXES[: len(at[0]["displacement"])])}  # fmt: skip
    tensors = {"stress": ("stress", "MPa"), "plastic_strain": ("plastic_tensor", "1"),
               "strain": ("strain", "1")}  # fmt: skip
    for k, c in enumerate(components(len(at[0]["stress"]))):
        parts |= {f"{own}_{c}": (unit, [s[name][k] for s in at])
                  for own, (name, unit) in tensors.items()}  # fmt: skip
    parts |= {"mises": ("MPa", [s["mises"] for s in at]),
              "plastic_strain": ("1", [s["plastic_strain"] for s in at])}  # fmt: skip
    for name, (units, values) in parts.items():
        yield f"mesh_{name}", _Required(("time", "mesh_node"), np.stack(values), {"units": units})


def _of_mesh(name: str, dims: tuple[str, ...]) -> bool:
    return name == "mesh" or any(d == "time" or d.startswith("mesh_") for d in dims)


def _of_the_whole(
    attributes: Mapping[str, Any], case: Case, outcome: Record | str, keep: str
) -> Iterator[str]:
    """Yield the differences in the attributes of the file."""
    record = None if isinstance(outcome, str) else outcome
    required = {
        "id": case.id,
        "scene": case.scene.name,
        SYMMETRIC: int(record.symmetric) if record else None,
        KEEP: keep if record and keep and record.mesh is not None else None,
    }
    for name, value in required.items():
        if plain(attributes.get(name)) != value:
            yield f"its attribute {name} is {plain(attributes.get(name))!r}, not {value!r}"
    parameters = build(case.scene, json.loads(attributes["parameters"]))
    if parameters != (record.parameters if record else case.parameters):
        yield "its parameters are not those of the run"


def _compared(
    name: str, variable: Any, expected: _Required, scales: Mapping[Any, str]
) -> tuple[np.ndarray, list[str]]:
    """Return the stored values of a variable, and its differences.

    Parameters
    ----------
    scales : names of the dimensions by their HDF5 object; reading a name takes ten times as long
    """
    found = []
    text = expected.values.dtype.kind in "OUS"
    stored = variable.asstr()[...] if variable.dtype.kind == "O" else variable[...]
    stored = np.asarray(stored)
    dims = (name,) if variable.id in scales else _dimensions(variable, scales)
    if dims != expected.dims:
        found.append(f"{name} has the dimensions {dims}, not {expected.dims}")
    words = variable.attrs  # made anew each time
    attributes = {key: plain(words[key]) for key in words if not internal(key)}
    for key, value in (dict.fromkeys(_DECODED) | {**expected.attributes}).items():
        if attributes.get(key) != plain(value):
            found.append(f"{name} has the {key} {attributes.get(key)!r}, not {value!r}")
    seen = stored
    if not text and stored.dtype.kind in "iu":
        seen = np.where(stored == attributes.get("_FillValue"), np.nan, stored)
    elif not text and not np.isnan(attributes.get("_FillValue", np.nan)):
        found.append(f"{name} has the fill value {attributes['_FillValue']}, not NaN")
    if not text and variable.dtype.kind == "f" and variable.dtype.itemsize < 8:
        found.append(f"{name} has numbers of {variable.dtype.itemsize} bytes, not 8")
    if seen.shape != expected.values.shape:
        found.append(f"{name} has the shape {seen.shape}, not {expected.values.shape}")
    elif not _same(seen, expected.values, text):
        found.append(f"{name} has other values")
    return stored, found


def _dimensions(variable: Any, scales: Mapping[Any, str]) -> tuple[str, ...]:
    """Return the names of the dimensions of a variable, each by its only scale."""
    from h5py import h5ds

    found: list[Any] = []
    for axis in range(variable.ndim):
        h5ds.iterate(variable.id, axis, found.append)
    return tuple(scales[each] for each in found)


def _same(seen: np.ndarray, expected: np.ndarray, text: bool) -> bool:
    if text:
        return bool((seen == expected).all())
    return seen.dtype.kind != "O" and np.array_equal(seen, expected, equal_nan=True)


def _is_bare(variable: Any, scales: Mapping[Any, str]) -> bool:
    """Whether a variable is only a dimension."""
    return variable.id in scales and variable.attrs.get("NAME", b"").startswith(_BARE)


def internal(attribute: str) -> bool:
    """Whether HDF5 or netCDF made an attribute for internal use."""
    return attribute.isupper() or attribute.startswith("_Netcdf4")


def plain(value: Any) -> Any:
    """Return the value of an attribute as a Python value; netCDF stores a number as an array."""
    if isinstance(value, bytes):
        return value.decode()
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    return value[0] if isinstance(value, list) and len(value) == 1 else value
