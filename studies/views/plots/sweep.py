"""Draw one value per run over two swept numbers: categories as markers, numbers as colours."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from studies.errors import StudyError
from studies.views.grids import parameters_over, point_axes, to_grid
from studies.views.picking import flags, sweep_axes
from studies.views.plots.captions import capitalised, named, setting, short_label, words, wrapped
from studies.views.plots.cloud import cloud_figure
from studies.views.plots.curves import curve_figure
from studies.views.plots.legends import MOST_LINES, add_head
from studies.views.plots.limits import draw_shakedown_limits
from studies.views.plots.runs import (
    POINTS,
    Style,
    absent,
    known_values,
    plane_of,
    standing,
    style_of,
)

MOST_PANELS = 6

OVERLAYS: Mapping[tuple[str, str, str], Callable[[Axes, xr.Dataset, bool], Sequence[Line2D]]] = {
    ("shakedown_state", "load_ratio", "friction"): draw_shakedown_limits,
}
"""Theory drawn over a field, by field, vertical and horizontal quantity. The function gets the
axes, the runs of the panel and whether it is the last of its row; it returns the lines."""

_FEW = 3
"""Numbers of values of both quantities up to which curves are drawn."""
_PANEL = (3.4, 3.1)
"""Width and height of a panel [in]."""
_DENSE, _CONTOURS = 6, 12
"""Least number of values of both quantities for contours; number of contours."""
_LEGEND, _BAR = 3.2, 1.6
"""Width of the legend beside panels, and that of a colour bar: then the legend is below [in]."""


def sweep_figure(dataset: xr.Dataset, field: str) -> Figure:
    """Return `field` over two swept numbers, in a panel for each combination of the other axes.

    Over one number, only over labels, or over two numbers of up to three values, it is drawn as
    curves: see `curve_figure`. Points that are
    a grid are drawn as one; over points of more than two parameters see `cloud_figure`.

    The number of an axis is the axis itself, or a parameter of a linked axis that distinguishes all
    its values. The first number is vertical and the second horizontal; load ratio and friction come
    first. Flags are drawn as categories, other numbers as colours, and runs without a value by
    their status.

    Parameters
    ----------
    dataset : data set of a study
    field : one of its variables with one value per run

    Raises
    ------
    StudyError
        if nothing is swept, more than `MOST_PANELS` panels would be drawn, or no run has a value
    """
    for axis in point_axes(dataset):
        varied = parameters_over(dataset, axis)
        if len(varied) < 2:
            continue
        if (gridded := _gridded(dataset, axis)) is not None:
            return sweep_figure(gridded, field)
        if not plane_of(dataset, axis):
            return cloud_figure(dataset, field, axis)
    numbers, _ = standing(dataset)
    if len(numbers) < 2 or (not flags(dataset[field]) and _few(dataset)):
        return curve_figure(dataset, field)
    up, across, *others = _arrangement(dataset, field)
    columns = others[-1].size if others else 1
    rows = math.prod(each.size for each in others) // columns
    style = style_of(dataset, field)
    beside = _LEGEND if style.flags else _BAR
    size = _PANEL[0] * columns + beside, _PANEL[1] * rows + 1.2
    sheet = Figure(figsize=size, dpi=130, layout="constrained")
    grid = sheet.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for number, axis in ((across, grid[0, 0].xaxis), (up, grid[0, 0].yaxis)):
        if number.dtype.kind in "iu":
            axis.set_major_locator(MaxNLocator(integer=True))
    overlay = OVERLAYS.get((field, str(up.name), str(across.name)))
    legend: dict[object, Line2D] = {}
    for axes, at in zip(grid.flat, np.ndindex(*(each.size for each in others)), strict=True):
        panel = dataset.isel({each.dims[0]: i for each, i in zip(others, at, strict=True)})
        drawn = _draw(axes, panel, field, (str(up.name), str(across.name)), style)
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
    if not style.flags:
        colours = ScalarMappable(style.norm, style.colours)
        sheet.colorbar(colours, ax=grid, label=short_label(dataset[field]), shrink=0.8)
    if legend:
        sheet.legend(
            handles=list(legend.values()), frameon=False,
            loc="outside right center" if style.flags else "outside lower left",
        )  # fmt: skip
    for axes in grid[-1]:
        axes.set_xlabel(capitalised(short_label(across)))
    for axes in grid[:, 0]:
        axes.set_ylabel(capitalised(short_label(up)))
    single = [axis for axis in sweep_axes(dataset) if dataset.sizes[axis] == 1]
    below = wrapped(setting(dataset.squeeze(single)), size[0] - 0.4, 8)
    add_head(sheet, capitalised(dataset[field].attrs.get("long_name", words(field))), below)
    return sheet


def _few(dataset: xr.Dataset) -> bool:
    """Whether two numbers have so few values that curves tell more than marks in a plane."""
    numbers, labels = standing(dataset)
    first, second = numbers[:2]
    curves = math.prod(each.size for each in (*numbers[1:], *labels))
    return (
        first.dims != second.dims and max(first.size, second.size) <= _FEW and curves <= MOST_LINES
    )


def _gridded(dataset: xr.Dataset, points: str) -> xr.Dataset | None:
    """Return a data set in which points are a grid; None if they are no grid."""
    try:
        return to_grid(dataset, points)
    except StudyError:
        return None


def _arrangement(dataset: xr.Dataset, field: str) -> list[xr.DataArray]:
    """Return the vertical and the horizontal number, then the axes whose values have panels."""
    numbers = standing(dataset)[0][:2]
    used = {each.dims for each in numbers}
    several = [axis for axis in sweep_axes(dataset) if dataset.sizes[axis] > 1]
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


def _draw(
    axes: Axes, panel: xr.Dataset, field: str, places: tuple[str, str], style: Style
) -> list[Line2D]:
    """Draw the runs of a panel; return marks for the legend: of flags and of runs without value."""
    up, across = places
    every = known_values(panel, field), panel["status"], panel[up], panel[across]
    values, status, y, x = (each.to_numpy().ravel() for each in xr.broadcast(*every))
    known = np.isfinite(values)
    kinds = [(kind, values == value) for value, kind in style.flags.items()]
    kinds += absent(known, status).items()
    if not style.flags:
        dense = _contours(axes, panel, field, places, style)
        axes.scatter(
            x[known], y[known], c=values[known], s=2.0 if dense else POINTS**2, cmap=style.colours,
            norm=style.norm, edgecolor="0.3", linewidth=0.5, zorder=3.0,
        )  # fmt: skip
    return [kind.draw(axes, x[there], y[there]) for kind, there in kinds if there.any()]


def _contours(
    axes: Axes, panel: xr.Dataset, field: str, places: tuple[str, str], style: Style
) -> bool:
    """Draw filled contours if the sweep is dense; return whether it is."""
    up, across = (panel[name] for name in places)
    low, high = style.norm.vmin, style.norm.vmax
    if (
        up.dims == across.dims
        or min(up.size, across.size) < _DENSE
        or low is None
        or high is None
        or low == high
    ):
        return False
    order = {str(each.dims[0]): np.argsort(panel[each.name].to_numpy()) for each in (up, across)}
    values = known_values(panel, field).isel(order).squeeze().transpose(*order).to_numpy()
    x, y = np.sort(panel[places[1]].to_numpy()), np.sort(panel[places[0]].to_numpy())
    levels = MaxNLocator(_CONTOURS).tick_values(low, high)
    axes.contourf(x, y, values, levels, cmap=style.colours, norm=style.norm)
    axes.contour(x, y, values, levels, colors="0.25", linewidths=0.4)
    return True
