"""Lines of one run: profiles along depth, what acts on the contact surface, and its course."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from itertools import cycle

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from studies.errors import StudyError
from studies.views.picking import one_run
from studies.views.plots.captions import label, value_text, words, wrapped
from studies.views.plots.fields import (
    ALONG,
    check_field,
    component_of,
    focus,
    line_fields,
    too_close,
)
from studies.views.plots.legends import (
    MOST_LINES,
    STYLES,
    add_bar,
    add_legend,
    colours_of,
    has_bar,
    is_number,
)
from studies.views.plots.maps import entitle

_DECAYED = 0.02
"""Depth is shown to where nothing larger than this part of the peak is left."""
_EACH = len(STYLES)
"""Most values that are drawn of a dimension of the field."""
_SIZE = (8.0, 4.6)
_LENGTHS = ("s", "depth")
_DISTANCE = "distance"


def line_figure(
    run: xr.Dataset,
    field: str,
    component: str | None = None,
    zoom: float | None = None,
    over: str | None = None,
) -> Figure:
    """Return `field` over a length or increments, with a line for each of the rest.

    The rest are passes, stations, stages, bodies, contacts.

    Of more passes than can be distinguished the first, the last and some between are drawn, and of
    several stations then the middle one.

    `zoom` shows only that length on either side of the contact's centre (of its edge, where half
    of the bodies was computed), or below the surface [mm]. Without it, depth ends where the values
    have decayed. With `over`, the axis of the sweep that `run` still has, each of its values has
    lines.
    """
    run = run if over else one_run(run)
    check_field(field, line_fields(run))
    values = _placed(component_of(run[field], component), run)
    along = next(name for name in ALONG if name in values.dims)
    if zoom is not None and along not in _LENGTHS:
        raise StudyError("zoom", zoom, f"{field} lies over {words(along)}, no length: leave it out")
    for name in values.dims:
        values = values.dropna(name, how="all")
    if not values.size:
        raise StudyError("field", field, "has no value in the run selected")
    sizes = values.sizes
    values = _told_apart(values, [name for name in values.dims if name != along], over)
    others = [name for name in values.dims if name != along]
    at = _DISTANCE if _DISTANCE in values.coords else along
    if zoom is not None:
        middle = focus(run, zoom) if along == "s" else 0.0
        values = values.where(abs(values[along] - middle) <= zoom, drop=True)
        if values.sizes[along] < 2:
            raise too_close(zoom)
    elif along == "depth":
        values = values.isel(depth=slice(_depth_shown(values, others)))
    sheet = Figure(figsize=_SIZE, dpi=150, layout="constrained")
    axes = sheet.add_subplot()
    entitle(axes, run, values, _SIZE[0] - 0.8)
    several = [values[name] for name in others]
    barred = bool(several) and has_bar(several[0])
    named = several[1:] if barred else several
    alone = len(several) == 1 and not is_number(several[0])
    for first, colour in enumerate(colours_of(several[0]) if several else ["C0"]):
        styles = cycle(STYLES[first % len(STYLES) :] if alone else STYLES)
        rests = np.ndindex(*(each.size for each in several[1:]))
        for style, rest in zip(styles, rests, strict=False):
            line = values.isel(dict(zip(others, (first, *rest), strict=False))).dropna(along)
            if line.size:
                name = ", ".join(value_text(line[each.name]) for each in named)
                axes.plot(
                    line[at],
                    line,
                    linestyle=style,
                    color=colour,
                    label=name,
                    linewidth=1.0 if barred else 1.6,
                )
    axes.axhline(0.0, color="0.35", linewidth=0.8, zorder=0)
    axes.grid(color="0.92")
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.margins(x=0.0)
    axes.set(xlabel=label(values[at]), ylabel=wrapped(label(values), _SIZE[1] - 1.2, 10))
    if barred:
        add_bar(axes, several[0])
    if named:
        add_legend(axes, [_heading(each, sizes) for each in named], styles=barred)
    return sheet


def _placed(values: xr.DataArray, run: xr.Dataset) -> xr.DataArray:
    """Return values along lines or contact surfaces with the distance from their start [mm]."""
    distance = run.get(f"{str(values.name).partition('_')[0]}_s")
    there = distance is not None and set(distance.dims) <= set(values.dims)
    return values.assign_coords({_DISTANCE: distance}) if there else values


def _told_apart(values: xr.DataArray, others: Sequence[Hashable], over: str | None) -> xr.DataArray:
    """Return as many lines as can be distinguished; dimensions with one value left are dropped.

    Each value of the axis `over` keeps its lines.
    """
    barred = over is not None and has_bar(values[over])
    if over and not barred and (count := values.sizes[over]) > MOST_LINES:
        allowed = (
            f"has {count} values, of which {MOST_LINES} can be told apart: select some of them"
        )
        raise StudyError("over", over, allowed)
    own = [name for name in others if name != over]
    for name in own:
        if values.sizes[name] > _EACH:
            among = np.linspace(0.0, values.sizes[name] - 1.0, _EACH)
            values = values.isel({name: among.round().astype(int)})
    counted, most = (own, len(STYLES)) if barred else (others, MOST_LINES)
    for name in reversed(own):
        if math.prod(values.sizes[each] for each in counted) > most:
            values = values.isel({name: [values.sizes[name] // 2]})
    return values.squeeze([name for name in others if values.sizes[name] == 1])


def _heading(drawn: xr.DataArray, sizes: Mapping[Hashable, int]) -> str:
    """Return the name of a dimension, and of how many values those drawn are some."""
    name, all_of_them = words(str(drawn.name)), sizes[drawn.name]
    return name if drawn.size == all_of_them else f"{name} ({drawn.size} of {all_of_them})"


def _depth_shown(values: xr.DataArray, others: Sequence[Hashable]) -> int:
    """Return the number of points down to where nothing worth showing is left."""
    largest = abs(values).max(others).to_numpy()
    shown = np.flatnonzero(largest > _DECAYED * largest.max())
    return int(shown[-1]) + 2 if shown.size else values.sizes["depth"]
