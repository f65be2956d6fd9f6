"""The values of a map of one run: both halves, the part that is shown, and the end of its colours.

What draws a map, and what sends its values, take them from here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from solver.model.friction import PatchStatus
from studies.errors import StudyError, one_of
from studies.numbers import typeset_number
from studies.views.columns import unit_of
from studies.views.plots.fields import (
    Window,
    check_field,
    component_name,
    component_of,
    empty_window,
    focus,
    is_half,
    is_odd,
    is_signed,
    map_axes,
    map_fields,
    none_of,
    too_close,
    usual_field,
    without_rounding,
)

STATUS = "patch_status"
"""The variable that a run with its contact in a patch has."""
_MARGIN = 0.2
"""Width of the frame around the contact, over its longer side."""
STAGE = "stage"
"""The dimension of stages."""
_PERCENT, _WORTHWHILE = 99.8, 1.5
"""Colours end at this percentile of the map if the largest value is this many times larger: near a
sharp corner stress is unbounded."""

_SIGNED = 0.1
"""Ratio of the lowest value of a number to the highest; below minus this it has both signs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mapped:
    """The values of a map.

    Attributes
    ----------
    values : over two coordinates, the last of them horizontal; NaN outside the bodies
    signed : whether zero is in the middle of the colours; else they begin at zero
    high : value at which the colours end
    note : which values lie beyond the colours, as a sentence; empty if none
    smooth : whether values are continuous, as within one body: drawn between points, not in cells
    """

    values: xr.DataArray
    signed: bool
    high: float
    note: str
    smooth: bool


def mapped(
    run: xr.Dataset,
    field: str | None = None,
    component: str | None = None,
    zoom: float | None = None,
    window: Window | None = None,
    stage: str | None = None,
) -> Mapped:
    """Return the values of a map of a run, with both halves if one half was computed.

    Arguments and errors are those of `map_figure`; ``run`` is that of `one_run`.
    """
    field = field or usual_field(run)
    check_field(field, map_fields(run))
    values = _at_stage(component_of(run[field], component), stage)
    values = without_rounding(values, run)
    across, up = map_axes(values)
    values = values.isel({name: -1 for name in values.dims if name not in (up, across)})
    if zoom is not None:
        middle = focus(run, zoom)
        values = _inside(values, (middle - zoom, middle + zoom, -zoom, zoom), too_close(zoom))
    elif is_half(run):
        values = whole(values)
    if is_patch(values, run) and zoom is None and window is None:
        values = within_patch(values, run)
    if window is not None:
        values = _inside(values, window, empty_window(window, across, up))
    signed = is_signed(component_name(values)) or bool(values.min() < -_SIGNED * values.max())
    known = np.isfinite(values.to_numpy())
    there, area = values.to_numpy()[known], _areas(values)[known]
    high, note = limit(there, area, signed, values)
    words = "flag_meanings" in values.attrs
    smooth = not (words or is_patch(values, run) or run.sizes.get("body", 1) > 1)
    return Mapped(values=values, signed=signed, high=high, note=note, smooth=smooth)


def _at_stage(values: xr.DataArray, stage: str | None) -> xr.DataArray:
    """Return the values at a stage; all of them if none is named."""
    if stage is None:
        return values
    known = [str(each) for each in values[STAGE].to_numpy()] if STAGE in values.dims else []
    if stage not in known:
        raise StudyError(STAGE, stage, one_of(stage, known) if known else "has one stage only")
    return values.sel({STAGE: stage})


def is_patch(values: xr.DataArray, run: xr.Dataset) -> bool:
    """Whether a map is one of the contact that a run has in a patch."""
    return STATUS in run and map_axes(values) == map_axes(run[STATUS])


def within_patch(values: xr.DataArray, run: xr.Dataset) -> xr.DataArray:
    """Return a map of the contact with a frame around it, and NaN where it is open."""
    across, up = map_axes(values)
    closed = run[STATUS] != PatchStatus.OPEN
    if not closed.any():
        return values
    part = closed.where(closed, drop=True)
    margin = _MARGIN * max(float(np.ptp(part[name].to_numpy())) for name in (across, up))
    ends = {
        name: slice(float(part[name][0]) - margin, float(part[name][-1]) + margin)
        for name in (across, up)
    }
    return values.where(closed).sel(ends)


def whole(values: xr.DataArray) -> xr.DataArray:
    """Return a map of both halves of bodies symmetric about x = 0, from the half x >= 0.

    For a section the horizontal axis is z. Shear with one index across the line of symmetry changes
    sign. A column on the line is not repeated. If the map begins away from the line, values between
    the halves are NaN.
    """
    across, _ = map_axes(values)
    values = values.isel({across: values[across].to_numpy() >= 0.0})
    x = values[across].to_numpy()
    if (start := 2.0 * x[0] - x[1]) > 0.0:  # one step from the map towards the line
        before = values.isel({across: [0]}).assign_coords({across: [start]}) * np.nan
        values = xr.concat([before, values], across)
    sign = -1.0 if is_odd(component_name(values), across) else 1.0
    other = sign * values.isel({across: slice(None, 0 if x[0] < 1e-6 * x[-1] else None, -1)})
    both = xr.concat([other.assign_coords({across: -other[across]}), values], across)
    return both.assign_attrs(values.attrs)


def _inside(values: xr.DataArray, window: Window, nothing: StudyError) -> xr.DataArray:
    """Return the part of a map in a window, or raise the error ``nothing`` if it is empty."""
    across, up = map_axes(values)
    x, y = (values[name].to_numpy() for name in (across, up))
    x0, x1, y0, y1 = window
    part = values.isel({across: (x0 <= x) & (x <= x1), up: (y0 <= y) & (y <= y1)})
    if min(part.shape) < 2 or not part.notnull().any():
        raise nothing
    return part


def limit(there: np.ndarray, area: np.ndarray, signed: bool, of: xr.DataArray) -> tuple[float, str]:
    """Return the largest value of the colours, and a note on values beyond it.

    Parameters
    ----------
    there : (n,) finite values
    area : (n,) of each of them
    of : the quantity, with its unit
    """
    size, unit = np.abs(there) if signed else there, unit_of(of)
    if not size.size or not size.max() > 0.0:
        return 1.0, none_of(of) if unit == "MPa" else ""
    high = _percentile(size[size > 0.0], area[size > 0.0])
    if size.max() <= _WORTHWHILE * high:
        return float(size.max()), ""
    least, most = (typeset_number(float(each)) for each in (there.min(), there.max()))
    beyond = f"{area[size > high].sum() / area.sum():.1%} of the map lies beyond"
    return high, (
        f"Colours end at {'±' if signed else ''}{typeset_number(high, 3)}"
        f"{f' {unit}' if unit else ''}: {beyond}. Values go from {least} to {most}."
    )


def _areas(values: xr.DataArray) -> np.ndarray:
    """Return the area of each point of a map; points are closer where stress changes rapidly."""
    dx, dy = (np.gradient(values[name].to_numpy()) for name in map_axes(values))
    return np.abs(np.multiply.outer(dy, dx))


def _percentile(values: np.ndarray, area: np.ndarray) -> float:
    """Return the value that is not exceeded on `_PERCENT` of the area."""
    order = np.argsort(values)
    share = np.cumsum(area[order]) / area.sum()
    return float(values[order][np.searchsorted(share, _PERCENT / 100.0)])
