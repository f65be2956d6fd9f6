"""Lines of one run: depth profiles, contact along the surface, and histories over increments."""

from __future__ import annotations

import json
import math
from collections.abc import Hashable, Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from solver.tensors import AXES
from studies.errors import StudyError, one_of
from studies.views.columns import words
from studies.views.picking import one_run, sweep_axes
from studies.views.plots.captions import DISTANCE, axis_label, label, value_text, wrapped
from studies.views.plots.fields import (
    REPEATED,
    Window,
    check_field,
    component_of,
    depth_shown,
    focus,
    line_axis,
    line_fields,
    none_of,
    placed,
    too_close,
    without_rounding,
)
from studies.views.plots.mapped import STAGE
from studies.views.plots.maps import entitle
from studies.views.plots.sheets import (
    STYLES,
    add_bar,
    add_legend,
    colours_of,
    has_bar,
    is_number,
    plain_axes,
)
from studies.views.rules import MOST_LINES

_EACH = len(STYLES)
"""Largest number of values drawn of a dimension of the field."""
_SIZE = (8.0, 4.6)
_LENGTHS = ("s", "depth", *AXES)
INCREMENT, TIME, AGAINST = "increment", "increment_time", "against"
"""Dimension of courses, the variable of their time, and the coordinate of what they lie over."""
INSTANT, DIAGRAM = "instant", {"fatigue_path_shear": "fatigue_path_hydrostatic"}
"""Dimension of instants of a cycle; fields that are usually drawn over another one."""
_LIMIT = "fatigue_path_limit"
"""The field that limits those."""
PART, CONTACT = "part", "contact"
"""Dimensions of motions and reactions, and of contact pairs."""
_RELEASED = ("residual_stress", "plastic_strain", "residual_profile", "surface_residual")
"""Variables that only a run has whose bodies are released at the end."""
_NOTHING, _SHORT, _BESIDE = 1e-3, 0.5, 0.25
"""Share of the peak below which a line is zero; largest share of a line outside of which it may be
left out; margin beside what is left, over its length."""


def line_figure(
    run: xr.Dataset,
    field: str,
    component: str | None = None,
    zoom: float | None = None,
    over: str | None = None,
    window: Window | None = None,
    against: str | None = None,
) -> Figure:
    """Return `field` over a length or increments, with a line for each value of other dimensions.

    These are passes, stations, stages, bodies and contacts. If there are more passes than lines can
    be distinguished, the first, the last and some between are drawn; then of several stations only
    the middle one, and of several stages the last one under load. Ends of stages are marked on
    lines over increments.

    Parameters
    ----------
    run : data set of one run, or of one run for each value of ``over``
    field : one of `line_fields`
    component : component of a stress tensor; by default the first
    zoom : show only this length on either side of the contact's centre (of its edge, if half of the
        bodies was computed) or below the surface [mm]; by default depth ends where values have
        decayed
    over : axis of the sweep that ``run`` still has, each of its values has lines; or a dimension of
        the field, of which alone several values are drawn
    window : show only this part: horizontal and vertical range
    against : another variable over the same increments, which is horizontal: a loop of force over
        displacement. Of several parts it is that which moves most, for each contact of its bodies

    Raises
    ------
    StudyError
        if there is no such field or component, no value, or too many lines
    """
    against = DIAGRAM.get(field) if against is None and over is None else against
    values, run, at, sizes = _drawn(run, field, component, zoom, over, window, against)
    along = line_axis(values)
    others = [name for name in values.dims if name != along]
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
                    marker="o" if along in REPEATED else None,
                    markersize=4.0,
                )
                _mark_stages(axes, run, line, at)
    if values.attrs.get("units") == "MPa" and not (values.fillna(0.0) != 0.0).any():
        axes.set_ylim(-1.0, 1.0)
        axes.annotate(
            none_of(values), (0.5, 0.55), xycoords="axes fraction", ha="center", color="0.3"
        )
    axes.axhline(0.0, color="0.35", linewidth=0.8, zorder=0)
    if against is not None and against == DIAGRAM.get(field):
        _draw_limit(axes, run, against)
    plain_axes(axes)
    axes.margins(x=0.03 if against else 0.0)
    if along in REPEATED:
        axes.margins(x=0.03)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set(xlabel=axis_label(values[at]), ylabel=wrapped(label(values), _SIZE[1] - 1.2, 10))
    if window is not None:
        _show_part(axes, window)
    if barred:
        add_bar(axes, several[0])
    if named:
        add_legend(axes, [_heading(each, sizes) for each in named], styles=barred)
    return sheet


