"""Draw one value per run over points of several parameters: a panel for each parameter."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from studies.errors import StudyError
from studies.views.grids import parameters_over
from studies.views.picking import only_numbers, sweep_axes
from studies.views.plots.captions import capitalised, named, setting, short_label, words, wrapped
from studies.views.plots.curves import label_values
from studies.views.plots.legends import MOST_LINES, add_head, colours_of, is_number
from studies.views.plots.runs import RunMark, absent, known_values, style_of

_PANEL, _ABREAST = (3.2, 2.9), 3
"""Width and height of a panel [in]; number of panels beside one another."""
_LEGEND = 1.8
"""Width of the legend [in]."""
_FOOT = 0.03
"""Position of the marks of runs without a value, as a share of the height of the axes."""


def cloud_figure(dataset: xr.Dataset, field: str, points: str) -> Figure:
    """Return `field` over each parameter of an axis of points, in a panel of its own.

    Each run is a mark in every panel, with a colour for each combination of the other axes. Runs
    without a value are marked at the bottom by their status.

    Parameters
    ----------
    dataset : data set of a study
    field : one of its variables with one value per run
    points : the axis of points

    Raises
    ------
    StudyError
        if no run has a value, or there are more than `MOST_LINES` combinations of other axes
    """
    style_of(dataset, field)  # raises an error if no run has a value
    names = parameters_over(dataset, points)
    others = [a for a in sweep_axes(dataset) if a != points and dataset.sizes[a] > 1]
    count = math.prod(dataset.sizes[axis] for axis in others)
    if count > MOST_LINES:
        rest = ", ".join(others)
        allowed = f"would take {count} colours, at most {MOST_LINES} are drawn: select {rest}"
        raise StudyError("field", field, allowed)
    rows = -(-len(names) // _ABREAST)
    columns = -(-len(names) // rows)
    size = _PANEL[0] * columns + _LEGEND, _PANEL[1] * rows + 0.9
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
                named(str(each.name), each.item(), each.attrs.get("units", "")) for each in places
            )  # without a label, matplotlib's begins with "_"
            for each in _draw(
                axes, one, field, name, RunMark(name=label, marker="o", colour=colour)
            ):
                legend.setdefault(str(each.get_label()), each)
        axes.set_xlabel(capitalised(short_label(dataset[name])))
        axes.grid(color="0.92")
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    for axes in panels[len(names) :]:
        axes.set_axis_off()
    for axes in panels[::columns]:
        label_values(axes, dataset[field], known_values(dataset, field))
    handles = [each for name, each in legend.items() if not name.startswith("_")]
    if handles:
        handles.sort(key=lambda each: each.get_marker() != "o")
        sheet.legend(handles=handles, loc="outside right upper", frameon=False)
    single = [axis for axis in sweep_axes(dataset) if dataset.sizes[axis] == 1]
    below = wrapped(setting(dataset.squeeze(single)), size[0] - 0.4, 8)
    add_head(sheet, capitalised(dataset[field].attrs.get("long_name", words(field))), below)
    return sheet


def _draw(axes: Axes, runs: xr.Dataset, field: str, name: str, kind: RunMark) -> list[Line2D]:
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
