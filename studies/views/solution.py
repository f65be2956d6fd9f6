"""The solution of a model of one's own as a data set."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from solver.results.nodal import nodal_fields
from solver.tensors import COMPONENTS

if TYPE_CHECKING:
    from solver import Solution

_DIMS = {
    "displacement": ("axis", "node"),
    "stress": ("component", "node"),
    "von_mises": ("node",),
    "plastic_strain": ("node",),
}
_UNITS = {"displacement": "mm", "stress": "MPa", "von_mises": "MPa", "plastic_strain": "1"}


def to_xarray(solution: Solution) -> xr.Dataset:
    """Return fields at all nodes over stages, with the body and the position of each node.

    Variables: ``displacement`` (stage, axis, node) [mm], ``stress`` (stage, component, node) [MPa],
    ``von_mises`` [MPa] and ``plastic_strain`` (stage, node).
    """
    names = list(solution.system.names)
    x, y = np.hstack([solution.nodes(name) for name in names])
    of = np.repeat(names, [solution.nodes(name).shape[1] for name in names])
    found = [
        [nodal_fields(solution.system, name, at) for name in names]
        for at in solution.stages.values()
    ]
    return xr.Dataset(
        {
            name: (
                ("stage", *own),
                np.stack([np.concatenate([b[name] for b in at], axis=-1) for at in found]),
                {"units": _UNITS[name]},
            )
            for name, own in _DIMS.items()
        },
        coords={
            "stage": list(solution.stages),
            "axis": ["x", "y"],
            "component": list(COMPONENTS),
            "body": ("node", of),
            "x": ("node", x, {"units": "mm"}),
            "y": ("node", y, {"units": "mm"}),
        },
    )
