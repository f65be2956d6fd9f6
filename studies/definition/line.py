"""A variable of a run, and what of it is at a place on its dimensions."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.parameters import is_number


class Line(NamedTuple):
    """A variable of a run: the names of its dimensions, and its values."""

    dims: tuple[str, ...]
    values: NDArray[Any]


Read = Callable[[str], Line | None]
"""Gives a variable of a run by its name; None if the run has none."""


def picked(
    read: Read, name: str, at: Mapping[str, Any], keeps: Collection[str] = ()
) -> NDArray[np.float64]:
    """Return a variable over the dimensions ``keeps``, at a place on the others.

    Raises
    ------
    ValueError
        if the run has no such variable, or it has not this place
    """
    found = read(name)
    if found is None:
        raise ValueError(f"the run has no {name}")
    dims, values = list(found.dims), found.values
    for dim in found.dims:
        if dim in keeps:
            continue
        grid = read(dim)
        labels = np.arange(values.shape[dims.index(dim)]) if grid is None else grid.values
        place = _position(name, dim, labels, at)
        values = np.take(values, place, axis=dims.index(dim))
        dims.remove(dim)
    return np.asarray(values, dtype=float)


def _position(name: str, dim: str, labels: NDArray[Any], at: Mapping[str, Any]) -> int:
    some = ", ".join(map(str, labels[:6].tolist()))
    if dim not in at:
        if len(labels) == 1:
            return 0
        raise ValueError(f"{name} is over {dim} too: say at which, of {some}")
    wanted = at[dim]
    if labels.dtype.kind in "fiu" and is_number(wanted):
        same = np.isclose(labels.astype(float), wanted, rtol=1e-6)
    else:
        same = labels.astype(str) == str(wanted)
    if not same.any():
        raise ValueError(f"{name} has no {dim} = {wanted}; it has {some}")
    return int(np.argmax(same))
