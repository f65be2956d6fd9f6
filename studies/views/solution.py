"""The solution of a model as a data set, and paths of fatigue as a table."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from solver import Solution
from solver.fatigue import Paths
from solver.results.body_fields import BODY_FIELDS
from solver.tensors import AXES, components


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
