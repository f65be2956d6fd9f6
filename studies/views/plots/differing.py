"""Draw what differs between two studies: the largest changes, and one number against the other."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.errors import StudyError, one_of
from studies.views.columns import words
from studies.views.differing import Difference
from studies.views.plots.captions import capitalised
from studies.views.plots.sheets import add_head

_BARS = 14
"""Largest number of variables that are drawn."""
_LEAST = 1e-17
"""Relative change that is drawn for none."""


def difference_figure(found: Difference, field: str | None = None) -> Figure:
    """Return a figure of the largest relative changes, and of a number of the runs in both studies.

    Raises
    ------
    StudyError
        if no run has results in both studies, or there is no such number
    """
    if not found.pairs:
        raise StudyError("runs", found.common, "no run has results in both studies")
    changed = [each.variable for each in found.changes if each.variable in found.pairs]
    name = field or [*changed, *found.pairs][0]
    if name not in found.pairs:
        raise StudyError("field", name, one_of(name, found.pairs))
    figure = Figure(figsize=(10.5, 4.6), layout="constrained")
    bars, pairs = figure.subplots(1, 2, width_ratios=(1.0, 1.0))
    _draw_changes(bars, found)
    _draw_pairs(pairs, found, name)
    add_head(figure, f"{found.names[1]} against {found.names[0]}", f"{found.common} runs in common")
    return figure


def _draw_changes(axes: Axes, found: Difference) -> None:
    """Draw the largest relative change of each variable, the largest one at the top."""
    shown = found.changes[:_BARS][::-1]
    sizes = [max(min(each.relative, 1e3), _LEAST) for each in shown]
    axes.barh([words(each.variable) for each in shown], sizes, color="C0")
    if shown:
        axes.set_xscale("log")
        axes.set_xlim(min(sizes) / 10.0, max(sizes) * 3.0)
    else:
        axes.text(0.5, 0.5, "no value differs", ha="center", transform=axes.transAxes)
        axes.set(xticks=[], yticks=[])
    more = f" (of {len(found.changes)} variables)" if len(found.changes) > _BARS else ""
    axes.set_xlabel(f"largest change / largest value{more}")


def _draw_pairs(axes: Axes, found: Difference, name: str) -> None:
    """Draw a number of the second study over that of the first one, and the line of no change."""
    before, after = found.pairs[name]
    both = np.concatenate([before, after])
    ends = [np.nanmin(both), np.nanmax(both)] if np.isfinite(both).any() else [0.0, 1.0]
    axes.plot(ends, ends, color="0.7", linewidth=1.0, zorder=1)
    axes.plot(before, after, "o", markersize=4.0, color="C3", zorder=2)
    title = capitalised(words(name))
    axes.set(xlabel=f"{title}: {found.names[0]}", ylabel=f"{title}: {found.names[1]}")
