"""The runs of a study in figures: the quantities on the axes, and the marks of runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D
from matplotlib.transforms import Transform

from studies.definition.cases import USUAL_AXES
from studies.definition.vocabulary import OK, OUTSIDE_THEORY, STATUSES
from studies.errors import StudyError
from studies.views.columns import words
from studies.views.picking import flags, parameters_over, point_axes, sweep_axes, sweep_coordinates
from studies.views.rules import NUMBERS, REASONS, SIGNED

_CATEGORIES = (
    ("o", "#56B4E9"), ("s", "#0072B2"), ("D", "#E69F00"), ("^", "#D55E00"),
    ("P", "#999999"), ("v", "#CC79A7"), ("h", "#009E73"), ("*", "#000000"),
)  # fmt: skip
"""Marker and colour by flag value; the colours suit colour-blind readers (Okabe and Ito)."""
POINTS = 8.0
"""Size of a mark [points]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunMark:
    """Runs that are drawn with the same mark."""

    name: str
    marker: str
    colour: str = "0.15"
    filled: bool = True

    def draw(
        self, axes: Axes, x: np.ndarray, y: np.ndarray, transform: Transform | None = None
    ) -> Line2D:
        """Draw marks at x, y (n,), by default in data coordinates."""
        face = self.colour if self.filled else "none"
        (line,) = axes.plot(
            x, y, linestyle="", marker=self.marker, markersize=POINTS, color=self.colour,
            markerfacecolor=face, label=self.name, zorder=3.0,
            transform=transform or axes.transData,
        )  # fmt: skip
        return line


@dataclass(frozen=True, slots=True, kw_only=True)
class Style:
    """Style of values: flags by kind; numbers, if there are no flags, by colour."""

    flags: Mapping[int, RunMark]
    norm: Normalize
    colours: str


_FAILED = RunMark(name="failed or missing", marker="x")
_ABSENT = {
    OK: RunMark(name=REASONS[OK], marker="."),
    "limit_load": RunMark(name=REASONS["limit_load"], marker="s", filled=False),
    OUTSIDE_THEORY: RunMark(name=REASONS[OUTSIDE_THEORY], marker="^", filled=False),
}
"""Marks of runs without a value by status; all others have `_FAILED`."""


def standing(dataset: xr.Dataset) -> tuple[list[xr.DataArray], list[xr.DataArray]]:
    """Return the quantity shown for each axis that varies: numbers, usual ones first; then labels.

    A number can be shown for an axis if it distinguishes all its values: the axis itself, or a
    parameter that a linked axis sets. Two numbers that points set are shown both, before others.
    """
    several = [axis for axis in sweep_axes(dataset) if dataset.sizes[axis] > 1]
    planes = {axis: names for axis in point_axes(dataset) if (names := plane_of(dataset, axis))}
    every = [number_over(dataset, axis) for axis in several if axis not in planes]
    numbers = sorted((each for each in every if each.dtype.kind in "fiu"), key=_rank)
    both = [dataset[name] for names in planes.values() for name in names]
    return both + numbers, [each for each in every if each.dtype.kind not in "fiu"]


def plane_of(dataset: xr.Dataset, axis: str) -> list[str]:
    """Return the two parameters of an axis of points, if just two vary, and are numbers."""
    names = parameters_over(dataset, axis)
    numeric = all(dataset[name].dtype.kind in "fiu" for name in names)
    return (
        sorted(names, key=lambda name: _rank(dataset[name])) if numeric and len(names) == 2 else []
    )


def number_over(dataset: xr.Dataset, axis: str) -> xr.DataArray:
    """Return the first number that has different values at all points of an axis, or the axis.

    Where words differ too, a number would not tell what the points are.
    """
    known = [dataset[name] for name, over in sweep_coordinates(dataset).items() if over == axis]
    words = [each for each in known if each.name != axis and each.dtype.kind not in "fiu"]
    if any(len(np.unique(each)) > 1 for each in words):
        return dataset[axis]
    distinct = [
        each
        for each in known
        if each.dtype.kind in "fiu" and len(np.unique(each)) == dataset.sizes[axis]
    ]
    return min(distinct, key=_rank, default=dataset[axis])


def _rank(quantity: xr.DataArray) -> int:
    name = str(quantity.name)
    return USUAL_AXES.index(name) if name in USUAL_AXES else len(USUAL_AXES)


def known_values(dataset: xr.Dataset, field: str) -> xr.DataArray:
    """Return a field where runs succeeded, NaN elsewhere; ``status`` as numbers for all runs."""
    status = dataset["status"]
    if field == "status":
        numbers = {name: float(code) for code, name in flags(status).items()}
        drawn = [numbers.get(name, np.nan) for name in status.to_numpy().flat]
        return status.copy(data=np.reshape(drawn, status.shape))
    return dataset[field].astype(float).where(status == OK)


def style_of(dataset: xr.Dataset, field: str) -> Style:
    """Return the style of a field; for numbers of both signs zero is in the middle of the colours.

    Raises `StudyError` if no run has a value.
    """
    known = known_values(dataset, field).to_numpy()
    known = known[np.isfinite(known)]
    if not known.size:
        raise StudyError("field", field, "has no value in the runs selected")
    low, high = float(known.min()), float(known.max())
    kinds = {
        value: RunMark(name=words(name), marker=marker, colour=colour)
        for (value, name), (marker, colour) in zip(
            flags(dataset[field]).items(), _CATEGORIES, strict=False
        )
    }
    if low < 0.0 < high:
        low, high = min(low, -high), max(high, -low)
        return Style(flags=kinds, norm=Normalize(low, high), colours=SIGNED)
    return Style(flags=kinds, norm=Normalize(low, high), colours=NUMBERS)


def absent(known: np.ndarray, status: np.ndarray) -> dict[RunMark, np.ndarray]:
    """Return for each reason that occurs the runs without a value, as arrays of bool."""
    found = {_ABSENT.get(name, _FAILED): np.zeros_like(known) for name in STATUSES}
    for name in STATUSES:
        found[_ABSENT.get(name, _FAILED)] |= ~known & (status == name)
    return {kind: there for kind, there in found.items() if there.any()}
