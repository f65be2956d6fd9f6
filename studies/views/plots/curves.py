"""Draw one value per run over one swept number or labels, with a curve for each other value."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import cycle

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.errors import StudyError
from studies.views.columns import counted
from studies.views.picking import flags, sweep_axes
from studies.views.plots.captions import (
    capitalised,
    setting,
    short_label,
    value_text,
    words,
    wrapped,
)
from studies.views.plots.legends import MOST_LINES, add_legend, is_number
from studies.views.plots.runs import RunMark, absent, known_values, standing, style_of

_MARKS = "osD^vPh*"
_SIZE = (8.0, 4.6)
_LEFT = 0.9
"""Width of the labels left of the axes, where the caption begins [in]."""
_ABREAST = 60
"""Largest number of letters of horizontal labels."""
_FOOT = 0.03
"""Position of the marks of runs without a value, as a share of the height of the axes."""


def curve_figure(dataset: xr.Dataset, field: str) -> Figure:
    """Return `field` over the swept number, with a curve for each combination of the other axes.

    If only labels are swept, they are on the horizontal axis. Runs without a value are marked at
    the bottom by their status.

    Parameters
    ----------
    dataset : data set of a study
    field : one of its variables with one value per run

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
    if curves > MOST_LINES:
        rest = ", ".join(str(each.name) for each in others)
        raise StudyError(
            "field",
            field,
            f"would take {curves} curves, at most {MOST_LINES} are drawn: select values of {rest}",
        )
    style_of(dataset, field)  # raises an error if no run has a value
    sheet = Figure(figsize=_SIZE, dpi=150, layout="constrained")
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
        axes.set_xticks(x, names, rotation=90.0 if len("".join(names)) > _ABREAST else 0.0)
    label_values(axes, dataset[field], values)
    axes.grid(color="0.92")
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlabel(capitalised(short_label(across)))
    if others or missing:
        add_legend(axes, [words(str(each.name)) for each in others])
    single = [axis for axis in sweep_axes(dataset) if dataset.sizes[axis] == 1]
    below = wrapped(setting(dataset.squeeze(single)), _SIZE[0] - _LEFT, 8)
    name = capitalised(dataset[field].attrs.get("long_name", words(field)))
    axes.set_title(below, loc="left", fontsize=8, color="0.3")
    sheet.suptitle(name, x=0.01, ha="left", fontsize=11, weight="bold")
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
