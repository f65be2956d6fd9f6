"""The solution of a user's model as a data set."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from solver.tensors import AXES, components

if TYPE_CHECKING:
    from solver import Solution

_DIMS = {
    "displacement": ("axis", "node"),
    "stress": ("component", "node"),
    "mises": ("node",),
    "plastic_strain": ("node",),
}
_UNITS = {"displacement": "mm", "stress": "MPa", "mises": "MPa", "plastic_strain": "1"}


def to_xarray(solution: Solution) -> xr.Dataset:
    """Return fields at all nodes and stages, with the body and the position [mm] of each node.

    Variables: ``displacement`` (stage, axis, node) [mm], ``stress`` (stage, component, node) [MPa],
    ``mises`` (stage, node) [MPa] and ``plastic_strain`` (stage, node).
    """
    fields = solution.mesh_fields()
    axes = AXES[: len(fields.X)]
    names = list(fields.bodies)
    of = np.repeat(names, [solution.nodes(name).shape[1] for name in names])
    stages = fields.stages.values()
    return xr.Dataset(
        {
            name: (("stage", *own), np.stack([at[name] for at in stages]), {"units": _UNITS[name]})
            for name, own in _DIMS.items()
        },
        coords={
            "stage": list(fields.stages),
            "axis": list(axes),
            "component": list(components(2 * len(axes))),
            "body": ("node", of),
            **{a: ("node", x, {"units": "mm"}) for a, x in zip(axes, fields.X, strict=True)},
        },
    )
