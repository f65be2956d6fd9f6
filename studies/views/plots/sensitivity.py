"""Draw indices of sensitivity: bars, a tornado, and the runs over each parameter."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.numbers import number_text
from studies.views.columns import words
from studies.views.picking import select
from studies.views.plots.captions import capitalised, short_label
from studies.views.plots.runs import known_values
from studies.views.plots.sheets import plain_axes
from studies.views.sensitivity import main_index, ordered

_ABREAST = 3
"""Number of panels of parameters beside one another."""
_PANEL = (3.2, 2.6)
"""Width and height of such a panel [in]."""
_FIRST, _TOTAL, _EFFECT = "#0072B2", "#E69F00", "#D55E00"


def sensitivity_figure(
    dataset: xr.Dataset, found: xr.Dataset, selection: dict[str, str] | None = None
) -> Figure:
    """Return a figure of indices and of the runs behind them.

    Above: bars of the indices, of ``chaos`` with what they are known to, and a tornado: how far the
    mean of the number moves along each parameter. Below: the runs over each parameter, and this
    mean. The parameter of the largest index comes first.
    """
    found = found.isel(parameter=ordered(found))
    names = [str(name) for name in found["parameter"].to_numpy()]
    chaos = found.attrs["method"] == "chaos"
    rows = math.ceil(len(names) / _ABREAST)
    bars = 0.32 * len(names) + 1.5
    size = _PANEL[0] * _ABREAST, bars + _PANEL[1] * rows + 0.5
    sheet = Figure(figsize=size, dpi=130, layout="constrained")
    above, below = sheet.subfigures(2, 1, squeeze=False, height_ratios=(bars, _PANEL[1] * rows))[
        :, 0
    ]
    left, *right = above.subplots(1, 2 if chaos else 1, squeeze=False)[0]
    _indices(left, found, names)
    values = known_values(select(dataset, selection or {}), found.attrs["of"])
    if chaos:
        _tornado(right[0], found, values, names)
    panels = list(below.subplots(rows, _ABREAST, sharey=True, squeeze=False).flat)
    for axes, name in zip(panels, names, strict=False):
        x, y = (each.to_numpy().ravel() for each in xr.broadcast(values[name], values))
        axes.plot(x, y, "o", color="0.45", markersize=3.0, alpha=0.7)
        if chaos:
            one = found.sel(parameter=name)
            axes.plot(one["place"], one["effect"], color=_EFFECT, linewidth=1.8)
        axes.set_xlabel(capitalised(short_label(dataset[name])))
        plain_axes(axes)
    for axes in panels[len(names) :]:
        axes.set_axis_off()
    for axes in panels[::_ABREAST]:
        axes.set_ylabel(capitalised(short_label(dataset[found.attrs["of"]])))
    name = capitalised(found.attrs.get("long_name", words(found.attrs["of"])))
    fit = f" · fit with Q² = {found.attrs['q2']:.3f}" if chaos else ""
    left.set_title(f"{found.attrs['runs']} runs{fit}", loc="left", fontsize=8, color="0.3")
    sheet.suptitle(name, x=0.01, ha="left", fontsize=11, weight="bold")
    return sheet


def _indices(axes: Axes, found: xr.Dataset, names: list[str]) -> None:
    """Draw the indices as bars."""
    chaos = found.attrs["method"] == "chaos"
    kinds = {"first": _FIRST, "total": _TOTAL} if chaos else {main_index(found): _FIRST}
    height = 0.8 / len(kinds)
    for k, (kind, colour) in enumerate(kinds.items()):
        y = np.arange(len(names)) + (k - (len(kinds) - 1) / 2) * height
        error = found.get(f"{kind}_error")
        axes.barh(
            y, found[kind], height, color=colour, label=words(kind),
            xerr=None if error is None else error.to_numpy(), error_kw={"capsize": 2.0},
        )  # fmt: skip
    axes.set_yticks(range(len(names)), list(map(words, names)))
    axes.set_xlim(min(0.0, float(found[next(iter(kinds))].min())), None)
    axes.invert_yaxis()
    axes.set_xlabel("Share of the variance" if chaos else capitalised(words(main_index(found))))
    axes.legend(frameon=False, fontsize=8, loc="lower right")
    plain_axes(axes)


def _tornado(axes: Axes, found: xr.Dataset, values: xr.DataArray, names: list[str]) -> None:
    """Draw how far the mean of the number moves along each parameter."""
    low, high = (getattr(found["effect"], end)("share") for end in ("min", "max"))
    axes.barh(range(len(names)), high - low, 0.6, left=low, color=_EFFECT)
    for k, name in enumerate(names):
        effect, place = (found[e].sel(parameter=name).to_numpy() for e in ("effect", "place"))
        ends = [(effect.argmin(), "right", low), (effect.argmax(), "left", high)]
        for at, side, end in ends:
            text = f" {number_text(place[at], 3)} "
            axes.text(end[k].item(), k, text, ha=side, va="center", fontsize=7)
    axes.set_yticks(range(len(names)), [""] * len(names))
    axes.invert_yaxis()
    axes.use_sticky_edges = False
    axes.margins(x=0.2)
    axes.set_xlabel(f"Mean of {short_label(values)}")
    axes.axvline(float(values.mean()), color="0.2", linewidth=0.8)
    plain_axes(axes)
