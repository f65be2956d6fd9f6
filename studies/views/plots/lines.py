"""Lines of one run: depth profiles, contact along the surface, and histories over increments."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from itertools import cycle

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from solver.tensors import AXES
from studies.errors import StudyError
from studies.views.picking import one_run
from studies.views.plots.captions import label, value_text, words, wrapped
from studies.views.plots.fields import (
    DISTANCE,
    check_field,
    component_of,
    depth_shown,
    focus,
    line_axis,
    line_fields,
    placed,
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

_EACH = len(STYLES)
"""Largest number of values drawn of a dimension of the field."""
_SIZE = (8.0, 4.6)
_LENGTHS = ("s", "depth", *AXES)


def line_figure(
    run: xr.Dataset,
    field: str,
    component: str | None = None,
    zoom: float | None = None,
    over: str | None = None,
) -> Figure:
    """Return `field` over a length or increments, with a line for each value of other dimensions.

    These are passes, stations, stages, bodies and contacts. If there are more passes than lines can
    be distinguished, the first, the last and some between are drawn; then of several stations only
    the middle one.

    Parameters
    ----------
    run : data set of one run, or of one run for each value of ``over``
    field : one of `line_fields`
    component : component of a stress tensor; by default the first
    zoom : show only this length on either side of the contact's centre (of its edge, if half of the
        bodies was computed) or below the surface [mm]; by default depth ends where values have
        decayed
    over : axis of the sweep that ``run`` still has; each of its values has lines

    Raises
    ------
    StudyError
        if there is no such field or component, no value, or too many lines
    """
    run = run if over else one_run(run)
    check_field(field, line_fields(run))
    values = placed(component_of(run[field], component), run)
    along = line_axis(values)
    assert along is not None
    if zoom is not None and along not in _LENGTHS:
        raise StudyError("zoom", zoom, f"{field} lies over {words(along)}, no length: leave it out")
    for name in values.dims:
        values = values.dropna(name, how="all")
    if not values.size:
        raise StudyError("field", field, "has no value in the run selected")
    sizes = values.sizes
    values = _distinguishable(values, [name for name in values.dims if name != along], over)
    others = [name for name in values.dims if name != along]
    at = DISTANCE if DISTANCE in values.coords else along
    if zoom is not None:
        middle = 0.0 if along == "depth" else focus(run, zoom)
        values = values.where(abs(values[along] - middle) <= zoom, drop=True)
        if values.sizes[along] < 2:
            raise too_close(zoom)
    elif along == "depth":
        values = values.isel(depth=slice(depth_shown(values, others)))
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


def _distinguishable(
    values: xr.DataArray, others: Sequence[Hashable], over: str | None
) -> xr.DataArray:
    """Return as many lines as can be distinguished; dimensions with one value are dropped.

    Each value of the axis `over` keeps its lines.
    """
    barred = over is not None and has_bar(values[over])
    if over and not barred and (count := values.sizes[over]) > MOST_LINES:
        allowed = (
            f"has {count} values, of which {MOST_LINES} can be distinguished: select some of them"
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
    """Return the name of a dimension; if some values are not drawn, with both counts."""
    name, all_of_them = words(str(drawn.name)), sizes[drawn.name]
    return name if drawn.size == all_of_them else f"{name} ({drawn.size} of {all_of_them})"
