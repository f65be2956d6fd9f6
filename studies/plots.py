"""Figures of one run: maps of the bodies, profiles, and what acts on the contact surface."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.errors import StudyError
from studies.reading import one_run

SIGNED = "RdBu_r"
SEQUENTIAL = "YlOrRd"
_OUTSIDE = "0.88"
_PERCENT = 99.5
"""Colours saturate beyond this percentile: next to a sharp corner stress grows without bound."""


def figure(
    run: xr.Dataset,
    field: str = "residual_stress",
    component: str | None = None,
    zoom: float | None = None,
) -> Figure:
    """Return the figure that suits `field`: a map, or lines along the surface or along depth."""
    known = _field(run, field, ("y", "x"), ("s",), ("depth",))
    make = map_figure if "y" in known.dims else line_figure
    return make(run, field, component, zoom)


def map_figure(
    run: xr.Dataset,
    field: str = "residual_stress",
    component: str | None = None,
    zoom: float | None = None,
) -> Figure:
    """Return a map of `field` over the bodies.

    Parameters
    ----------
    run : data set of one run
    field : variable over ``y`` and ``x``
    component : of a stress tensor; the first one by default
    zoom : show only what lies within this distance of the edge of the contact [mm]

    Raises
    ------
    StudyError
        when the data set has no such field or component, or the zoom holds no points
    """
    run = one_run(run)
    values = _component(run, _field(run, field, ("y", "x")), component).transpose("y", "x")
    edge = float(run["s"].max()) if "s" in run else 0.0
    if zoom is not None:
        values = _near(values, edge, zoom)
    signed = "component" in values.coords
    low, high, beyond = _limits(values.to_numpy(), signed)
    width, height = (float(np.ptp(values[name].to_numpy())) for name in ("x", "y"))
    sheet, axes = _sheet(run, values, width / height)
    axes.set_facecolor(_OUTSIDE)
    mesh = axes.pcolormesh(
        values["x"], values["y"], values, shading="nearest", rasterized=True,
        cmap=SIGNED if signed else SEQUENTIAL, vmin=low, vmax=high,
    )  # fmt: skip
    frame = (*axes.get_xlim(), *axes.get_ylim())
    axes.plot([frame[0], frame[1]], [0.0, 0.0], color="0.25", linewidth=0.8)
    start = -edge if frame[0] < -edge else frame[0]
    axes.plot(
        [start, edge], [0.0, 0.0], color="k", linewidth=2.2, solid_capstyle="butt",
        label="contact surface",
    )  # fmt: skip
    axes.set(xlim=frame[:2], ylim=frame[2:], aspect="equal")
    axes.set(xlabel=_label(run["x"]), ylabel=_label(run["y"]))
    axes.legend(loc="upper right", frameon=True, framealpha=0.9, edgecolor="none", fontsize=9)
    bar = sheet.colorbar(mesh, ax=axes, extend=beyond, shrink=0.92, aspect=28, pad=0.02)
    bar.set_label(_label(values))
    bar.outline.set_visible(False)
    return sheet


def line_figure(
    run: xr.Dataset,
    field: str,
    component: str | None = None,
    zoom: float | None = None,
) -> Figure:
    """Return `field` along the surface or along depth, a line for each stage, body or station.

    `zoom` shows only that length next to the edge of the contact, or below the surface [mm].
    """
    run = one_run(run)
    values = _component(run, _field(run, field, ("s",), ("depth",)), component)
    along = "s" if "s" in values.dims else "depth"
    sheet, axes = _sheet(run, values)
    others = [name for name in values.dims if name != along]
    for at in np.ndindex(*(values.sizes[name] for name in others)):
        line = values.isel(dict(zip(others, at, strict=True)))
        name = ", ".join(_value(line[each]) for each in others)
        axes.plot(line[along], line, label=name, linewidth=1.7)
    axes.axhline(0.0, color="0.35", linewidth=0.8, zorder=0)
    axes.grid(color="0.92")
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.margins(x=0.0)
    if zoom is not None:
        end = float(values[along].max())
        axes.set_xlim((max(0.0, end - zoom), end) if along == "s" else (0.0, min(zoom, end)))
    axes.set(xlabel=_label(run[along]), ylabel=_label(values))
    if others:
        axes.legend(frameon=False, title=", ".join(_words(str(name)) for name in others))
    return sheet


def _field(run: xr.Dataset, field: str, *dimensions: tuple[str, ...]) -> xr.DataArray:
    """Return the variable `field`, which must lie over one of the sets of `dimensions`."""
    suitable = [
        str(name)
        for name, variable in run.data_vars.items()
        if any(set(wanted) <= set(variable.dims) for wanted in dimensions)
    ]
    if field not in suitable:
        raise StudyError("field", field, f"must be one of {', '.join(suitable)}")
    return run[field]


def _component(run: xr.Dataset, values: xr.DataArray, component: str | None) -> xr.DataArray:
    """Return one component of a tensor; a scalar field as it is."""
    if "component" not in values.dims:
        if component is not None:
            raise StudyError("component", component, f"{values.name} is a scalar: leave it out")
        return values
    known = [str(name) for name in run["component"].to_numpy()]
    if component is not None and component not in known:
        raise StudyError("component", component, f"must be one of {', '.join(known)}")
    return values.sel(component=component or known[0])


def _near(values: xr.DataArray, edge: float, zoom: float) -> xr.DataArray:
    near = values.where((abs(values["x"] - edge) <= zoom) & (abs(values["y"]) <= zoom), drop=True)
    if min(near.shape) < 2:
        raise StudyError("zoom", zoom, "must be larger: it holds no points of the map")
    return near


def _limits(values: np.ndarray, signed: bool) -> tuple[float, float, str]:
    """Return the range of colours, and on which side values lie beyond it."""
    there = values[np.isfinite(values)]
    if not there.size or not there.any():
        return (-1.0 if signed else 0.0), 1.0, "neither"
    if not signed:
        high = float(np.percentile(there[there > 0.0], _PERCENT))
        return 0.0, high, "max" if there.max() > high else "neither"
    high = float(np.percentile(np.abs(there), _PERCENT)) or float(np.abs(there).max())
    over, under = there.max() > high, there.min() < -high
    return -high, high, {(1, 1): "both", (1, 0): "max", (0, 1): "min"}.get((over, under), "neither")


def _sheet(run: xr.Dataset, values: xr.DataArray, aspect: float = 1.35) -> tuple[Figure, Axes]:
    """Return an empty figure with the run's title; `aspect` is width to height of its axes."""
    width = float(np.clip(4.6 * aspect + 1.9, 5.5, 14.0))
    sheet = Figure(figsize=(width, 5.6), dpi=150, layout="constrained")
    axes = sheet.add_subplot()
    quantity = values.attrs.get("long_name", str(values.name))
    of = f", {values['component'].item()}" if "component" in values.coords else ""
    title = f"{quantity[:1].upper()}{quantity[1:]}{of}\n"
    axes.set_title(title, loc="left", weight="bold", fontsize=11)
    axes.text(0.0, 1.02, _setting(run), transform=axes.transAxes, fontsize=9, color="0.3")
    return sheet, axes


def _setting(run: xr.Dataset) -> str:
    """Return the scene and the parameters that tell this run from others, in words."""
    parameters: Mapping[str, Any] = json.loads(run.attrs["parameters"])
    state = parameters.get("state")
    words = [
        f"{str(name).replace('_', ' ')} {_value(each)}"
        for name, each in run.coords.items()
        if each.ndim == 0
    ]
    return "  ·  ".join([run.attrs["scene"], *([_words(state)] if state else []), *words])


def _value(coordinate: xr.DataArray) -> str:
    """Return a coordinate's single value with its unit."""
    value = coordinate.item()
    if isinstance(value, str):
        return _words(value)
    unit = coordinate.attrs.get("units", "1")
    return f"{value:g}" if unit == "1" else f"{value:g} {unit}"


def _label(variable: xr.DataArray) -> str:
    """Return what an axis shows, with its unit."""
    unit = variable.attrs.get("units", "1")
    name = variable.attrs.get("long_name", str(variable.name))
    return name if unit == "1" else f"{name} [{unit}]"


def _words(identifier: str) -> str:
    return identifier.replace("_", " ")
