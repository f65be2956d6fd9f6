"""Results as data: a solution and its fields at nodes as data sets, fatigue's paths as a table."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import xarray as xr

from solver import Solution
from solver.fatigue import Paths
from solver.results.body_fields import BODY_FIELDS
from solver.results.mesh_fields import NO_NODE, MeshFields
from solver.tensors import AXES, components
from studies.definition.vocabulary import FIELDS, KEEP
from studies.errors import StudyError
from studies.storage.ugrid import MESH, NODE, TIME


def to_xarray(solution: Solution) -> xr.Dataset:
    """Return fields at all nodes and stages, with the body and the position [mm] of each node.

    Variables: ``displacement`` (stage, axis, node) [mm], ``stress`` (stage, component, node) [MPa],
    ``mises`` (stage, node) [MPa], ``plastic_strain`` (stage, node), and over components too
    ``strain`` and ``plastic_tensor``.
    """
    fields = solution.mesh_fields()
    axes = AXES[: len(fields.X)]
    names = list(fields.bodies)
    of = np.repeat(names, [solution.nodes(name).shape[1] for name in names])
    stages = fields.stages.values()
    return xr.Dataset(
        {
            name: (
                ("stage", *filter(None, [field.over]), "node"),
                np.stack([at[name] for at in stages]),
                {"long_name": field.long_name, "units": field.units},
            )
            for name, field in BODY_FIELDS.items()
        },
        coords={
            "stage": list(fields.stages),
            "axis": list(axes),
            "component": list(components(2 * len(axes))),
            "body": ("node", of),
            **{a: ("node", x, {"units": "mm"}) for a, x in zip(axes, fields.X, strict=True)},
        },
    )


_PLACES = {"11": 0, "22": 1, "33": 2, "12": 3, "13": 5, "23": 4}
"""Components of a tensor in the order of pyLife, and of `Paths`."""


def to_dataframe(paths: Paths) -> Any:
    """Return paths as a table of pandas that pyLife reads: rows by ``load_step`` and ``node_id``.

    Columns are ``S11``, ``S22``, ``S33``, ``S12``, ``S13``, ``S23`` of stress [MPa], and ``E11`` to
    ``E23`` of strain, if it is known. A node is a point of the paths.
    """
    dims = ("load_step", "node_id")
    tensors = {"S": paths.stress, "E": paths.strain}
    columns = {
        f"{letter}{place}": (dims, tensor[..., k].T)
        for letter, tensor in tensors.items()
        if tensor is not None
        for place, k in _PLACES.items()
    }
    steps = {
        dim: np.arange(size) for dim, size in zip(dims, paths.stress.shape[1::-1], strict=True)
    }
    return xr.Dataset(columns, coords=steps).to_dataframe(dim_order=[*dims])


def keeps(run: xr.Dataset) -> bool:
    """Whether the data set of a run has the fields at the nodes."""
    return run.attrs.get(KEEP) == FIELDS and MESH in run.variables


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
    axes = [a for a in AXES if f"{MESH}_node_{a}" in run]
    stages = [
        {
            name: np.stack(values) if field.over else values[0]
            for name, field in BODY_FIELDS.items()
            for values in [[_at(run, number, k) for number in field.numbers(len(axes))]]
        }
        for k in range(run.sizes[TIME])
    ]
    names = [str(name) for name in run["mesh_stage"].to_numpy()]
    X = np.stack([run[f"mesh_node_{a}"].to_numpy() for a in axes])
    return MeshFields(X=X, bodies=bodies, stages=dict(zip(names, stages, strict=True)))


def _nodes(variable: xr.DataArray) -> np.ndarray:
    """Return node numbers; a reader has replaced absent ones by NaN."""
    return np.nan_to_num(variable.to_numpy(), nan=NO_NODE).astype(np.int64)


def _at(run: xr.Dataset, name: str, stage: int) -> np.ndarray:
    """Return values at the nodes (n,); NaN if an earlier version has not stored them."""
    if f"mesh_{name}" not in run:
        return np.full(run.sizes[NODE], np.nan)
    return run[f"mesh_{name}"].isel({TIME: stage}).to_numpy()
