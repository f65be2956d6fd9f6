"""The solution of a user's model as a data set; fields at the nodes from that of a run."""

from __future__ import annotations

import json

import numpy as np
import xarray as xr

from solver import Solution
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