def _draw_limit(axes: Axes, run: xr.Dataset, against: str) -> None:
    """Draw the line that a path must stay below, a little beyond the path."""
    p, limit = (run[name].to_numpy() for name in (against, _LIMIT))
    known = np.isfinite(p)
    slope, height = (
        np.polyfit(p[known], limit[known], 1) if np.ptp(p[known]) else (0.0, limit[known][0])
    )
    ends = p[known].min() - 0.1 * np.ptp(p[known]), p[known].max() + 0.1 * np.ptp(p[known])
    axes.plot(ends, [slope * end + height for end in ends], "--", color="0.15", linewidth=1.2)
    axes.annotate(
        "limit", (ends[1], slope * ends[1] + height), xytext=(0, 8), textcoords="offset points",
        ha="right", fontsize=8, color="0.15",
    )  # fmt: skip


def _show_part(axes: Axes, window: Window) -> None:
    x0, x1, y0, y1 = window
    if not (x0 < x1 and y0 < y1):
        allowed = "must be X0 X1 Y0 Y1 with X0 < X1 and Y0 < Y1"
        raise StudyError("window", list(window), allowed)
    axes.set(xlim=(x0, x1), ylim=(y0, y1))


def _drawn(
    run: xr.Dataset,
    field: str,
    component: str | None,
    zoom: float | None,
    over: str | None,
    window: Window | None,
    against: str | None,
) -> tuple[xr.DataArray, xr.Dataset, str, Mapping[Hashable, int]]:
    """Return the values of the lines, their runs, what is horizontal, and all sizes of the field.

    The arguments are those of `line_figure`.
    """
    check_field(field, line_fields(run))
    own = over if over in run[field].dims and over not in sweep_axes(run) else None
    swept = over if own is None else None
    run = run if swept else one_run(run)
    values = placed(component_of(run[field], component), run)
    along = line_axis(values)
    assert along is not None
    if zoom is not None and (along not in _LENGTHS or against):
        at = against or words(along)
        raise StudyError("zoom", zoom, f"{field} lies over {at}, no length: leave it out")
    if INCREMENT in values.dims and TIME in run:
        values = values.assign_coords({TIME: run[TIME]})  # of several runs each has its own
    if against is not None:
        other = _other(run, values, against)
        values = values.where(other.notnull()).assign_coords({AGAINST: other})
    for name in values.dims:
        values = values.dropna(name, how="all")
    if not values.size:
        raise StudyError("field", field, "has no value in the run selected")
    values, sizes = without_rounding(values, run), values.sizes
    if own is not None:
        for name in values.dims:
            if name not in (along, own):
                values = values.isel({name: [_usual(values[name], run)]})
    values = _distinguishable(values, [name for name in values.dims if name != along], swept, run)
    others = [name for name in values.dims if name != along]
    at = DISTANCE if DISTANCE in values.coords else along
    at = at if against is None else AGAINST
    if zoom is not None:
        middle = 0.0 if along == "depth" else focus(run, zoom)
        values = values.where(abs(values[along] - middle) <= zoom, drop=True)
        if values.sizes[along] < 2:
            raise too_close(zoom)
    elif along == "depth":
        values = values.isel(depth=slice(depth_shown(values, others)))
    elif window is None and along in (*_LENGTHS, "fraction"):
        values = _happening(values, along, others)
    return values, run, at, sizes


def _other(run: xr.Dataset, values: xr.DataArray, name: str) -> xr.DataArray:
    """Return the variable that is horizontal, over dimensions that the field has."""
    over = next((each for each in (INCREMENT, INSTANT) if each in values.dims), None)
    known = [
        str(each)
        for each, other in run.data_vars.items()
        if over in other.dims and other.dtype.kind == "f"
    ]
    if over is None:
        allowed = f"must be left out: {values.name} does not lie over increments or a cycle"
        raise StudyError("against", name, allowed)
    if name not in known:
        raise StudyError("against", name, one_of(name, known))
    other = run[name]
    if not other.notnull().any():
        raise StudyError("against", name, "has no value in the run selected")
    if PART in other.dims and CONTACT in values.dims:
        each_of = [_moved(other, sides) for sides in _sides(run, values[CONTACT])]
        parts = [str(each[PART].item()) for each in each_of]
        other = xr.concat([each.drop_vars(PART) for each in each_of], values[CONTACT])
    else:
        for each in [each for each in other.dims if each not in values.dims]:
            other = _moved(other, other[each].to_numpy().tolist(), str(each))
        parts = [str(other[PART].item())] if PART in {*other.coords} - {*other.dims} else []
    long_name = str(other.attrs.get("long_name", words(name)))
    if parts:
        long_name = f"{long_name} ({', '.join(dict.fromkeys(parts))})"
    other = other.assign_attrs(long_name=long_name)
    return other.drop_vars([each for each in other.coords if each not in other.dims])


