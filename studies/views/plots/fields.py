"""The variables of a data set that can be drawn, by their dimensions, and parts of them."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence

import numpy as np
import xarray as xr

from solver.tensors import AXES, INVARIANTS, components
from solver.tensors import component as derived
from studies.definition.vocabulary import SYMMETRIC
from studies.errors import StudyError, one_of
from studies.numbers import rounding
from studies.views.picking import over_runs, sweep_axes
from studies.views.plots.captions import DISTANCE

Window = Sequence[float]
"""Part of a map: horizontal range, vertical range [mm]."""

_RESIDUAL, _STRESS = "residual_stress", "map_stress"
ALONG = ("s", "depth", "increment", "fraction", "instant")
"""Dimensions along which lines are drawn."""
REPEATED = ("cycle", "pass")
"""Dimensions of numbers that are lines over them where one run is drawn."""
_STRAIGHT = 1e-9
"""Largest height of a line along x, over its length."""
_LEVELS = (
    "highest_mises", "peak_contact_pressure", "peak_patch_pressure", "hertz_pressure",
    "contact_pressure", "patch_pressure", "map_mises", "map_stress",
)  # fmt: skip
"""Stresses under load; the largest value of the first that a run has is its level."""
_NO_STRESS = 1e-3
"""Stress up to which it is rounding where a run has no level [MPa]."""
_DECAYED = 0.02
"""Depth is shown as far as values exceed this share of the peak."""
OUTLINE = "outline"
"""Dimension of the outlines of the bodies."""
DRAWN = (*AXES, *ALONG, OUTLINE)
"""Dimensions within one figure of a run: two axes of a map, or one axis or one of `ALONG`."""


def sweep_fields(dataset: xr.Dataset) -> list[str]:
    """Return the numbers and flags with one value per run, and ``status``."""
    every = over_runs(dataset).items()
    return [name for name, each in every if each.dtype.kind in "fiu" or name == "status"]


def wide_fields(dataset: xr.Dataset) -> dict[str, list[str]]:
    """Return the dimensions, beside the sweep, of the variables with more than a value per run."""
    sweep = {*sweep_axes(dataset)}
    return {
        str(name): [str(dim) for dim in each.dims if dim not in sweep]
        for name, each in dataset.data_vars.items()
        if sweep < {*each.dims}
    }


def labelled_fields(dataset: xr.Dataset) -> list[str]:
    """Return the variables with one number per run and label, such as body or component."""
    sweep = {*sweep_axes(dataset)}
    return [
        str(name)
        for name, each in dataset.data_vars.items()
        if sweep < (own := set(each.dims)) and not {*DRAWN} & (own - sweep)
        if each.dtype.kind in "fi"
    ]


def map_fields(dataset: xr.Dataset) -> list[str]:
    """Return the variables that are drawn as maps of the bodies."""
    sweep = tuple(sweep_axes(dataset))
    fields = dataset.data_vars.items()
    return [str(name) for name, each in fields if len(map_axes(each, sweep)) == 2]


def map_axes(values: xr.DataArray, sweep: Sequence[Hashable] = ()) -> tuple[str, ...]:
    """Return the dimensions of a field that are coordinates; for a map: horizontal, vertical.

    Axes of the sweep do not count, whatever their names.
    """
    own = (name for name in reversed(values.dims) if name not in sweep)
    return tuple(str(name) for name in own if name in AXES)


def line_fields(dataset: xr.Dataset) -> list[str]:
    """Return the variables that are drawn as lines."""
    sweep = tuple(sweep_axes(dataset))
    return [str(name) for name, each in dataset.data_vars.items() if line_axis(each, sweep)]


def line_axis(values: xr.DataArray, sweep: Sequence[Hashable] = ()) -> str | None:
    """Return the dimension along which a field is a line, or None: of `ALONG`, or its only axis.

    Without these it is one of `REPEATED` with two values or more. Axes of the sweep do not count,
    whatever their names.
    """
    axes = map_axes(values, sweep)
    alone = axes if len(axes) == 1 else ()
    repeated = () if axes else (name for name in REPEATED if values.sizes.get(name, 1) > 1)
    return next((name for name in (*ALONG, *alone, *repeated) if name in values.dims), None)


def placed(values: xr.DataArray, run: xr.Dataset) -> xr.DataArray:
    """Return values, with the distance [mm] from the start of a line or contact as a coordinate.

    Along contacts whose slaves are straight along x it is the position x.
    """
    kind = str(values.name).partition("_")[0]
    distance = run.get(f"{kind}_s")
    if distance is None or not set(distance.dims) <= set(values.dims):
        return values
    x, y = (run.get(f"{kind}_{axis}") for axis in AXES[:2])
    if kind == "contact" and x is not None and y is not None and x.dims == distance.dims:
        size = np.nanmax(np.ptp(x.to_numpy(), axis=-1), initial=0.0)
        if np.nanmax(np.ptp(y.to_numpy(), axis=-1), initial=0.0) <= _STRAIGHT * size:
            distance = x.assign_attrs(long_name="position x along the slave")
    return values.assign_coords({DISTANCE: distance})


def floor_of(values: xr.DataArray, run: xr.Dataset) -> float:
    """Return the stress up to which it is rounding [MPa]; of other quantities 0."""
    if values.attrs.get("units") != "MPa":
        return 0.0
    known = (float(abs(run[name]).max()) for name in _LEVELS if name in run)
    return next((rounding("MPa", level) for level in known if level > 0.0), _NO_STRESS)


def without_rounding(values: xr.DataArray, run: xr.Dataset) -> xr.DataArray:
    """Return values, zeros where all of them are rounding."""
    if not (floor := floor_of(values, run)) or not float(abs(values).max()) <= floor:
        return values
    return xr.zeros_like(values).where(values.notnull()).assign_attrs(values.attrs)


def none_of(values: xr.DataArray) -> str:
    """Return the sentence that a quantity is zero everywhere."""
    return f"No {values.attrs.get('long_name', values.name)}: it is zero everywhere."


def depth_shown(values: xr.DataArray, others: Sequence[Hashable]) -> int:
    """Return the number of points down to the depth at which values have decayed."""
    largest = abs(values).max(others).to_numpy()
    shown = np.flatnonzero(largest > _DECAYED * largest.max())
    return int(shown[-1]) + 2 if shown.size else values.sizes["depth"]


def usual_field(dataset: xr.Dataset) -> str:
    """Return the field drawn by default: residual stress, or stress if bodies are not unloaded."""
    maps = map_fields(dataset)
    return next((name for name in (_RESIDUAL, _STRESS) if name in maps), _RESIDUAL)


def check_field(field: str, known: list[str]) -> None:
    """Raise a `StudyError` unless `field` is one of the `known`."""
    if field not in known:
        raise StudyError("field", field, one_of(field, known, "list(open_study(...)) has all"))


def component_of(values: xr.DataArray, component: str | None) -> xr.DataArray:
    """Return one component or invariant of a tensor, by default the first; a scalar unchanged.

    Raises `StudyError` for an unknown component, or a component of a scalar.
    """
    if "component" not in values.dims:
        if component is not None:
            raise StudyError("component", component, f"{values.name} is a scalar: leave it out")
        return values
    known = component_names(values)
    if component is not None and component not in known:
        raise StudyError("component", component, one_of(component, known))
    component = component or known[0]
    if component not in INVARIANTS:
        return values.sel(component=component)
    whole = values.transpose("component", ...)
    tensor = whole.to_numpy()
    # a tensor in two dimensions beside others in three has no shear out of the plane
    tensor = np.where(np.isnan(tensor) & np.isfinite(tensor[0]), 0.0, tensor)
    return (
        whole.isel(component=0)
        .copy(data=derived(tensor, component))
        .assign_coords(component=component)
    )


def component_name(values: xr.DataArray) -> str:
    """Return the name of the component that `component_of` has chosen; empty for a scalar."""
    there = "component" in values.coords and not values["component"].ndim
    return str(values["component"].item()) if there else ""


def is_signed(component: str) -> bool:
    """Whether values of a component, or invariant, may be negative as well as positive."""
    return component not in ("", "tresca")


def is_odd(component: str, across: str) -> bool:
    """Whether a component changes its sign in the mirror image across an axis."""
    return component not in INVARIANTS and component.count(across) == 1


def component_names(values: xr.DataArray) -> list[str]:
    """Return the components that a tensor has, and the invariants that it then has too."""
    own = [str(name) for name in values["component"].to_numpy()]
    return [*own, *INVARIANTS] if tuple(own) in (components(4), components(6)) else own


def is_half(run: xr.Dataset) -> bool:
    """Whether only one half of symmetric bodies was computed."""
    return bool(run.attrs.get(SYMMETRIC, 0))


def focus(run: xr.Dataset, zoom: float) -> float:
    """Return the position along the surface about which to zoom [mm]: the centre of the contact.

    If one half of symmetric bodies was computed, the centre is the end of the grid; then it is the
    edge of the contact.

    Raises
    ------
    StudyError
        if it is the edge, and the run has no ``contact_half_width``
    """
    if not is_half(run):
        return 0.0
    edge = float(run["contact_half_width"]) if "contact_half_width" in run else math.nan
    if not math.isfinite(edge):
        missing = "is about the edge of the contact, but this run has no contact_half_width"
        raise StudyError("zoom", zoom, f"{missing}: leave it out")
    return edge


def empty_window(window: Window, across: str, up: str) -> StudyError:
    """Return the error for a window that contains no part of a map over these axes."""
    a, b = across, up
    ends = f"{a}0 {a}1 {b}0 {b}1 [mm] with {a}0 < {a}1, {b}0 < {b}1"
    allowed = f"must be {ends}, and contain two points or more"
    return StudyError("window", list(window), allowed)


def too_close(zoom: float) -> StudyError:
    """Return the error for a zoom that contains no points."""
    return StudyError("zoom", zoom, "must be a length [mm] that contains two points or more")
