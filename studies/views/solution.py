"""The solution of a user's model as a data set."""

from __future__ import annotations

import numpy as np
import xarray as xr

from solver import Solution
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
