"""Computed profiles drawn with the published numbers in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from studies.views.comparison.profiles import Computed
from studies.views.comparison.reference import STRAIN, Published
from studies.views.comparison.table import PROFILES

SHOWN = ("xx", "zz", STRAIN)
"""Profiles drawn, a column each."""

_COLOURS = ("#1f5fa8", "#c8501e", "#3a8a4d", "#7a4fa0")
"""Of few passes; more have colours in their order."""
_NAMED = 12
"""Most passes that the legend names."""
_DEEPEST = 25.0
"""Depth shown [mm]."""
_PANEL = (3.7, 1.9)
"""Width and height of a panel [in]."""


def comparison_figure(computed: Computed, published: Sequence[Published]) -> Figure:
    """Return the profiles below mid-track with what was published of them.

    A row a case, a column a profile. The finest computation is a thick line, coarser ones are
    thin. A dot is a published value where its depth was published, or at the surface; a dotted
    line is a depth published without a value; an arrow starts from a published bound.
    """
    cases = list(dict.fromkeys(case for case, _ in computed.profiles))
    width, height = _PANEL
    size = (width * len(SHOWN), height * len(cases) + 0.9)
    sheet = Figure(figsize=size, dpi=130, layout="constrained")
    panels = sheet.subplots(len(cases), len(SHOWN), sharex=True, squeeze=False)
    colours = _colours_of(sorted({number for _, number in computed.profiles}))
    for case, row in zip(cases, panels, strict=True):
        for component, axes in zip(SHOWN, row, strict=True):
            _draw(axes, computed, case, component, colours)
            for each in published:
                if (each.case, each.component, each.against) == (case, component, None):
                    _mark(axes, each, colours)
            _furnish(axes)
        row[0].annotate(case, (0.97, 0.93), xycoords="axes fraction", ha="right", va="top",
                        weight="bold")  # fmt: skip
    for component, column in zip(SHOWN, panels.T, strict=True):
        _entitle(column, component)
    drawn = [axes.dataLim.x1 for axes in panels.flat if axes.has_data()]
    panels[0, 0].set_xlim(-0.5, min(_DEEPEST, max(drawn)))
    sheet.legend(
        handles=_legend(colours),
        loc="outside lower center", ncols=6, frameon=False, fontsize=9,
    )  # fmt: skip
    return sheet


def _colours_of(passes: Sequence[int]) -> dict[int, Any]:
    """Return a colour for each pass."""
    several = len(passes) > len(_COLOURS)
    ordered = colormaps["viridis"](np.linspace(0.0, 0.85, len(passes)))
    return dict(zip(passes, ordered if several else _COLOURS, strict=False))


def _draw(
    axes: Axes, computed: Computed, case: str, component: str, colours: Mapping[int, Any]
) -> None:
    """Draw the profiles of all passes and levels of a case."""
    for (name, number), levels in computed.profiles.items():
        if name != case:
            continue
        for level, profile in levels.items():
            if component in profile.values:
                finest = level == min(levels)
                axes.plot(
                    profile.depth, profile.values[component], color=colours[number],
                    linewidth=1.7 if finest else 0.6, alpha=1.0 if finest else 0.75,
                )  # fmt: skip


def _mark(axes: Axes, published: Published, colours: Mapping[int, Any]) -> None:
    """Draw a published feature: a dot, an arrow from a bound, or a line at its depth."""
    colour = colours.get(published.pass_number, "0.4")
    depth = 0.0 if published.quantity == "surface" else published.depth
    if not published.has_value:
        axes.axvline(published.depth_bounds[0], color=colour, linestyle=":", linewidth=1.1)
    elif published.value is not None and depth is not None:
        axes.plot(
            depth, published.value, "o", color=colour, markersize=6.0, markeredgecolor="white",
            zorder=4, clip_on=False,
        )  # fmt: skip
    elif published.value is not None:
        axes.axhline(published.value, color=colour, linestyle=":", linewidth=1.1)
    else:
        searched = (published.top + (published.bottom or _DEEPEST)) / 2
        for bound, way in ((published.low, 1.0), (published.high, -1.0)):
            if bound is not None:
                axes.annotate(
                    "", (searched if depth is None else depth, bound), xytext=(0.0, 22.0 * way),
                    textcoords="offset points",
                    arrowprops={"arrowstyle": "<|-", "color": colour, "shrinkB": 0.0},
                )  # fmt: skip


def _furnish(axes: Axes) -> None:
    axes.axhline(0.0, color="0.35", linewidth=0.7, zorder=0)
    axes.grid(color="0.92")
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8)


def _entitle(column: Sequence[Axes], component: str) -> None:
    """Head a column; stresses are drawn to one scale, strains of the cases differ too much."""
    if component == STRAIN:
        column[0].set_title("plastic strain", fontsize=10)
    else:
        column[0].set_title(f"residual {PROFILES[component]} [MPa]", fontsize=10)
        ends = np.array([axes.get_ylim() for axes in column])
        for axes in column:
            axes.set_ylim(ends[:, 0].min(), ends[:, 1].max())
    column[-1].set_xlabel("depth below the surface [mm]", fontsize=9)


def _legend(colours: Mapping[int, Any]) -> list[Line2D]:
    """Return what is explained; of many passes the first, the last and some between."""
    among = np.linspace(0, len(colours) - 1, min(len(colours), _NAMED)).round().astype(int)
    passes = [list(colours)[i] for i in among]
    lines = [Line2D([], [], color=colours[n], linewidth=1.7, label=f"pass {n}") for n in passes]
    return [
        *lines,
        Line2D([], [], color="0.4", linewidth=0.6, label="coarser"),
        Line2D([], [], color="0.4", marker="o", linestyle="", label="published"),
        Line2D([], [], color="0.4", marker="$\\uparrow$", linestyle="", label="published bound"),
        Line2D([], [], color="0.4", linestyle=":", label="published depth"),
    ]
