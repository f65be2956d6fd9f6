"""The values of a map of one run: both halves, the part that is shown, and the end of its colours.

They are on a grid; or, of a run that keeps its fields, on its mesh: smooth, with exact outlines.
What draws a map, and what sends its values, take them from here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from solver.mesh.rounding import ROUNDED
from solver.model.friction import PatchStatus
from solver.results.body_fields import BODY_FIELDS
from solver.results.mesh_fields import NO_NODE, MeshFields
from solver.results.quantities import QUANTITIES
from solver.tensors import AXES
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
from studies.views.solution import keeps, read

Array = np.ndarray
Box = tuple[float, float, float, float]
"""Left, right, bottom, top [mm]."""

_AT_THE_END = {"residual_stress": "stress", "plastic_strain": "plastic_strain"}
"""Variables after release, and the fields at the nodes."""
_STAGED = {f"map_{name}": name for name in BODY_FIELDS}
"""Variables at each stage."""
MESH_MAPS = (*_AT_THE_END, *_STAGED)
"""Variables that are drawn on a mesh where it is kept."""
_NODE = "node"

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


@dataclass(frozen=True, slots=True, kw_only=True)
class MappedMesh(Mapped):
    """The values of a map at nodes.

    Attributes
    ----------
    X : (2, n) positions of the nodes, deformed if that was asked for [mm]
    triangles : (n_triangles, 3) nodes
    edges : (n_edges, 2) nodes of the edges of the bodies
    tensor : (n_components, n), if the values are a component of one
    box : what is shown: left, right, bottom, top [mm]
    deformed : factor of the displacements
    """

    X: Array
    triangles: Array
    edges: Array
    tensor: Array | None
    box: Box
    deformed: float


def mesh_maps(run: xr.Dataset) -> list[str]:
    """Return the variables that are drawn on the mesh; none of a run without one in its plane."""
    if not keeps(run) or f"mesh_node_{AXES[2]}" in run:
        return []
    return [*MESH_MAPS]


def on_mesh(
    run: xr.Dataset,
    field: str,
    component: str | None = None,
    zoom: float | None = None,
    window: Window | None = None,
    stage: str | None = None,
    deformed: float = 0.0,
) -> MappedMesh:
    """Return the values of a map at the nodes, with both halves if one half was computed.

    Arguments and errors are those of `map_figure`; ``field`` is one of `mesh_maps`.
    """
    fields = read(run)
    at = _stage_on_mesh(fields, field, stage)
    values, tensor = _values(run, fields.stages[at], field, component)
    values = without_rounding(values, run)
    if field not in _AT_THE_END:
        values = values.assign_coords({STAGE: at})
    moved = fields.stages[at]["displacement"]
    X = fields.X + (deformed * moved if deformed else 0.0)
    whole = fields.X
    numbers, name = values.to_numpy(), component_name(values)
    faces = _there(fields.faces[0], moved)
    triangles, edges = _triangles(faces), _edges(faces)
    if is_half(run) and (fields.X[0] > -ROUNDED * np.ptp(fields.X[0])).all():
        count, odd = X.shape[1], is_odd(name, AXES[0])
        X, whole = (np.hstack([each, each * [[-1.0], [1.0]]]) for each in (X, whole))
        numbers = np.concatenate([numbers, -numbers if odd else numbers])
        triangles = np.vstack([triangles, count + triangles])
        kept = edges[(np.abs(fields.X[0][edges]) > ROUNDED * np.ptp(fields.X[0])).any(axis=1)]
        edges = np.vstack([kept, count + kept])
        if tensor is not None:
            tensor = np.hstack([tensor, tensor * [[1.0], [1.0], [1.0], [-1.0]]])
    box = _box(run, whole, zoom, window)
    if deformed and zoom is None and window is None:
        box = _with_moved(box, whole, X)
    low, high = X[:, triangles].min(axis=2), X[:, triangles].max(axis=2)
    shown = (low[0] < box[1]) & (high[0] > box[0]) & (low[1] < box[3]) & (high[1] > box[2])
    if not shown.any() or not box[0] < box[1]:
        raise too_close(zoom) if window is None and zoom else empty_window(box, *AXES[:2])
    inside = np.unique(triangles[shown])
    area = np.zeros(X.shape[1])
    np.add.at(area, triangles[shown], _triangle_areas(X, triangles[shown])[:, None] / 3.0)
    signed = is_signed(name)
    most, note = limit(numbers[inside], area[inside], signed, values)
    if deformed:
        note = f"Displacements are drawn {deformed:g} times as large. {note}".rstrip()
    return MappedMesh(
        values=xr.DataArray(numbers, dims=_NODE, name=field, attrs=values.attrs).assign_coords(
            {name: each for name, each in values.coords.items() if not each.ndim}
        ),
        signed=signed, high=most, note=note, smooth=True, X=X, triangles=triangles[shown],
        edges=edges, tensor=tensor, box=box, deformed=deformed,
    )  # fmt: skip


def _stage_on_mesh(fields: MeshFields, field: str, stage: str | None) -> str:
    known = list(fields.stages)
    if stage is None:
        return known[-1]
    if field in _AT_THE_END or stage not in known:
        allowed = "has one stage only" if field in _AT_THE_END else one_of(stage, known)
        raise StudyError(STAGE, stage, allowed)
    return stage


def _values(
    run: xr.Dataset, at: Mapping[str, Array], field: str, component: str | None
) -> tuple[xr.DataArray, Array | None]:
    """Return the values at the nodes, with their meaning, and the tensor they are taken from."""
    scalars = {name: each for name, each in run.coords.items() if not each.ndim}
    name = (_AT_THE_END | _STAGED)[field]
    kind, nodal = BODY_FIELDS[name], at[name]
    if not np.isfinite(nodal).any():
        raise StudyError("field", field, "is not kept in the file of this run")
    attributes = {"long_name": kind.long_name, "units": kind.units}
    attributes |= QUANTITIES[field].attributes if field in QUANTITIES else {}
    if not kind.over:
        return component_of(xr.DataArray(nodal, scalars, _NODE, field, attributes), component), None
    names = list(kind.parts(len(at["displacement"])))
    whole = xr.DataArray(
        nodal, scalars | {"component": names}, ("component", _NODE), field, attributes
    )
    if kind.over == "axis":
        chosen = component_of(whole, component or names[-1])
        words = f"{kind.long_name} along {component_name(chosen)}"
        return chosen.assign_attrs(long_name=words), None
    return component_of(whole, component), nodal


def _there(faces: Array, moved: Array) -> Array:
    """Return the faces of material that is not removed: displacements are known at all nodes."""
    gone = ~np.isfinite(moved).all(axis=0)
    return faces[~((faces != NO_NODE) & gone[faces]).any(axis=1)]


def _triangles(faces: Array) -> Array:
    """Return triangles (n, 3) of faces (n_faces, 4), of which triangles lack the last node."""
    four = faces[:, 3] != NO_NODE
    return np.vstack([faces[:, :3], faces[four][:, [0, 2, 3]]])


def _edges(faces: Array) -> Array:
    """Return the edges (n, 2) that only one face has; bodies share no nodes."""
    last = np.where(faces[:, 3:] == NO_NODE, faces[:, :1], faces[:, 3:])
    ring = np.hstack([faces[:, :3], last])
    pairs = np.stack([ring, np.roll(ring, -1, axis=1)], axis=2).reshape(-1, 2)
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    _, first, count = np.unique(
        np.sort(pairs, axis=1), axis=0, return_index=True, return_counts=True
    )
    return np.asarray(pairs[first[count == 1]])


def _triangle_areas(X: Array, triangles: Array) -> Array:
    a, b, c = (X[:, triangles[:, k]] for k in range(3))
    u, v = b - a, c - a
    return np.asarray(np.abs(u[0] * v[1] - u[1] * v[0]) / 2.0)


def _box(run: xr.Dataset, X: Array, zoom: float | None, window: Window | None) -> Box:
    """Return what is shown: by default where the run has its map, else all bodies."""
    if window is not None:
        x0, x1, y0, y1 = window
        if not (x0 < x1 and y0 < y1):
            raise empty_window(window, *AXES[:2])
        return x0, x1, y0, y1
    if zoom is not None:
        middle = focus(run, zoom)
        return middle - zoom, middle + zoom, -zoom, zoom
    low, high = X.min(axis=1), X.max(axis=1)
    if all(name in run.coords and run[name].size > 1 for name in AXES[:2]):
        x, y = (run[name].to_numpy() for name in AXES[:2])
        left = -float(x.max()) if is_half(run) else float(x.min())
        low = np.maximum(low, [left, float(y.min())])
        high = np.minimum(high, [float(x.max()), float(y.max())])
    return float(low[0]), float(high[0]), float(low[1]), float(high[1])


def _with_moved(box: Box, whole: Array, X: Array) -> Box:
    """Return a box that also contains where the nodes (2, n) within it are moved to."""
    (x, y), (left, right, bottom, top) = whole, box
    reach = 1e-9 * max(right - left, top - bottom)
    inside = (left - reach <= x) & (x <= right + reach) & (bottom - reach <= y) & (y <= top + reach)
    moved = X[:, inside & np.isfinite(X).all(axis=0)]
    if not moved.size:
        return box
    (x0, y0), (x1, y1) = moved.min(axis=1), moved.max(axis=1)
    return min(left, float(x0)), max(right, float(x1)), min(bottom, float(y0)), max(top, float(y1))
