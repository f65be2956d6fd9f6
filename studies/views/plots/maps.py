"""Maps of the bodies of one run."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.markers import CARETDOWN

from studies.errors import StudyError
from studies.views.picking import one_run
from studies.views.plots.captions import capitalised, label, setting, wrapped
from studies.views.plots.fields import (
    Window,
    check_field,
    component_of,
    empty_window,
    focus,
    is_half,
    map_axes,
    map_fields,
    too_close,
    usual_field,
)
from studies.views.plots.over import BELOW, draw_patch, draw_wheel, is_patch, within_patch

SIGNED = "RdBu_r"
SEQUENTIAL = "YlOrRd"
_OUTSIDE = "0.86"
_PERCENT, _WORTHWHILE = 99.8, 1.5
"""Colours end at this percentile of the map if the largest value is this many times larger: near a
sharp corner stress is unbounded."""

_SIGNED = 0.1
"""Ratio of the lowest value of a number to the highest; below minus this it has both signs."""
_NOTHING = 1e-3
"""Stress up to which it is rounding [MPa]."""

_AREA, _LONGEST = 26.0, 8.0
"""Area of a map and its longest side [in]."""
_TEXT = 3.2
"""Least length of the lines around a map [in]."""


def map_figure(
    run: xr.Dataset,
    field: str | None = None,
    component: str | None = None,
    zoom: float | None = None,
    window: Window | None = None,
) -> Figure:
    """Return a map of `field` over the bodies, with both halves if one half was computed.

    Parameters
    ----------
    run : data set of one run
    field : variable over two coordinates, such as ``y`` and ``x``, the last of them horizontal; by
        default the residual stress, or the stress if the bodies are not unloaded; of several
        stages the last is drawn
    component : component of a stress tensor; by default the first
    zoom : show only the part within this distance of the contact's centre, or of its edge if half
        of the bodies was computed [mm]
    window : show only this part: horizontal and vertical range, such as (x0, x1, y0, y1) [mm]

    Raises
    ------
    StudyError
        if the data set has no such field or component, or the part has no points
    """
    run = one_run(run)
    field = field or usual_field(run)
    check_field(field, map_fields(run))
    values = component_of(run[field], component)
    across, up = map_axes(values)
    values = values.isel({name: -1 for name in values.dims if name not in (up, across)})
    edge = float(run["contact_half_width"]) if "contact_half_width" in run else 0.0
    if zoom is not None:
        middle = focus(run, zoom)
        values = _inside(values, (middle - zoom, middle + zoom, -zoom, zoom), too_close(zoom))
    elif is_half(run):
        values = whole(values)
    patch = is_patch(values, run)
    if patch and zoom is None and window is None:
        values = within_patch(values, run)
    if window is not None:
        values = _inside(values, window, empty_window(window, across, up))
    signed = "component" in values.coords or bool(values.min() < -_SIGNED * values.max())
    high, note = _limit(values, signed)
    width, height = _size(values)
    sheet = Figure(figsize=(width, height), dpi=150)
    axes = sheet.add_axes((0.0, 0.0, 1.0, 1.0), facecolor=_OUTSIDE)
    entitle(axes, run, values, max(width, _TEXT))
    mesh = axes.pcolormesh(
        values[across], values[up], values, shading="nearest", rasterized=True,
        cmap=SIGNED if signed else SEQUENTIAL, vmin=-high if signed else 0.0, vmax=high,
    )  # fmt: skip
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    seen = edge > 0.0 and bottom <= 0.0 <= top
    ends = [end for end in (-edge, edge) if seen and left <= end <= right]
    if ends:  # marks above the surface: a line would hide the stress at the surface
        axes.plot(
            ends, [0.0] * len(ends), linestyle="none", marker=CARETDOWN, color="k",
            label="edge of contact under load",
        )  # fmt: skip
        axes.legend(loc="upper right", framealpha=0.9, edgecolor="none", fontsize=8)
    axes.set(xlim=(left, right), ylim=(bottom, top))
    if patch:
        draw_patch(axes, run, field, (left, right, bottom, top))
    draw_wheel(axes, values, run)
    axes.set_xlim(left, right)
    axes.set(xlabel=_symbol(run[across]), ylabel=_symbol(run[up]))
    axes.set_aspect("equal")
    beside = axes.inset_axes((1.0 + 0.12 / width, 0.0, 0.16 / width, 1.0))
    over, under = bool((values > high).any()), signed and bool((values < -high).any())
    beyond = {(1, 1): "both", (1, 0): "max", (0, 1): "min"}.get((over, under), "neither")
    bar = sheet.colorbar(mesh, cax=beside, extend=beyond, extendfrac=0.03)
    bar.set_label(wrapped(label(values), max(height, _TEXT / 2.0), 10))
    if "flag_meanings" in values.attrs:
        bar.set_ticks(values.attrs["flag_values"], labels=values.attrs["flag_meanings"].split())
    bar.outline.set_visible(False)
    above = axes.get_legend() if patch else None
    axes.annotate(
        wrapped(note, max(width, _TEXT), 8), (0.0, 0.0), xycoords=above or "axes fraction",
        xytext=(0.0, -4.0 if above else BELOW), textcoords="offset points", va="top", fontsize=8,
        color="0.3",
    )  # fmt: skip
    _fit(sheet, axes)
    return sheet


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
    component = str(values["component"].item()) if "component" in values.coords else ""
    sign = -1.0 if component.count(across) == 1 else 1.0
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


def _limit(values: xr.DataArray, signed: bool) -> tuple[float, str]:
    """Return the largest value of the colours, and a note on values beyond it."""
    known = np.isfinite(values.to_numpy())
    there, area = values.to_numpy()[known], _areas(values)[known]
    size = np.abs(there) if signed else there
    if not size.size or not size.max() > 0.0:
        return 1.0, ""
    if values.attrs.get("units") == "MPa" and size.max() < _NOTHING:
        return 1.0, f"No value is larger than {_NOTHING:g} MPa."
    high = _percentile(size[size > 0.0], area[size > 0.0])
    if size.max() <= _WORTHWHILE * high:
        return float(size.max()), ""
    unit = values.attrs.get("units", "1")
    note = (
        f"Colours end at {'±' if signed else ''}{high:.3g}{'' if unit == '1' else f' {unit}'}: "
        f"{area[size > high].sum() / area.sum():.1%} of the map lies beyond. "
        f"Values go from {there.min():.3g} to {there.max():.3g}."
    )
    return high, note.replace("-", "\N{MINUS SIGN}")


def _areas(values: xr.DataArray) -> np.ndarray:
    """Return the area of each point of a map; points are closer where stress changes rapidly."""
    dx, dy = (np.gradient(values[name].to_numpy()) for name in map_axes(values))
    return np.abs(np.multiply.outer(dy, dx))


def _percentile(values: np.ndarray, area: np.ndarray) -> float:
    """Return the value that is not exceeded on `_PERCENT` of the area."""
    order = np.argsort(values)
    share = np.cumsum(area[order]) / area.sum()
    return float(values[order][np.searchsorted(share, _PERCENT / 100.0)])


def _size(values: xr.DataArray) -> tuple[float, float]:
    """Return width and height of the axes of a map [in]."""
    width, height = (float(np.ptp(values[name].to_numpy())) for name in map_axes(values))
    scale = min(np.sqrt(_AREA / (width * height)), _LONGEST / max(width, height))
    return scale * width, scale * height


def _fit(sheet: Figure, axes: Axes) -> None:
    """Fit the size of the figure to all that is drawn, without changing the size of the axes."""
    size = sheet.get_size_inches()
    sheet.draw_without_rendering()
    ink = sheet.get_tightbbox().padded(0.1)
    sheet.set_size_inches(ink.width, ink.height)
    axes.set_position(
        (-ink.x0 / ink.width, -ink.y0 / ink.height, size[0] / ink.width, size[1] / ink.height)
    )


def entitle(axes: Axes, run: xr.Dataset, values: xr.DataArray, width: float) -> None:
    """Set the title, and below it what distinguishes the run, in lines of `width` inches."""
    quantity = values.attrs.get("long_name", str(values.name))
    component = str(values["component"].item()) if "component" in values.coords else ""
    shown = values.drop_vars("component", errors="ignore").to_dataset(name="values")
    below = axes.set_title(
        wrapped(setting(shown.assign_attrs(run.attrs)), width, 8),
        loc="left", fontsize=8, color="0.3", pad=5.0,
    )  # fmt: skip
    title = axes.annotate(
        capitalised(quantity) + (" σ" if component else ""), (0.0, 1.0), xycoords=below,
        xytext=(0.0, 5.0), textcoords="offset points", weight="bold", fontsize=11,
    )  # fmt: skip
    axes.annotate(
        component, (1.0, 0.0), xycoords=title,
        xytext=(0.5, 0.0), textcoords="offset points", weight="bold", fontsize=8,
    )  # fmt: skip


def _symbol(coordinate: xr.DataArray) -> str:
    """Return the name of a map's axis, with its unit."""
    return f"{coordinate.name} [{coordinate.attrs.get('units', '1')}]"
