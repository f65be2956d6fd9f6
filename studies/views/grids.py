"""Points that are a grid, as dimensions of a data set."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from studies.definition.points import POINT
from studies.errors import StudyError, one_of
from studies.storage.frame import SETS
from studies.toml import CASE


def point_axes(dataset: xr.Dataset) -> list[str]:
    """Return the axes of points of a data set: those that are numbers and set parameters."""
    return [
        str(name)
        for name in dataset["status"].dims
        if SETS in dataset[name].attrs and dataset[name].dtype.kind in "iu"
    ]


def parameters_over(dataset: xr.Dataset, axis: str) -> list[str]:
    """Return the parameters that an axis of labels or points sets, if they are not all equal."""
    names = str(dataset[axis].attrs.get(SETS, "")).split()
    given = [name for name in names if name != CASE and dataset[name].dims == (axis,)]
    return [name for name in given if len(np.unique(dataset[name])) > 1]


def to_grid(
    dataset: xr.Dataset, axis: str = POINT, parameters: Sequence[str] | None = None
) -> xr.Dataset:
    """Return a data set whose points are a grid, with a dimension for each of their parameters.

    Parameters
    ----------
    dataset : data set of a study
    axis : the axis of points
    parameters : the new dimensions; by default those that are not the same at all points

    Raises
    ------
    StudyError
        if there is no such axis, or a combination of values is missing or occurs twice
    """
    axes = point_axes(dataset)
    if axis not in axes:
        raise StudyError("axis", axis, one_of(axis, axes))
    varied = parameters_over(dataset, axis)
    names = varied if parameters is None else list(parameters)
    for name in names:
        if name not in varied:
            raise StudyError("parameters", name, one_of(name, varied))
    places = [np.unique(dataset[name], return_inverse=True) for name in names]
    shape = tuple(len(values) for values, _ in places)
    points, grid = dataset.sizes[axis], math.prod(shape)
    flat = np.ravel_multi_index([at for _, at in places], shape) if names else np.zeros(points, int)
    if points != grid or len(np.unique(flat)) != grid:
        sizes = " x ".join(f"{n} {name}" for n, name in zip(shape, names, strict=True)) or "1"
        allowed = f"are no grid: {len(np.unique(flat))} of its {grid} places ({sizes}) are taken"
        raise StudyError("points", f"{points} points", allowed)
    ordered = dataset.isel({axis: np.argsort(flat)}).drop_vars(axis)
    if not names:
        return ordered.squeeze(axis)
    index: dict[Any, list[str]] = {axis: names}
    found = ordered.set_index(index).unstack(axis)
    dims = [str(name) for name in dataset["status"].dims]
    at = dims.index(axis)
    for name in names:
        found[name].attrs |= dataset[name].attrs
    return found.transpose(*dims[:at], *names, *dims[at + 1 :], ...)