def _moved(other: xr.DataArray, among: Sequence[Any], over: str = PART) -> xr.DataArray:
    """Return a variable over increments at that one of some values of a dimension that moves most.

    If none of them moves, it is one of all.
    """
    ways = np.ptp(other.fillna(0.0).transpose(over, ...).to_numpy(), axis=-1)
    ways = ways.reshape(other.sizes[over], -1).max(axis=1)
    own = np.where(np.isin(other[over].to_numpy(), among), ways, 0.0)
    return other.isel({over: int((own if own.any() else ways).argmax())})


def _sides(run: xr.Dataset, contacts: xr.DataArray) -> list[tuple[str, str]]:
    """Return the bodies of each contact of a run of a scene file."""
    pairs = json.loads(run.attrs.get("scene_file", "{}")).get("contacts", [])
    known = {
        each["name"]: (each["slave"].split(".")[0], each["master"].split(".")[0]) for each in pairs
    }
    return [known.get(str(name), ("", "")) for name in contacts.to_numpy()]


def _happening(values: xr.DataArray, along: Hashable, others: Sequence[Hashable]) -> xr.DataArray:
    """Return the part of lines outside of which they are zero, with a margin, if it is short."""
    largest = abs(values).max(others).to_numpy()
    there = np.flatnonzero(largest > _NOTHING * np.nanmax(largest))
    if not there.size or there[-1] - there[0] > _SHORT * len(largest):
        return values
    margin = max(round(_BESIDE * (there[-1] - there[0])), 1)
    return values.isel({along: slice(max(there[0] - margin, 0), there[-1] + margin + 1)})


def _mark_stages(axes: Axes, run: xr.Dataset, line: xr.DataArray, at: Hashable) -> None:
    """Mark where stages end on a line over increments; stage k ends at time k."""
    if TIME not in line.coords or STAGE not in run.coords:
        return
    time = line[TIME].to_numpy()
    ends = [k for k in range(1, round(float(np.nanmax(time))) + 1) if np.isclose(time, k).any()]
    names = [str(each) for each in np.atleast_1d(run[STAGE].to_numpy())]
    if len(names) != len(ends) or len(ends) > MOST_LINES:
        return
    for name, end in zip(names, ends, strict=True):
        k = int(np.flatnonzero(np.isclose(time, end))[-1])
        axes.plot(line[at][k], line[k], "o", color="k", markersize=3.0, label="_end")
        x, y = float(line[at][k]), float(line[k])
        right = x > float(line[at].min()) + 0.9 * np.ptp(line[at].to_numpy())
        axes.annotate(
            name, (x, y), xytext=(-3.0 if right else 3.0, 3.0), fontsize=7, color="0.3",
            textcoords="offset points", ha="right" if right else "left",
        )  # fmt: skip


def _usual(dimension: xr.DataArray, run: xr.Dataset) -> int:
    """Return the position of the one value of a dimension that is drawn.

    It is the middle one; of stages the last under load: a run that is released ends without load.
    """
    count = dimension.size
    if dimension.name != STAGE:
        return count // 2
    released = any(name in run for name in _RELEASED)
    return max(count - 2, 0) if released else count - 1


def _distinguishable(
    values: xr.DataArray, others: Sequence[Hashable], over: str | None, run: xr.Dataset
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
            values = values.isel({name: [_usual(values[name], run)]})
    return values.squeeze([name for name in others if values.sizes[name] == 1])


def _heading(drawn: xr.DataArray, sizes: Mapping[Hashable, int]) -> str:
    """Return the name of a dimension; if some values are not drawn, with both counts."""
    name, all_of_them = words(str(drawn.name)), sizes[drawn.name]
    return name if drawn.size == all_of_them else f"{name} ({drawn.size} of {all_of_them})"
