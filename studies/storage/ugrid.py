"""Fields at the nodes of a run in its netCDF file, by the UGRID conventions.

xugrid and ParaView's reader for UGRID open the file. ParaView needs a dimension ``time`` and faces
with three or four nodes: elements with nodes between their corners are divided into such faces, and
stages are the times. ``mesh_cell_nodes`` has the elements themselves.

https://ugrid-conventions.github.io/ugrid-conventions/, version 1.0.
"""

from __future__ import annotations

import json
from collections.abc import Hashable, Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.results.body_fields import BODY_FIELDS
from solver.results.mesh_fields import NO_NODE, MeshFields
from solver.tensors import AXES
from studies.definition.vocabulary import FIELDS, KEEP
from studies.errors import StudyError

if TYPE_CHECKING:
    import xarray as xr

_MESH = "mesh"
_TIME, _NODE, _FACE, _CELL = "time", "mesh_node", "mesh_face", "mesh_cell"


def variables(fields: MeshFields) -> dict[str, Any]:
    """Return the variables for a run's data set: dimensions, values, attributes."""
    (faces, of), axes = fields.faces, len(fields.X)
    every = list(fields.bodies.items())
    widest = max(cells.shape[1] for _, (_, cells) in every)
    cells = np.vstack([
        np.pad(c, ((0, 0), (0, widest - c.shape[1])), constant_values=NO_NODE)
        for _, (_, c) in every
    ])  # fmt: skip
    elements = {name: element for name, (element, _) in every}
    counts = [len(c) for _, (_, c) in every]
    flags = {
        "flag_values": np.arange(len(every), dtype=np.int32),
        "flag_meanings": " ".join(name.replace(" ", "_") for name in elements),
    }
    topology = {
        "cf_role": "mesh_topology",
        "topology_dimension": np.int32(2),
        "node_coordinates": " ".join(f"mesh_node_{a}" for a in AXES[:axes]),
        "face_node_connectivity": "mesh_face_nodes",
        "face_dimension": _FACE,
        "long_name": "faces through all nodes of the bodies",
    }
    corners = {
        "cf_role": "face_node_connectivity",
        "start_index": np.int32(0),
        "long_name": "nodes of a face, counterclockwise",
    }
    on_face = {"mesh": _MESH, "location": "face", "long_name": "body", **flags}
    on_cell = {"long_name": "body", **flags, "elements": json.dumps(elements)}
    out: dict[str, Any] = {
        _MESH: ((), np.int32(0), topology),
        "mesh_face_nodes": ((_FACE, "mesh_corner"), _whole(faces), corners),
        "mesh_body": (_FACE, _whole(of), on_face),
        "mesh_cell_nodes": (
            (_CELL, "mesh_cell_node"),
            _whole(cells),
            {"start_index": np.int32(0), "long_name": "nodes of an element: corners, mid-sides"},
        ),
        "mesh_cell_body": (_CELL, _whole(np.repeat(np.arange(len(every)), counts)), on_cell),
        _TIME: (
            _TIME,
            np.arange(len(fields.stages), dtype=float),
            {"long_name": "number of the stage"},
        ),
        "mesh_stage": (_TIME, np.array(list(fields.stages), dtype=object), {"long_name": "stage"}),
    }
    for axis, values in zip(AXES, fields.X, strict=False):
        words = {"long_name": f"position of the node along {axis}", "units": "mm"}
        out[f"mesh_node_{axis}"] = (_NODE, values, words)
    stages = [dict(fields.parts(stage)) for stage in fields.stages]
    units = {name: each.units for each in BODY_FIELDS.values() for name in each.numbers(axes)}
    for name in stages[0]:
        values = np.stack([at[name] for at in stages])
        words = {"long_name": name.replace("_", " "), "units": units[name]}
        out[f"mesh_{name}"] = ((_TIME, _NODE), values, words | {"mesh": _MESH, "location": "node"})
    return out


def owns(name: str, dims: Iterable[Hashable]) -> bool:
    """Whether a variable of a run's file belongs to the mesh: studies do not combine these."""
    return name == _MESH or not {_TIME, _NODE, _FACE, _CELL}.isdisjoint(dims)


def keeps(run: xr.Dataset) -> bool:
    """Whether the data set of a run has the fields at the nodes."""
    return run.attrs.get(KEEP) == FIELDS and _MESH in run.variables


def read(run: xr.Dataset) -> MeshFields:
    """Return the fields at the nodes from the data set of a run.

    Raises
    ------
    StudyError
        if it has none
    """
    if not keeps(run):
        allowed = 'keeps no fields: its study must say keep = "fields", and the run must succeed'
        raise StudyError("run", run.attrs.get("id", ""), allowed)
    cells, of = (_nodes(run[name]) for name in ("mesh_cell_nodes", "mesh_cell_body"))
    elements = json.loads(run["mesh_cell_body"].attrs["elements"])
    bodies = {}
    for number, (name, element) in enumerate(elements.items()):
        own = cells[of == number]
        bodies[name] = (element, own[:, (own != NO_NODE).all(axis=0)])
    axes = [a for a in AXES if f"{_MESH}_node_{a}" in run]
    stages = [
        {
            name: np.stack(values) if field.over else values[0]
            for name, field in BODY_FIELDS.items()
            for values in [[_at(run, number, k) for number in field.numbers(len(axes))]]
        }
        for k in range(run.sizes[_TIME])
    ]
    names = [str(name) for name in run["mesh_stage"].to_numpy()]
    X = np.stack([run[f"mesh_node_{a}"].to_numpy() for a in axes])
    return MeshFields(X=X, bodies=bodies, stages=dict(zip(names, stages, strict=True)))


def _whole(values: np.ndarray) -> np.ndarray:
    return values.astype(np.int32)


def _nodes(variable: xr.DataArray) -> np.ndarray:
    """Return node numbers; a reader has replaced absent ones by NaN."""
    return np.nan_to_num(variable.to_numpy(), nan=NO_NODE).astype(np.int64)


def _at(run: xr.Dataset, name: str, stage: int) -> np.ndarray:
    """Return values at the nodes (n,); NaN if an earlier version has not stored them."""
    if f"mesh_{name}" not in run:
        return np.full(run.sizes[_NODE], np.nan)
    return run[f"mesh_{name}"].isel({_TIME: stage}).to_numpy()
