"""Fields at the nodes of a run in its netCDF file, by the UGRID conventions.

xugrid and ParaView's reader for UGRID open the file. ParaView needs a dimension ``time`` and faces
with three or four nodes: elements with nodes between their corners are divided into such faces, and
stages are the times. ``mesh_cell_nodes`` has the elements themselves.

https://ugrid-conventions.github.io/ugrid-conventions/, version 1.0.
"""

from __future__ import annotations

import json
from collections.abc import Hashable, Iterable, Mapping
from typing import Any

import numpy as np

from solver.results.body_fields import BODY_FIELDS
from solver.results.mesh_fields import NO_NODE, MeshFields
from solver.tensors import AXES

MESH = "mesh"
TIME, NODE, _FACE, _CELL = "time", "mesh_node", "mesh_face", "mesh_cell"
_STATE = "mesh_state_"


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
    on_face = {"mesh": MESH, "location": "face", "long_name": "body", **flags}
    on_cell = {"long_name": "body", **flags, "elements": json.dumps(elements)}
    out: dict[str, Any] = {
        MESH: ((), np.int32(0), topology),
        "mesh_face_nodes": ((_FACE, "mesh_corner"), _whole(faces), corners),
        "mesh_body": (_FACE, _whole(of), on_face),
        "mesh_cell_nodes": (
            (_CELL, "mesh_cell_node"),
            _whole(cells),
            {"start_index": np.int32(0), "long_name": "nodes of an element: corners, mid-sides"},
        ),
        "mesh_cell_body": (_CELL, _whole(np.repeat(np.arange(len(every)), counts)), on_cell),
        TIME: (
            TIME,
            np.arange(len(fields.stages), dtype=float),
            {"long_name": "number of the stage"},
        ),
        "mesh_stage": (TIME, np.array(list(fields.stages), dtype=object), {"long_name": "stage"}),
    }
    for axis, values in zip(AXES, fields.X, strict=False):
        words = {"long_name": f"position of the node along {axis}", "units": "mm"}
        out[f"mesh_node_{axis}"] = (NODE, values, words)
    stages = [dict(fields.parts(stage)) for stage in fields.stages]
    units = {name: each.units for each in BODY_FIELDS.values() for name in each.numbers(axes)}
    for name in stages[0]:
        values = np.stack([at[name] for at in stages])
        words = {"long_name": name.replace("_", " "), "units": units[name]}
        out[f"mesh_{name}"] = ((TIME, NODE), values, words | {"mesh": MESH, "location": "node"})
    return out


def states(arrays: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Return the variables of the state from which a longer run goes on, by name of array."""
    words = "state after the run, from which a longer one goes on"
    return {
        f"{_STATE}{name}": (
            tuple(f"{_STATE}{name}_{k}" for k in range(values.ndim)),
            values,
            {"long_name": f"{name}: {words}"},
        )
        for name, values in arrays.items()
    }


def state_of(run: Any) -> dict[str, np.ndarray]:
    """Return the arrays of the state that an open file of a run has; empty if it has none."""
    names = (name for name in run if name.startswith(_STATE) and not run[name].is_scale)
    return {name.removeprefix(_STATE): run[name][...] for name in names}


def owns(name: str, dims: Iterable[Hashable]) -> bool:
    """Whether a variable belongs to mesh or state of a run: studies do not combine these."""
    return name == MESH or any(d == TIME or str(d).startswith("mesh_") for d in dims)


def _whole(values: np.ndarray) -> np.ndarray:
    return values.astype(np.int32)
