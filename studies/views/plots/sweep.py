"""One value a run, drawn over two swept numbers: categories as markers, numbers as colours."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from studies.definition.cases import USUAL_AXES
from studies.definition.vocabulary import OK, STATUSES
from studies.errors import StudyError
from studies.views.plots.captions import capitalised, named, setting, short_label, words, wrapped
from studies.views.plots.limits import draw_shakedown_limits
from studies.views.plots.maps import SIGNED
from studies.views.reading import flags, sweep_axes, sweep_coordinates

MOST_PANELS = 6

OVERLAYS: Mapping[tuple[str, str, str], Callable[[Axes, xr.Dataset, bool], Sequence[Line2D]]] = {
    ("shakedown_state", "load_ratio", "friction"): draw_shakedown_limits,
}
"""What theory adds to a field with one number going up and one across: draws on a panel, the last
of its row or not, and returns its lines."""

_CATEGORIES = (
    ("o", "#56B4E9"), ("s", "#0072B2"), ("D", "#E69F00"), ("^", "#D55E00"),
    ("P", "#999999"), ("v", "#CC79A7"), ("h", "#009E73"), ("*", "#000000"),
)  # fmt: skip
"""Marker and colour by flag value: colours told apart by every kind of eye (Okabe and Ito)."""
_POINTS = 8.0
_PANEL = (3.4, 3.1)
"""Width and height of a panel [in]."""
_LEGEND = 3.2
"""Width of the legend, with the axis beside it [in]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Kind:
    """Runs that are drawn alike."""

    name: str
    marker: str
    colour: str = "0.15"
    filled: bool = True

    def draw(self, axes: Axes, x: np.ndarray, y: np.ndarray) -> Line2D:
        face = self.colour if self.filled else "none"
        (line,) = axes.plot(
            x, y, linestyle="", marker=self.marker, markersize=_POINTS, color=self.colour,
            markerfacecolor=face, label=self.name, zorder=3.0,
        )  # fmt: skip
        return line


@dataclass(frozen=True, slots=True, kw_only=True)
class _Look:
    """How values are drawn: flags by kind; other numbers, where there are no flags, by colour."""

    flags: Mapping[int, _Kind]
    norm: Normalize
    colours: str


_FAILED = _Kind(name="failed or missing", marker="x")
_ABSENT = {
    OK: _Kind(name="no value", marker="."),
    "limit_load": _Kind(name="no equilibrium", marker="s", filled=False),
}
"""Runs without a value by status; others are `_FAILED`."""


def sweep_figure(dataset: xr.Dataset, field: str) -> Figure:
    """Return `field` over two swept numbers, in a panel for each combination of the other axes.

    A number stands for an axis where it tells its values apart: the axis itself, or a parameter
    that a linked axis sets. The first number goes up and the second across, load ratio and
    friction before others. Flags are drawn as categories, other numbers as colours, and runs
    without a value by their status.

    Parameters
    ----------
    dataset : of a study
    field : one of its variables with one value a run

    Raises
    ------
    StudyError
        when fewer than two numbers are swept, more than `MOST_PANELS` panels would be drawn, or no
        run has a value
    """
    up, across, *others = _arrangement(dataset, field)
    columns = others[-1].size if others else 1
    rows = math.prod(each.size for each in others) // columns
    size = _PANEL[0] * columns + _LEGEND, _PANEL[1] * rows + 1.2
    sheet = Figure(figsize=size, dpi=130, layout="constrained")
    grid = sheet.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for number, axis in ((across, grid[0, 0].xaxis), (up, grid[0, 0].yaxis)):
        if number.dtype.kind in "iu":
            axis.set_major_locator(MaxNLocator(integer=True))
    look = _look(dataset, field)
    overlay = OVERLAYS.get((field, str(up.name), str(across.name)))
    legend: dict[object, Line2D] = {}
    for axes, at in zip(grid.flat, np.ndindex(*(each.size for each in others)), strict=True):
        panel = dataset.isel({each.dims[0]: i for each, i in zip(others, at, strict=True)})
        drawn = _draw(axes, panel, field, (str(up.name), str(across.name)), look)
        if overlay:
            drawn += overlay(axes, panel, axes in grid[:, -1])
        legend |= {each.get_label(): each for each in drawn}
        title = (
            named(str(each.name), panel[each.name].item(), each.attrs.get("units", ""))
            for each in others
        )
        axes.set_title(", ".join(title), fontsize=10)
        axes.grid(color="0.92")
        axes.set_axisbelow(True)
    if not look.flags:
        colours = ScalarMappable(look.norm, look.colours)
        sheet.colorbar(colours, ax=grid, label=short_label(dataset[field]), shrink=0.8)
    if legend:
        sheet.legend(handles=list(legend.values()), loc="outside right center", frameon=False)
    for axes in grid[-1]:
        axes.set_xlabel(capitalised(short_label(across)))
    for axes in grid[:, 0]:
        axes.set_ylabel(capitalised(short_label(up)))
    single = [axis for axis in sweep_axes(dataset) if dataset.sizes[axis] == 1]
    below = wrapped(setting(dataset.squeeze(single)), size[0], 10)
    name = capitalised(dataset[field].attrs.get("long_name", words(field)))
    sheet.suptitle(f"{name}\n{below}", fontsize=10)
    return sheet


