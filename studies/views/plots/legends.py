"""How lines are distinguished, by colour and style, and what explains them: a legend or a bar."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap

from studies.views.plots.captions import capitalised, short_label

MOST_LINES = 12
"""Most lines that a legend tells apart; the values of a number have a bar of colours beyond."""

STYLES: Sequence[Any] = ("-", "--", ":", "-.", (0, (8, 2, 1, 2, 1, 2)), (0, (1, 4)))
"""Dashes that can be distinguished."""

_TICKS = 7
"""Values named at a bar of colours."""


def is_number(coordinate: xr.DataArray) -> bool:
    """Tell whether the values of a coordinate have an order."""
    return coordinate.dtype.kind in "fiu"


def colours_of(coordinate: xr.DataArray) -> Sequence[Any]:
    """Return a colour for each value of a coordinate: in their order, where it is a number."""
    if is_number(coordinate):
        rank = np.argsort(np.argsort(coordinate.to_numpy()))
        return list(colormaps["viridis"](np.linspace(0.0, 0.85, coordinate.size)[rank]))
    return [f"C{number}" for number in range(coordinate.size)]


def has_bar(coordinate: xr.DataArray) -> bool:
    """Tell whether the values of a coordinate are explained by a bar of colours."""
    return is_number(coordinate) and coordinate.size > MOST_LINES


def add_bar(axes: Axes, coordinate: xr.DataArray) -> None:
    """Draw the colours of a number's values below the axes, each as wide as the next."""
    order, colours = np.argsort(coordinate.to_numpy()), colours_of(coordinate)
    cells = BoundaryNorm(np.arange(order.size + 1) - 0.5, order.size)
    shown = np.linspace(0, order.size - 1, _TICKS).round().astype(int)
    bar = axes.figure.colorbar(
        ScalarMappable(cells, ListedColormap([colours[i] for i in order])), ax=axes,
        location="bottom", aspect=40.0, label=capitalised(short_label(coordinate)),
    )  # fmt: skip
    bar.set_ticks(shown.tolist(), labels=[f"{coordinate[order[i]].item():g}" for i in shown])
    bar.minorticks_off()


def add_legend(axes: Axes, headings: Sequence[str], *, styles: bool = False) -> None:
    """Explain the lines beside the axes, headed by what their names are values of.

    `styles`: the dashes alone, where a bar explains the colours.
    """
    known = {name: line for line, name in zip(*axes.get_legend_handles_labels(), strict=True)}
    legend = axes.legend(
        list(known.values()), list(known), loc="upper left", bbox_to_anchor=(1.02, 1.0),
        borderaxespad=0.0, frameon=False, title=", ".join(headings),
    )  # fmt: skip
    if styles:
        for line in legend.get_lines():
            line.set_color("0.3")
