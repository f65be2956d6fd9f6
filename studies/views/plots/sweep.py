"""Draw one value per run over two swept numbers: categories as markers, numbers as colours."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import cycle

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from studies.errors import StudyError
from studies.views.columns import counted, unit_of, words
from studies.views.picking import (
    flags,
    only_numbers,
    parameters_over,
    point_axes,
    sweep_axes,
    to_grid,
)
from studies.views.plots.captions import capitalised, named, short_label, value_text
from studies.views.plots.fields import without_rounding
from studies.views.plots.limits import draw_shakedown_limits
from studies.views.plots.runs import (
    POINTS,
    RunMark,
    Style,
    absent,
    known_values,
    plane_of,
    standing,
    style_of,
)
from studies.views.plots.sheets import (
    add_legend,
    colours_of,
    head_of,
    is_number,
    plain_axes,
)
from studies.views.rules import MOST_LINES

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
_MARKS = "osD^vPh*"
_CURVES = (8.0, 4.6)
"""Width and height of a figure of curves [in]."""
_LETTERS = 60
"""Largest number of letters of horizontal labels."""
_FOOT = 0.03
"""Position of the marks of runs without a value, as a share of the height of the axes."""
_CLOUD, _ABREAST = (3.2, 2.9), 3
"""Width and height of a panel of a cloud [in]; number of panels beside one another."""
_NAMES = 1.8
"""Width of the legend of a cloud [in]."""


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
    dataset = dataset.assign({field: without_rounding(dataset[field], dataset)})
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
        title = (named(str(each.name), panel[each.name].item(), unit_of(each)) for each in others)
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
    head_of(sheet, dataset, field)
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
    _check_most(field, panels, "panels", MOST_PANELS, [str(each.dims[0]) for each in others])
    return [*numbers, *others]


def _check_most(field: str, count: int, what: str, most: int, others: Sequence[str]) -> None:
    """Refuse to draw more than can be told apart."""
    if count > most:
        allowed = f"would take {count} {what}, at most {most} are drawn: select values of "
        raise StudyError("field", field, allowed + ", ".join(others))


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


def curve_figure(dataset: xr.Dataset, field: str) -> Figure:
    """Return `field` over the swept number, with a curve for each combination of the other axes.

    If only labels are swept, they are on the horizontal axis. Runs without a value are marked at
    the bottom by their status.

    Raises
    ------
    StudyError
        if nothing varies, no run has a value, or more than `MOST_LINES` curves would be drawn
    """
    numbers, labels = standing(dataset)
    if not numbers and not labels:
        allowed = "has one value a run, which is drawn over what is swept, but nothing varies here"
        raise StudyError("field", field, allowed)
    across, *others = [*numbers, *labels]
    curves = math.prod(each.size for each in others)
    _check_most(field, curves, "curves", MOST_LINES, [str(each.name) for each in others])
    style_of(dataset, field)  # raises an error if no run has a value
    sheet = Figure(figsize=_CURVES, dpi=150, layout="constrained")
    axes = sheet.add_subplot()
    numeric = is_number(across)
    x = across.to_numpy() if numeric else np.arange(across.size)
    values = known_values(dataset, field)
    missing: dict[RunMark, list[float]] = {}
    for at, mark in zip(np.ndindex(*(each.size for each in others)), cycle(_MARKS), strict=False):
        own = {str(each.dims[0]): i for each, i in zip(others, at, strict=True)}
        line, status = (each.isel(own).squeeze() for each in (values, dataset["status"]))
        name = ", ".join(value_text(each[i]) for each, i in zip(others, at, strict=True))
        order, y = np.argsort(x), line.to_numpy()
        style = "-" if numeric and not flags(dataset[field]) else "none"
        axes.plot(
            x[order], y[order], linestyle=style, marker=mark, markersize=5.0, label=name or None
        )
        for kind, there in absent(np.isfinite(y), status.to_numpy()).items():
            missing.setdefault(kind, []).extend(x[there])
    for kind, places in missing.items():
        foot = np.full(len(places), _FOOT)
        kind.draw(axes, np.array(places), foot, axes.get_xaxis_transform())
    if not numeric:
        names = [counted(each) for each in across.to_numpy()]
        axes.set_xticks(x, names, rotation=90.0 if len("".join(names)) > _LETTERS else 0.0)
    label_values(axes, dataset[field], values)
    plain_axes(axes)
    axes.set_xlabel(capitalised(short_label(across)))
    if others or missing:
        add_legend(axes, [words(str(each.name)) for each in others])
    head_of(sheet, dataset, field)
    return sheet


def label_values(axes: Axes, field: xr.DataArray, values: xr.DataArray) -> None:
    """Label the vertical axis: a number with its unit, or the meanings of flags that occur."""
    meanings: Mapping[int, str] = flags(field)
    if not meanings:
        axes.set_ylabel(capitalised(short_label(field)))
        return
    there = [code for code in meanings if (values == code).any()]
    axes.set_yticks(there, [words(meanings[code]) for code in there])
    axes.margins(y=0.2)


def cloud_figure(dataset: xr.Dataset, field: str, points: str) -> Figure:
    """Return `field` over each parameter of an axis of points, in a panel of its own.

    Each run is a mark in every panel, with a colour for each combination of the other axes. Runs
    without a value are marked at the bottom by their status.

    Raises
    ------
    StudyError
        if no run has a value, or there are more than `MOST_LINES` combinations of other axes
    """
    style_of(dataset, field)  # raises an error if no run has a value
    names = parameters_over(dataset, points)
    others = [a for a in sweep_axes(dataset) if a != points and dataset.sizes[a] > 1]
    count = math.prod(dataset.sizes[axis] for axis in others)
    _check_most(field, count, "colours", MOST_LINES, others)
    rows = -(-len(names) // _ABREAST)
    columns = -(-len(names) // rows)
    size = _CLOUD[0] * columns + _NAMES, _CLOUD[1] * rows + 0.9
    sheet = Figure(figsize=size, dpi=130, layout="constrained")
    panels = list(sheet.subplots(rows, columns, sharey=True, squeeze=False).flat)
    shown = only_numbers(dataset, field)
    series = shown.stack({"series": others}) if others else shown.expand_dims("series")
    colours = colours_of(series["series"]) if others else ["C0"]
    legend: dict[str, Line2D] = {}
    for axes, name in zip(panels, names, strict=False):
        for k, colour in enumerate(colours):
            one = series.isel(series=k).squeeze()
            places = [one[axis] for axis in others]
            label = ", ".join(
                named(str(each.name), each.item(), unit_of(each)) for each in places
            )  # without a label, matplotlib's begins with "_"
            for each in _draw_cloud(
                axes, one, field, name, RunMark(name=label, marker="o", colour=colour)
            ):
                legend.setdefault(str(each.get_label()), each)
        axes.set_xlabel(capitalised(short_label(dataset[name])))
        plain_axes(axes)
    for axes in panels[len(names) :]:
        axes.set_axis_off()
    for axes in panels[::columns]:
        label_values(axes, dataset[field], known_values(dataset, field))
    handles = [each for name, each in legend.items() if not name.startswith("_")]
    if handles:
        handles.sort(key=lambda each: each.get_marker() != "o")
        sheet.legend(handles=handles, loc="outside right upper", frameon=False)
    head_of(sheet, dataset, field)
    return sheet


def _draw_cloud(axes: Axes, runs: xr.Dataset, field: str, name: str, kind: RunMark) -> list[Line2D]:
    """Draw the runs of a panel over a parameter; return marks for the legend."""
    values, across = known_values(runs, field).to_numpy(), runs[name]
    x = across.to_numpy()
    if not is_number(across):
        texts = sorted({str(each) for each in x})
        x = np.array([texts.index(str(each)) for each in x])
        axes.set_xticks(range(len(texts)), texts)
        axes.margins(x=0.3)
    elif across.dtype.kind in "iu":
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    elif x.min() > 0.0 and _is_even(np.log(x)) and not _is_even(x):
        axes.set_xscale("log")
    known = np.isfinite(values)
    drawn = [kind.draw(axes, x[known], values[known])]
    drawn[0].set(markersize=4.0, alpha=0.8)
    for reason, there in absent(known, runs["status"].to_numpy()).items():
        foot = np.full(int(there.sum()), _FOOT)
        drawn.append(reason.draw(axes, x[there], foot, axes.get_xaxis_transform()))
    return drawn


def _is_even(x: np.ndarray) -> bool:
    """Whether values fill their range about evenly: their mean and median are in its middle."""
    middle = (x.min() + x.max()) / 2.0
    return bool(max(abs(np.median(x) - middle), abs(x.mean() - middle)) < 0.15 * np.ptp(x))
