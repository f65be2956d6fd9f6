"""What figures share: colours and styles of lines, legends, heads, axes, and figures as files."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from studies.errors import StudyError
from studies.numbers import number_text
from studies.views.columns import words
from studies.views.picking import sweep_axes
from studies.views.plots.captions import capitalised, setting, short_label, wrapped
from studies.views.rules import MOST_LINES, NUMBERS

STYLES: Sequence[Any] = ("-", "--", ":", "-.", (0, (8, 2, 1, 2, 1, 2)), (0, (1, 4)))
"""Line styles that can be distinguished."""

_TICKS = 7
"""Number of labels of a colour bar."""


def is_number(coordinate: xr.DataArray) -> bool:
    """Whether a coordinate is numeric, so that its values have an order."""
    return coordinate.dtype.kind in "fiu"


def colours_of(coordinate: xr.DataArray) -> Sequence[Any]:
    """Return a colour for each value of a coordinate; the colours of numbers follow their order."""
    if is_number(coordinate):
        rank = np.argsort(np.argsort(coordinate.to_numpy()))
        return list(colormaps[NUMBERS](np.linspace(0.0, 0.85, coordinate.size)[rank]))
    return [f"C{number}" for number in range(coordinate.size)]


def has_bar(coordinate: xr.DataArray) -> bool:
    """Whether a colour bar explains the values of a coordinate, in place of a legend."""
    return is_number(coordinate) and coordinate.size > MOST_LINES


def add_bar(axes: Axes, coordinate: xr.DataArray) -> None:
    """Draw a colour bar of a coordinate's values below the axes, with cells of equal width."""
    order, colours = np.argsort(coordinate.to_numpy()), colours_of(coordinate)
    cells = BoundaryNorm(np.arange(order.size + 1) - 0.5, order.size)
    shown = np.linspace(0, order.size - 1, _TICKS).round().astype(int)
    bar = axes.figure.colorbar(
        ScalarMappable(cells, ListedColormap([colours[i] for i in order])), ax=axes,
        location="bottom", aspect=40.0, label=capitalised(short_label(coordinate)),
    )  # fmt: skip
    bar.set_ticks(
        shown.tolist(), labels=[number_text(coordinate[order[i]].item(), 6) for i in shown]
    )
    bar.minorticks_off()


def add_legend(axes: Axes, headings: Sequence[str], *, styles: bool = False) -> None:
    """Add a legend beside the axes, headed by the names of the quantities.

    With `styles` it explains only the line styles: a bar explains the colours.
    """
    known = {name: line for line, name in zip(*axes.get_legend_handles_labels(), strict=True)}
    legend = axes.legend(
        list(known.values()), list(known), loc="upper left", bbox_to_anchor=(1.02, 1.0),
        borderaxespad=0.0, frameon=False, title=", ".join(headings),
    )  # fmt: skip
    if styles:
        for line in legend.get_lines():
            line.set_color("0.3")


def plain_axes(axes: Axes) -> None:
    """Draw a grid behind the lines, and no frame above and at the right."""
    axes.grid(color="0.92")
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def meaning(dataset: xr.Dataset, field: str) -> str:
    """Return what a variable is, as a title."""
    return capitalised(dataset[field].attrs.get("long_name", words(field)))


def head_of(sheet: Figure, dataset: xr.Dataset, field: str) -> None:
    """Write what is drawn of a study at the top of a figure, and what its runs have in common."""
    single = [axis for axis in sweep_axes(dataset) if dataset.sizes[axis] == 1]
    below = wrapped(setting(dataset.squeeze(single)), sheet.get_size_inches()[0] - 0.4, 8)
    add_head(sheet, meaning(dataset, field), below)


def add_head(sheet: Figure, name: str, below: str) -> None:
    """Write the title at the top left of a figure of several panels, and the setting below it."""
    engine = sheet.get_layout_engine()
    assert isinstance(engine, ConstrainedLayoutEngine)
    width, height = sheet.get_size_inches()
    name = wrapped(name, width - 0.2, 12)
    title = 0.31 + 0.19 * name.count("\n")
    head = title + 0.05 + 0.16 * (below.count("\n") + 1)
    height += head
    sheet.set_size_inches(width, height)
    engine.set(rect=(0.0, 0.0, 1.0, 1.0 - head / height))
    left = 0.1 / width
    sheet.text(left, 1.0 - 0.08 / height, name, va="top", fontsize=11, weight="bold")
    sheet.text(left, 1.0 - title / height, below, va="top", fontsize=8, color="0.3")


_COARSEST, _FINEST = 50, 600
"""Range of the resolution in dots per inch."""
_SIDE = 2**15
"""Largest number of dots of a side: matplotlib draws twice as many, in gigabytes of memory."""


def resolved(figure: Figure, resolution: float | None) -> Figure:
    """Return a figure with its resolution [dpi], by default its own, or raise `StudyError`."""
    if resolution is not None:
        if not _COARSEST <= resolution <= _FINEST:
            allowed = f"must be {_COARSEST} to {_FINEST} dots per inch"
            raise StudyError("resolution", resolution, allowed)
        figure.set_dpi(resolution)
    return figure


def save(figure: Figure, to: Path | IO[bytes], kind: str = "png") -> None:
    """Write a figure in its resolution, or the finest that its size allows."""
    figure.set_dpi(min(figure.dpi, _SIDE / max(figure.get_size_inches())))
    figure.savefig(to, format=kind, dpi=figure.dpi)  # matplotlib's default may be another dpi


def png(figure: Figure, resolution: float | None = None) -> bytes:
    """Return a figure as PNG, with a resolution [dpi], by default its own."""
    content = io.BytesIO()
    save(resolved(figure, resolution), content)
    return content.getvalue()
