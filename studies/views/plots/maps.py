"""Maps of the bodies of one run."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy  # loads ndimage when it is used: maps on meshes do not need it
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.markers import CARETDOWN
from matplotlib.path import Path
from matplotlib.transforms import ScaledTranslation
from matplotlib.tri import Triangulation

from solver.model.friction import PatchStatus
from solver.tensors import AXES, PRINCIPAL, principal_of
from studies.definition.parameters import parameters_of
from studies.errors import StudyError
from studies.numbers import number_text
from studies.scenes.registry import scene_of
from studies.views.columns import COMPUTED, unit_of, with_unit
from studies.views.picking import one_run
from studies.views.plots.captions import capitalised, label, setting, symbol, wrapped
from studies.views.plots.fields import (
    OUTLINE,
    Window,
    component_name,
    is_half,
    map_axes,
    usual_field,
)
from studies.views.plots.mapped import (
    STAGE,
    STATUS,
    Box,
    Mapped,
    MappedMesh,
    is_patch,
    mapped,
    mesh_maps,
    on_mesh,
)
from studies.views.rules import SEQUENTIAL, SIGNED

_SHEAR, _SLIP = "patch_shear", "patch_slip"
_ARROWS = 16
"""Number of arrows over the side of a square as large as what is shown."""
BELOW = -40.0
"""Place of words below a map, under the name of its axis [pt]."""
_WHEEL, _UP, _OVER = "wheel_surface", "y", 3.0
"""The profile of the wheel, its height, and how far above the body it is shown [mm]."""
_PASS, _OF_A_PASS = "pass", "pass_"
"""The dimension of passes, and what stands before a parameter that each of them has for itself."""


def draw_patch(axes: Axes, run: xr.Dataset, field: str, window: Window) -> None:
    """Draw the border of the contact, that of stick, and arrows of shear, or of slip over slip."""
    status = run[STATUS]
    across, up = map_axes(status)
    lines = [
        (status != PatchStatus.OPEN, "k", "edge of contact"),
        (status == PatchStatus.STICK, "b", "edge of stick"),
    ]
    handles = []
    for inside, colour, name in lines:
        if inside.any() and not inside.all():
            axes.contour(
                status[across], status[up], inside.astype(float), levels=[0.5], colors=colour,
                linewidths=1.2,
            )  # fmt: skip
            handles.append(Line2D([], [], color=colour, linewidth=1.2, label=name))
    kind = _SLIP if field.startswith(_SLIP) else _SHEAR
    arrows = [run[f"{kind}_{axis}"].where(status != PatchStatus.OPEN) for axis in (across, up)]
    longest = float(np.sqrt(sum(each**2 for each in arrows)).max())
    if longest > 0.0:
        step = np.sqrt((window[1] - window[0]) * (window[3] - window[2])) / _ARROWS
        some = {
            name: slice(None, None, max(1, round(step / float(np.diff(status[name])[0]))))
            for name in (across, up)
        }
        u, v = (each.isel(some) for each in arrows)
        axes.quiver(
            u[across], u[up], u, v, units="xy", angles="xy", scale_units="xy",
            scale=longest / (1.2 * step), width=step / 12, color="0.1",
        )  # fmt: skip
        name = f"{kind.removeprefix('patch_')} on the surface, at most {number_text(longest, 3)}"
        label = f"{name} {unit_of(arrows[0])}".rstrip()
        handles.append(Line2D([], [], color="0.1", marker=r"$\rightarrow$", ls="none", label=label))
    down = ScaledTranslation(0.0, BELOW / 72.0, axes.figure.dpi_scale_trans)
    axes.legend(  # not on the map: a contact that is long one way leaves no corner free
        handles=handles, loc="upper left", bbox_to_anchor=(0.0, 0.0, 1.0, 0.0), frameon=False,
        bbox_transform=axes.transAxes + down, borderpad=0.0, borderaxespad=0.0, fontsize=8,
    )  # fmt: skip


def draw_wheel(axes: Axes, values: xr.DataArray, run: xr.Dataset) -> None:
    """Draw the profile of the wheel above a section, if the run has one and the top is shown."""
    across, up = map_axes(values)
    if up != _UP or _WHEEL not in run or float(values[up][-1]) < 0.0:
        return
    bottom, _ = axes.get_ylim()
    axes.plot(run[across], run[_WHEEL], color="k", linewidth=1.2, label="wheel before contact")
    axes.set_ylim(bottom, _OVER)
    axes.legend(loc="lower right", framealpha=0.9, edgecolor="none", fontsize=8)


Array = np.ndarray
_NEXT = 1.5
"""Distance of neighbouring places in steps of the map, at most, also diagonally."""
_ON_LINE = 1e-9
"""Ratio of a position to the size of the bodies; below it a point is on the line of symmetry."""


def outlines_of(run: xr.Dataset, across: str, up: str) -> list[Array]:
    """Return the outlines (2, n) of bodies over two axes, of both halves; none if not stored."""
    names = [f"{OUTLINE}_{axis}" for axis in (across, up)]
    if not all(name in run for name in names):
        return []
    X = np.stack([run[name].to_numpy().squeeze() for name in names])
    known = np.isfinite(X[0])
    begins = np.flatnonzero(known & ~np.append(False, known[:-1]))
    ends = np.flatnonzero(known & ~np.append(known[1:], False)) + 1
    curves = [X[:, begin:end] for begin, end in zip(begins, ends, strict=True)]
    if is_half(run):
        curves += [curve[:, ::-1] * [[-1.0], [1.0]] for curve in curves]
    return curves


def lines_of(curves: list[Array], run: xr.Dataset) -> list[Array]:
    """Return the pieces (n, 2) of outlines that are borders: not the line of symmetry."""
    if not is_half(run):
        return [curve.T for curve in curves]
    near = _ON_LINE * max(np.ptp(curve) for curve in curves)
    found = []
    for curve in curves:
        inner = (np.abs(curve[0]) < near).astype(int)
        cuts = np.flatnonzero(inner[1:] & inner[:-1]) + 1
        found += [piece.T for piece in np.split(curve, cuts, axis=1) if piece.shape[1] > 1]
    return found


def clip_of(curves: list[Array]) -> Path:
    """Return what the outlines enclose: a body is on the left of each."""
    return Path.make_compound_path(*(Path(curve.T, closed=True) for curve in curves))


def reaching(values: xr.DataArray, curves: list[Array]) -> xr.DataArray:
    """Return a map in which places outside of the bodies have the value of the nearest place.

    So it reaches their outlines, also between an outline and the edges of elements, which are
    chords. What is unknown inside of them stays unknown.
    """
    across, up = map_axes(values)
    whole = values.transpose(up, across)
    places = np.stack(np.meshgrid(whole[across], whole[up]), axis=-1).reshape(-1, 2)
    turns = np.zeros(len(places), dtype=int)
    for curve in curves:
        way = np.sign(curve[0] @ np.roll(curve[1], -1) - curve[1] @ np.roll(curve[0], -1))
        turns += int(way) * Path(curve.T).contains_points(places)
    there = whole.notnull().to_numpy()
    beyond = (turns <= 0).reshape(there.shape)
    if not there.any():
        return values
    steps, nearest = scipy.ndimage.distance_transform_edt(~there, return_indices=True)
    rim = scipy.ndimage.binary_dilation(beyond) & (steps < _NEXT)
    values_at = whole.to_numpy()
    filled = np.where((beyond | rim) & ~there, values_at[tuple(nearest)], values_at)
    return whole.copy(data=filled)


_OUTSIDE = "0.86"
_AREA, _LONGEST = 26.0, 8.0
"""Area of a map and its longest side [in]."""
_BARS = 24
"""Number of bars of directions along the longer side of a map."""
_LITTLE = 0.01
"""Share of the end of the colours below which a direction means nothing."""
_TEXT = 3.2
"""Least length of the lines around a map [in]."""
_ABOVE = 8.0
"""Place of the words above a map: between are marks of its edge, where it ends there [pt]."""


def map_figure(
    run: xr.Dataset,
    field: str | None = None,
    component: str | None = None,
    zoom: float | None = None,
    window: Window | None = None,
    stage: str | None = None,
    deformed: float = 0.0,
) -> Figure:
    """Return a map of `field` over the bodies, with both halves if one half was computed.

    It is drawn on the mesh if the run keeps its fields, else on the map grid, up to the outlines of
    the bodies. A principal value has its directions.

    Parameters
    ----------
    run : data set of one run
    field : variable over two coordinates, such as ``y`` and ``x``, the last of them horizontal, or
        one of `mesh_maps`; by default the residual stress, or the stress if the bodies are not
        unloaded
    component : component or invariant of a tensor; by default the first component
    zoom : show only the part within this distance of the contact's centre, or of its edge if half
        of the bodies was computed [mm]
    window : show only this part: horizontal and vertical range, such as (x0, x1, y0, y1) [mm]
    stage : of several stages; by default the last
    deformed : factor of the displacements by which the bodies are drawn deformed

    Raises
    ------
    StudyError
        if the data set has no such field, component or stage, the part has no points, or a deformed
        body is asked for where no mesh is kept
    """
    run = one_run(run)
    field = field or usual_field(run)
    if field in mesh_maps(run):
        return _on_mesh(run, on_mesh(run, field, component, zoom, window, stage, deformed))
    if deformed:
        raise StudyError("deformed", deformed, 'needs the mesh: a study with keep = "fields"')
    return _on_grid(run, mapped(run, field, component, zoom, window, stage))


def _on_grid(run: xr.Dataset, drawn: Mapped) -> Figure:
    """Return the figure of a map on a grid."""
    values = drawn.values
    across, up = map_axes(values)
    patch = is_patch(values, run)
    x, y = values[across], values[up]
    sheet, axes = _sheet(run, values, *(float(np.ptp(each.to_numpy())) for each in (x, y)))
    curves = [] if patch else outlines_of(run, across, up)
    shown = reaching(values, curves) if curves else values
    shading: Any = "gouraud" if drawn.smooth else "nearest"
    mesh = axes.pcolormesh(x, y, shown, shading=shading, rasterized=True, **_colours(drawn))
    box = (*axes.get_xlim(), *axes.get_ylim())
    if curves:
        mesh.set_clip_path(clip_of(curves), axes.transData)
        _draw_outlines(axes, lines_of(curves, run))
        _draw_contact(axes, run, _stage_of(values))
    _mark_edges(axes, run, box)
    axes.set(xlim=box[:2], ylim=box[2:], xlabel=_symbol(run[across]), ylabel=_symbol(run[up]))
    if patch:
        draw_patch(axes, run, str(values.name), box)
    draw_wheel(axes, values, run)  # above the section
    axes.set_xlim(*box[:2])
    _draw_directions(axes, run, drawn, box)
    return _finished(sheet, axes, mesh, drawn, axes.get_legend() if patch else None)


def _on_mesh(run: xr.Dataset, drawn: MappedMesh) -> Figure:
    """Return the figure of a map on a mesh, with the outlines of the bodies and the contact."""
    x0, x1, y0, y1 = drawn.box
    sheet, axes = _sheet(run, drawn.values, x1 - x0, y1 - y0)
    cells = Triangulation(drawn.X[0], drawn.X[1], drawn.triangles)
    mesh = axes.tripcolor(
        cells, drawn.values.to_numpy(), shading="gouraud", rasterized=True, **_colours(drawn)
    )
    _draw_outlines(axes, list(drawn.X[:, drawn.edges].transpose(1, 2, 0)))
    if not drawn.deformed:
        _draw_contact(axes, run, _stage_of(drawn.values))
        _mark_edges(axes, run, drawn.box)
    _draw_directions(axes, run, drawn, drawn.box)
    axes.set(xlim=(x0, x1), ylim=(y0, y1), xlabel="$x$ [mm]", ylabel="$y$ [mm]")
    return _finished(sheet, axes, mesh, drawn, None)


def _sheet(run: xr.Dataset, values: xr.DataArray, across: float, up: float) -> tuple[Figure, Axes]:
    """Return a figure and its axes, with the title, for a map of this width and height [mm]."""
    scale = min(np.sqrt(_AREA / (across * up)), _LONGEST / max(across, up))
    width, height = scale * across, scale * up
    sheet = Figure(figsize=(width, height), dpi=150)
    axes = sheet.add_axes((0.0, 0.0, 1.0, 1.0), facecolor=_OUTSIDE)
    entitle(axes, run, values, max(width, _TEXT))
    return sheet, axes


def _colours(drawn: Mapped) -> dict[str, Any]:
    signed, high = drawn.signed, drawn.high
    colours = SIGNED if signed else SEQUENTIAL
    return {"cmap": colours, "vmin": -high if signed else 0.0, "vmax": high}


def _mark_edges(axes: Axes, run: xr.Dataset, box: Box) -> None:
    """Mark the edges of the contact above the surface: a line would hide the stress there."""
    left, right, bottom, top = box
    edge = float(run["contact_half_width"]) if "contact_half_width" in run else 0.0
    seen = edge > 0.0 and bottom <= 0.0 <= top
    ends = [end for end in (-edge, edge) if seen and left <= end <= right]
    if ends:
        axes.plot(
            ends, [0.0] * len(ends), linestyle="none", marker=CARETDOWN, color="k",
            label="edge of contact under load", clip_on=False,  # the map may end at the surface
        )  # fmt: skip
        axes.legend(loc="upper right", framealpha=0.9, edgecolor="none", fontsize=8)


def _draw_outlines(axes: Axes, lines: list[np.ndarray]) -> None:
    """Draw the outlines (n, 2) of bodies."""
    axes.add_collection(LineCollection(lines, colors="0.15", linewidths=0.6), autolim=False)


def _draw_contact(axes: Axes, run: xr.Dataset, stage: str | None) -> None:
    """Draw where bodies touch at a stage; without one, where they touched under load."""
    names = ("contact_x", "contact_y", "contact_pressure")
    if not all(name in run for name in names) or "fraction" not in run["contact_pressure"].dims:
        return
    x, y, pressure = (run[name] for name in names)
    if STAGE in pressure.dims:
        pressure = pressure.max(STAGE) if stage is None else pressure.sel({STAGE: stage})
    pressing = pressure > 0.0
    label: str | None = "contact under load" if stage is None else "contact"
    for k in range(run.sizes["contact"]):
        for sign in (-1.0, 1.0) if is_half(run) else (1.0,):
            line = [each.isel(contact=k).where(pressing.isel(contact=k)) for each in (x, y)]
            if line[0].notnull().any():
                axes.plot(sign * line[0], line[1], color="#111", linewidth=2.0, label=label)
                label = None
    if label is None:
        axes.legend(loc="upper right", framealpha=0.9, edgecolor="none", fontsize=8)


def _draw_directions(axes: Axes, run: xr.Dataset, drawn: Mapped, box: Box) -> None:
    """Draw the directions of a principal value as bars, as long as they are in the plane."""
    name = component_name(drawn.values)
    if name not in PRINCIPAL:
        return
    places, tensor, plane = _tensor_of(run, drawn)
    left, right, bottom, top = box
    apart = max(right - left, top - bottom) / _BARS
    seen = (places[0] > left) & (places[0] < right) & (places[1] > bottom) & (places[1] < top)
    known = np.flatnonzero(seen & np.isfinite(tensor).all(axis=0))
    values, directions = principal_of(tensor[:, known])
    large = np.abs(values[PRINCIPAL.index(name)]) > _LITTLE * drawn.high
    known, directions = known[large], directions[..., large]
    squares = np.floor((places[:, known] - [[left], [bottom]]) / apart)
    away = np.abs((places[:, known] - [[left], [bottom]]) / apart - squares - 0.5).max(axis=0)
    order = np.argsort(away, kind="stable")  # in each square the place nearest to its middle
    _, first = np.unique(squares[:, order], axis=1, return_index=True)
    chosen = known[order[first]]
    way = directions[plane, PRINCIPAL.index(name)][:, order[first]]
    axes.quiver(
        *places[:, chosen], *(0.7 * apart * way), angles="xy", scale_units="xy", scale=1.0,
        pivot="middle", headwidth=0.0, headlength=0.0, headaxislength=0.0, units="dots", width=1.6,
        color="k",
    )  # fmt: skip


def _tensor_of(run: xr.Dataset, drawn: Mapped) -> tuple[np.ndarray, np.ndarray, list[int]]:
    """Return places (2, n), a tensor (n_components, n) there, and the rows of the plane."""
    if isinstance(drawn, MappedMesh):
        assert drawn.tensor is not None
        return drawn.X, drawn.tensor, [0, 1]
    values = drawn.values
    across, up = map_axes(values)
    parts = [
        mapped(run, str(values.name), str(name), stage=_stage_of(values)).values
        for name in run["component"].to_numpy()
    ]
    places = np.meshgrid(parts[0][across], parts[0][up])
    tensor = np.stack([each.transpose(up, across).to_numpy().ravel() for each in parts])
    rows = [AXES.index(across), AXES.index(up)]
    return np.stack([each.ravel() for each in places]), tensor, rows


def _stage_of(values: xr.DataArray) -> str | None:
    return str(values[STAGE].item()) if STAGE in values.coords else None


def _finished(
    sheet: Figure, axes: Axes, mesh: ScalarMappable, drawn: Mapped, above: Artist | None
) -> Figure:
    """Return a figure with its colour bar and note, as large as all that is drawn.

    Parameters
    ----------
    above : what the note stands below; by default the axes
    """
    values, signed, high = drawn.values, drawn.signed, drawn.high
    width, height = sheet.get_size_inches()
    axes.set_aspect("equal")
    beside = axes.inset_axes((1.0 + 0.12 / width, 0.0, 0.16 / width, 1.0))
    over, under = bool((values > high).any()), signed and bool((values < -high).any())
    beyond = {(1, 1): "both", (1, 0): "max", (0, 1): "min"}.get((over, under), "neither")
    bar = sheet.colorbar(mesh, cax=beside, extend=beyond, extendfrac=0.03)
    bar.set_label(wrapped(label(values), max(height, _TEXT / 2.0), 10))
    if "flag_meanings" in values.attrs:
        bar.set_ticks(values.attrs["flag_values"], labels=values.attrs["flag_meanings"].split())
    bar.outline.set_visible(False)
    axes.annotate(
        wrapped(drawn.note, max(width, _TEXT), 8), (0.0, 0.0), xycoords=above or "axes fraction",
        xytext=(0.0, -4.0 if above else BELOW), textcoords="offset points", va="top", fontsize=8,
        color="0.3",
    )  # fmt: skip
    _fit(sheet, axes)
    return sheet


def _fit(sheet: Figure, axes: Axes) -> None:
    """Fit the size of the figure to all that is drawn, without changing the size of the axes."""
    size = sheet.get_size_inches()
    ink = sheet.get_tightbbox().padded(0.1)
    sheet.set_size_inches(ink.width, ink.height)
    axes.set_position(
        (-ink.x0 / ink.width, -ink.y0 / ink.height, size[0] / ink.width, size[1] / ink.height)
    )


def entitle(axes: Axes, run: xr.Dataset, values: xr.DataArray, width: float) -> None:
    """Set the title, and below it what distinguishes the run, in lines of `width` inches."""
    quantity = values.attrs.get("long_name", str(values.name))
    shown = values.drop_vars("component", errors="ignore").to_dataset(name="values")
    shown = shown.assign({n: each for n, each in run.items() if str(n).startswith(COMPUTED)})
    if is_patch(values, run):
        shown = shown.assign_coords(_last_pass(run))
    below = axes.set_title(
        wrapped(setting(shown.assign_attrs(run.attrs)), width, 8),
        loc="left", fontsize=8, color="0.3", pad=_ABOVE,
    )  # fmt: skip
    axes.annotate(
        f"{wrapped(capitalised(quantity), width, 12)} {symbol(values)}".rstrip(), (0.0, 1.0),
        xycoords=below,
        xytext=(0.0, 5.0), textcoords="offset points", weight="bold", fontsize=11,
    )  # fmt: skip


def _last_pass(run: xr.Dataset) -> dict[str, xr.DataArray]:
    """Return the pass whose contact is stored, and what it has for itself; {} if all are alike."""
    each = {str(n).removeprefix(_OF_A_PASS): run[n] for n in run if str(n).startswith(_OF_A_PASS)}
    own = {n: each[n] for n in each.keys() & parameters_of(scene_of(run.attrs))}
    if not any(np.ptp(value.to_numpy()) > 0.0 for value in own.values()):
        return {}
    return {name: value.isel({_PASS: -1}) for name, value in ({_PASS: run[_PASS]} | own).items()}


def _symbol(coordinate: xr.DataArray) -> str:
    """Return the name of a map's axis, with its unit."""
    return with_unit(f"${coordinate.name}$", unit_of(coordinate))