def _arrangement(dataset: xr.Dataset, field: str) -> list[xr.DataArray]:
    """Return what stands for each axis: the number going up, that across, then the others."""
    several = [axis for axis in sweep_axes(dataset) if dataset.sizes[axis] > 1]
    standing = [_standing(dataset, axis) for axis in several]
    numbers = sorted((each for each in standing if each.dtype.kind in "fiu"), key=_rank)[:2]
    if len(numbers) < 2:
        free = f"only {numbers[0].name} varies" if numbers else "no number varies"
        allowed = f"has one value a run, which is drawn over two swept numbers, but {free} here"
        raise StudyError("field", field, allowed)
    used = {each.dims for each in numbers}
    others = [dataset[axis] for axis in several if (axis,) not in used]
    panels = math.prod(each.size for each in others)
    if panels > MOST_PANELS:
        axes = ", ".join(str(each.dims[0]) for each in others)
        raise StudyError(
            "field",
            field,
            f"would take {panels} panels, at most {MOST_PANELS} are drawn: select values of {axes}",
        )
    return [*numbers, *others]


def _standing(dataset: xr.Dataset, axis: str) -> xr.DataArray:
    """Return the first number that has another value at each point of an axis, or the axis."""
    known = [dataset[name] for name, over in sweep_coordinates(dataset).items() if over == axis]
    apart = [
        each
        for each in known
        if each.dtype.kind in "fiu" and len(np.unique(each)) == dataset.sizes[axis]
    ]
    return min(apart, key=_rank, default=dataset[axis])


def _rank(quantity: xr.DataArray) -> int:
    name = str(quantity.name)
    return USUAL_AXES.index(name) if name in USUAL_AXES else len(USUAL_AXES)


def _known(dataset: xr.Dataset, field: str) -> xr.DataArray:
    """Return a field where runs succeeded, NaN elsewhere; the status of every run."""
    ok = dataset["status"] == STATUSES.index(OK)
    return dataset[field].astype(float).where(ok | (field == "status"))


def _look(dataset: xr.Dataset, field: str) -> _Look:
    """Return how a field is drawn; numbers that change sign have zero in the middle."""
    known = _known(dataset, field).to_numpy()
    known = known[np.isfinite(known)]
    if not known.size:
        raise StudyError("field", field, "has no value in the runs selected")
    low, high = float(known.min()), float(known.max())
    kinds = {
        value: _Kind(name=words(name), marker=marker, colour=colour)
        for (value, name), (marker, colour) in zip(
            flags(dataset[field]).items(), _CATEGORIES, strict=False
        )
    }
    if low < 0.0 < high:
        low, high = min(low, -high), max(high, -low)
        return _Look(flags=kinds, norm=Normalize(low, high), colours=SIGNED)
    return _Look(flags=kinds, norm=Normalize(low, high), colours="viridis")


def _draw(
    axes: Axes, panel: xr.Dataset, field: str, places: tuple[str, str], look: _Look
) -> list[Line2D]:
    """Draw the runs of a panel; return marks to explain: of all flags, and of what is absent."""
    up, across = places
    values, status, y, x = (
        each.to_numpy().ravel()
        for each in xr.broadcast(_known(panel, field), panel["status"], panel[up], panel[across])
    )
    known = np.isfinite(values)
    kinds = [(kind, values == value) for value, kind in look.flags.items()]
    absent = {_ABSENT.get(name, _FAILED): np.zeros_like(known) for name in STATUSES}
    for value, name in enumerate(STATUSES):
        absent[_ABSENT.get(name, _FAILED)] |= ~known & (status == value)
    kinds += [(kind, there) for kind, there in absent.items() if there.any()]
    if not look.flags:
        axes.scatter(
            x[known], y[known], c=values[known], s=_POINTS**2, cmap=look.colours, norm=look.norm,
            edgecolor="0.3", linewidth=0.5, zorder=3.0,
        )  # fmt: skip
    return [kind.draw(axes, x[there], y[there]) for kind, there in kinds]
