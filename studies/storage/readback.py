"""The file of a run, read back as its users read it, and compared with the record that was audited.

The audit judges the record in memory. This is the way from there to the file. What must be in it
follows from the record and from the declarations of its quantities, not from what the writer has
made of them; h5py reads the file, which netCDF's own library has written. A reader of netCDF
scales, shifts and masks values as attributes tell: attributes that no run needs are refused.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

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

if TYPE_CHECKING:
    import h5py

_DECODED = ("scale_factor", "add_offset", "missing_value", "valid_min", "valid_max", "valid_range",
            "_Unsigned", "calendar", "dtype")  # fmt: skip
"""Attributes by which readers change values."""
_BARE = b"This is a netCDF dimension but not a netCDF variable"
"""What HDF5 tells of a dimension that has no coordinate."""


@dataclass(frozen=True, slots=True)
class _Meant:
    """What a variable must be: its dimensions, values, and attributes; those not named are free."""

    dims: tuple[str, ...]
    values: np.ndarray
    attributes: Mapping[str, Any] = field(default_factory=dict)


def verified(path: Path, case: Case, outcome: Record | str, keep: str = "") -> dict[str, Any]:
    """Return the catalogue's row of a run, read from a file that says what it holds.

    Parameters
    ----------
    path : of the file, under whatever name
    outcome : the record of the run, or why there is none
    keep : what is kept beyond the results of the scene

    Raises
    ------
    FileDiffers
        when anything else is in the file
    """
    sweep = layout.usual_dimensions(case.scene)
    meant = dict(_meant(case, outcome, sweep, keep))
    try:
        attributes, values, found = _read(path, meant)
        found += _of_the_whole(attributes, case, outcome, keep)
    except (OSError, RuntimeError, LookupError, TypeError, ValueError) as error:  # all of h5py
        told = f"it cannot be read: {type(error).__name__}: {error}"
        raise FileDiffers(case.id, [told]) from None
    if found:
        raise FileDiffers(case.id, sorted(found))
    single = {name: values[name].item() for name in meant if meant[name].dims == sweep}
    return layout.summary(attributes, single)


def _read(
    path: Path, meant: Mapping[str, _Meant]
) -> tuple[dict[str, Any], dict[str, np.ndarray], list[str]]:
    """Return the attributes of a file, the values of its variables, and what is wrong."""
    import h5py  # a complete study does not wait for it

    values: dict[str, np.ndarray] = {}
    with h5py.File(path, "r") as file:
        attributes = runfile.global_attributes(file)
        every = {name: file[name] for name in file}
        scales = {each.id: name for name, each in every.items() if each.is_scale}
        there = {name: each for name, each in every.items() if not _is_bare(each, scales)}
        found = [f"{name} is missing" for name in meant.keys() - there.keys()]
        found += [f"{name} does not belong there" for name in there.keys() - meant.keys()]
        own = {name for name, each in meant.items() if not _of_mesh(name, each.dims)}
        if set(runfile.variables(file)) != own:
            found.append("the list of its variables is another one")
        for name in there.keys() & meant.keys():
            values[name], wrong = _compared(name, there[name], meant[name], scales)
            found += wrong
    return attributes, values, found


def _meant(
    case: Case, outcome: Record | str, sweep: tuple[str, ...], keep: str
) -> Iterator[tuple[str, _Meant]]:
    """Yield names and what they must be."""
    known = parameters_of(case.scene)
    record = None if isinstance(outcome, str) else outcome
    parameters = record.parameters if record else case.parameters
    status, message = (
        (record.status.name.lower(), record.message) if record else (ERROR, str(outcome))
    )
    ones = (1,) * len(sweep)
    for name in sweep:
        words = {"long_name": known[name].description, "units": known[name].unit}
        told = {key: text or None for key, text in words.items()}
        yield name, _Meant((name,), np.array([getattr(parameters, name)]), told)
    for name, text in (("status", status), ("message", message)):
        value = np.full(ones, text, dtype=object)
        yield name, _Meant(sweep, value, LABEL_ATTRIBUTES[name])
    if record is None:
        return
    for name, labels in record.coordinates.items():
        yield name, _Meant((name,), np.asarray(labels), _words(name, case.scene))
    for name, (dims, array) in record.fields.items():
        full = np.reshape(np.asarray(array, dtype=float), ones + np.shape(array))
        yield name, _Meant((*sweep, *dims), full, _words(name, case.scene))
    for name, number in record.scalars.items():
        yield name, _Meant(sweep, np.full(ones, number, dtype=float), _words(name, case.scene))
    if keep and record.mesh is not None:
        yield from _meant_mesh(record.mesh())


def _words(name: str, scene: Scene) -> dict[str, Any]:
    """Return the attributes of a quantity as it was declared; one that was not has its name."""
    own = (each for each in scene.quantities if each.name == name)
    declared = QUANTITIES.get(name) or next(own, None) or IN_SPACE.get(name)
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


def _meant_mesh(fields: MeshFields) -> Iterator[tuple[str, _Meant]]:
    """Yield the variables of the mesh; numbers of nodes that are absent are NaN."""
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
    yield "mesh", _Meant((), np.zeros(()), {"face_node_connectivity": "mesh_face_nodes"})
    yield "mesh_face_nodes", _Meant(("mesh_face", "mesh_corner"), corners, {"start_index": 0})
    yield "mesh_body", _Meant(("mesh_face",), of, flags)
    yield "mesh_cell_nodes", _Meant(("mesh_cell", "mesh_cell_node"), table, {"start_index": 0})
    yield "mesh_cell_body", _Meant(("mesh_cell",), of_cell, flags | {"elements": elements})
    yield "time", _Meant(("time",), np.arange(len(fields.stages), dtype=float), {"units": None})
    stages = np.array(list(fields.stages), dtype=object)
    yield "mesh_stage", _Meant(("time",), stages)
    for axis, x in zip(AXES, fields.X, strict=False):
        yield f"mesh_node_{axis}", _Meant(("mesh_node",), x, {"units": "mm"})
    at = list(fields.stages.values())
    parts = {f"displacement_{a}": ("mm", [s["displacement"][k] for s in at])
             for k, a in enumerate(AXES[: len(at[0]["displacement"])])}  # fmt: skip
    parts |= {f"stress_{c}": ("MPa", [s["stress"][k] for s in at])
              for k, c in enumerate(components(len(at[0]["stress"])))}  # fmt: skip
    parts |= {"mises": ("MPa", [s["mises"] for s in at]),
              "plastic_strain": ("1", [s["plastic_strain"] for s in at])}  # fmt: skip
    for name, (units, values) in parts.items():
        yield f"mesh_{name}", _Meant(("time", "mesh_node"), np.stack(values), {"units": units})


def _of_mesh(name: str, dims: tuple[str, ...]) -> bool:
    return name == "mesh" or any(d == "time" or d.startswith("mesh_") for d in dims)


def _of_the_whole(
    attributes: Mapping[str, Any], case: Case, outcome: Record | str, keep: str
) -> Iterator[str]:
    """Yield what is wrong with the attributes of the file."""
    record = None if isinstance(outcome, str) else outcome
    told = {
        "id": case.id,
        "scene": case.scene.name,
        SYMMETRIC: int(record.symmetric) if record else None,
        KEEP: keep if record and keep and record.mesh is not None else None,
    }
    for name, value in told.items():
        if _plain(attributes.get(name)) != value:
            yield f"its attribute {name} is {_plain(attributes.get(name))!r}, not {value!r}"
    parameters = build(case.scene, json.loads(attributes["parameters"]))
    if parameters != (record.parameters if record else case.parameters):
        yield "its parameters are not those of the run"


def _compared(
    name: str, variable: h5py.Dataset, meant: _Meant, scales: Mapping[Any, str]
) -> tuple[np.ndarray, list[str]]:
    """Return the values of a variable as they are stored, and what is wrong with it.

    Parameters
    ----------
    scales : names of the dimensions by their HDF5 object: to ask for a name takes ten times as long
    """
    found = []
    text = meant.values.dtype.kind in "OUS"
    stored = variable.asstr()[...] if variable.dtype.kind == "O" else variable[...]
    stored = np.asarray(stored)
    own = variable.id in scales
    dims = (name,) if own else tuple(scales[axis[0].id] for axis in variable.dims)
    if dims != meant.dims:
        found.append(f"{name} has the dimensions {dims}, not {meant.dims}")
    told = {key: _plain(variable.attrs[key]) for key in variable.attrs if not _internal(key)}
    for key, value in (dict.fromkeys(_DECODED) | {**meant.attributes}).items():
        if told.get(key) != _plain(value):
            found.append(f"{name} has the {key} {told.get(key)!r}, not {value!r}")
    seen = stored
    if not text and stored.dtype.kind in "iu":
        seen = np.where(stored == told.get("_FillValue"), np.nan, stored)
    elif not text and not np.isnan(told.get("_FillValue", np.nan)):
        found.append(f"{name} has the fill value {told['_FillValue']}, not NaN")
    if not text and variable.dtype.kind == "f" and variable.dtype.itemsize < 8:
        found.append(f"{name} has numbers of {variable.dtype.itemsize} bytes, not 8")
    if seen.shape != meant.values.shape:
        found.append(f"{name} has the shape {seen.shape}, not {meant.values.shape}")
    elif not _same(seen, meant.values, text):
        found.append(f"{name} has other values")
    return stored, found


def _same(seen: np.ndarray, meant: np.ndarray, text: bool) -> bool:
    if text:
        return bool((seen == meant).all())
    return seen.dtype.kind != "O" and np.array_equal(seen, meant, equal_nan=True)


def _is_bare(variable: h5py.Dataset, scales: Mapping[Any, str]) -> bool:
    """Tell whether it is a dimension only."""
    return variable.id in scales and variable.attrs.get("NAME", b"").startswith(_BARE)


def _internal(attribute: str) -> bool:
    """Tell whether HDF5 or netCDF has made an attribute for itself."""
    return attribute.isupper() or attribute.startswith("_Netcdf4")


def _plain(value: Any) -> Any:
    """Return the value of an attribute as Python has it; netCDF has a number as an array of one."""
    if isinstance(value, bytes):
        return value.decode()
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    return value[0] if isinstance(value, list) and len(value) == 1 else value
