"""Maps of the bodies of one run."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.markers import CARETDOWN

from studies.views.picking import one_run
from studies.views.plots.captions import capitalised, label, setting, wrapped
from studies.views.plots.fields import Window, map_axes
from studies.views.plots.mapped import is_patch, mapped
from studies.views.plots.over import BELOW, draw_patch, draw_wheel

SIGNED = "RdBu_r"
SEQUENTIAL = "YlOrRd"
_OUTSIDE = "0.86"
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
    stage: str | None = None,
) -> Figure:
    """Return a map of `field` over the bodies, with both halves if one half was computed.

    Parameters
    ----------
    run : data set of one run
    field : variable over two coordinates, such as ``y`` and ``x``, the last of them horizontal; by
        default the residual stress, or the stress if the bodies are not unloaded
    component : component of a stress tensor; by default the first
    zoom : show only the part within this distance of the contact's centre, or of its edge if half
        of the bodies was computed [mm]
    window : show only this part: horizontal and vertical range, such as (x0, x1, y0, y1) [mm]
    stage : of several stages; by default the last

    Raises
    ------
    StudyError
        if the data set has no such field, component or stage, or the part has no points
    """
    run = one_run(run)
    drawn = mapped(run, field, component, zoom, window, stage)
    values, signed, high = drawn.values, drawn.signed, drawn.high
    across, up = map_axes(values)
    edge = float(run["contact_half_width"]) if "contact_half_width" in run else 0.0
    patch = is_patch(values, run)
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
        draw_patch(axes, run, str(values.name), (left, right, bottom, top))
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
        wrapped(drawn.note, max(width, _TEXT), 8), (0.0, 0.0), xycoords=above or "axes fraction",
        xytext=(0.0, -4.0 if above else BELOW), textcoords="offset points", va="top", fontsize=8,
        color="0.3",
    )  # fmt: skip
    _fit(sheet, axes)
    return sheet


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
