"""What a scene looks like before anything is computed: meshes, boundaries, supports, loads."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import MaxNLocator
from scipy.spatial import cKDTree
from skfem import Mesh

from solver.model.body import Body
from solver.model.model import Model
from solver.model.pairs import Link
from solver.model.rigid import RigidBody
from solver.results.named_places import NamedPlaces
from solver.results.view import View
from solver.scenes.scene import Scene
from solver.scenes.sketch import Sketch
from solver.tensors import AXES
from studies.definition.parameters import build, defaults, parameters_of
from studies.errors import StudyError
from studies.numbers import typeset_number
from studies.views.columns import words
from studies.views.plots.acting import acting, draw_acting, draw_supports, outward
from studies.views.plots.captions import capitalised, named, wrapped
from studies.views.plots.fields import Window, empty_window
from studies.views.plots.mapped import Array, Box
from studies.views.plots.sheets import STYLES

_PANEL, _LEGEND = (4.4, 5.4), 3.3
"""Largest width and height of a panel; width of a column of the legend [in]."""
_LINES = 40
"""Lines of text in a column of the legend, about."""
_FILLS = ("#dfe8f3", "#f6ead7", "#e2efdd", "#f1dfe9", "#e8e8e8")
_PAIRS = ("#d62728", "#1f77b4", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b", "#e377c2")
_RESULTS, _POINTS = "#7b3fa0", "PXD*o^"
_LINKED = ("#0f766e", "#7a5c00", "#1e3a8a", "#9d174d", "#3f6212", "#5b21b6")
_MARGIN, _WORTHWHILE = 0.1, 0.35
"""Frame around what is drawn, over its larger side; largest ratio of the sides of the close-up to
those of the whole for a second panel."""
_NAMED = 0.4
"""Least length of a line that has its name beside it [in]."""
_NAME, _OFF = 6.5, 0.125
"""Size of names [pt], and how far they are from their line [in]."""
_THIN = 0.6
"""Width of a body up to which names stand outside [in]."""
_STRIPES = 24
"""Number of stripes of a boundary of several pairs."""
_SHARES = (0.3, 0.7, 0.15, 0.85)
"""Places along a line, over its length, at which its name may stand besides the middle."""
_SMALLEST = 1e-6
"""Least side of a part, over the largest coordinate of what there is."""
_AROUND = 25.0
"""Half the width of a close-up without a map, over the least side of elements there."""
_ALIKE = 1.1
"""Largest ratio of lengths of edges that count as equally short."""
_DENSE = 1000
"""Number of points of a rigid surface, to find where it is nearest to a body."""
_NEAR = 0.35
"""How far a rigid surface or a curve is seen beyond the bodies, over their size; one that is no
larger, and no farther away, is seen whole."""


@dataclass(slots=True, kw_only=True)
class _Subject:
    """What is drawn.

    Attributes
    ----------
    own : bodies, pairs, springs and curves
    rigid : rigid bodies
    links : boundaries that are tied, kept rigid, or held by springs
    axes : names of the horizontal and vertical coordinate
    middle : what x = 0 is, if it is drawn as a line of symmetry
    """

    own: Sketch
    rigid: Sequence[RigidBody] = ()
    links: Sequence[Link] = ()
    axes: tuple[str, str]
    middle: str = ""


def setup_figure(
    scene: Scene,
    values: Mapping[str, Any] | None = None,
    zoom: float | None = None,
    window: Window | None = None,
) -> Figure:
    """Return a figure of a scene before loading; nothing is computed.

    It has meshes, named boundaries, supports, loads as arrows, contact pairs in colours, and where
    results are taken; and a second panel with the surroundings of the contact if they are small.

    Parameters
    ----------
    values : normalised values of parameters; the others have their defaults
    zoom : show only the part within this distance of the origin [mm]
    window : show only this part: horizontal and vertical range [mm]

    Raises
    ------
    StudyError
        if the scene has nothing to draw, or the part contains nothing
    ModelError
        if a parameter is refused
    """
    given = dict(values or {})
    parameters = build(scene, given)
    view = scene.view(parameters)
    places = scene.places(parameters) if scene.places else None
    shown = _shown(scene, parameters, view)
    whole = _around(_extent(shown))
    boxes = [whole]
    if zoom is not None:
        boxes = [(-zoom, zoom, -zoom, zoom)]
        _check_part("zoom", zoom, boxes[0], whole, shown)
    elif window is not None:
        x0, x1, y0, y1 = window
        boxes = [(x0, x1, y0, y1)]
        _check_part("window", window, boxes[0], whole, shown)
    elif (close := _close(shown, view)) and _side(close) < _WORTHWHILE * _side(whole):
        boxes.append(close)
    shapes = [_fitted(box) for box in boxes]
    height = max(own[1] for own in shapes)
    size = sum(own[0] + 0.7 for own in shapes) + _LEGEND, height + 1.3
    sheet = Figure(figsize=size, dpi=150, layout="constrained")
    panels = sheet.subplots(1, len(boxes), squeeze=False, width_ratios=[s[0] for s in shapes])[0]
    handles: dict[str, Any] = {}
    for axes, box, shape in zip(panels, boxes, shapes, strict=True):
        axes.set(xlim=box[:2], ylim=box[2:], aspect="equal", anchor="NW")
        handles |= _draw(axes, shown, view, places, (box[1] - box[0]) / shape[0])
        axes.set(xlabel=f"${shown.axes[0]}$ [mm]", ylabel=f"${shown.axes[1]}$ [mm]")
        axes.spines[["top", "right"]].set_visible(False)
        axes.xaxis.set_major_locator(MaxNLocator(max(int(1.3 * shape[0]), 2)))
    if len(boxes) > 1:
        x0, x1, y0, y1 = boxes[1]
        frame = Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, edgecolor="k", linewidth=0.9)
        panels[0].add_patch(frame)
        panels[1].set_title("the frame on the left", loc="left", fontsize=8, color="0.3")
    columns, tall = _columns(list(handles))
    sheet.set_size_inches(size[0] + (columns - 1) * _LEGEND, max(size[1], tall))
    sheet.legend(
        handles=list(handles.values()), labels=list(handles), loc="outside right upper",
        frameon=False, fontsize=8, labelspacing=0.55, ncols=columns,
    )  # fmt: skip
    lines = [scene.summary, _own(scene, given)]
    below = "\n".join(wrapped(line, max(shapes[0][0], 3.0), 8) for line in lines if line)
    panels[0].set_title(below, loc="left", fontsize=8, color="0.3")
    sheet.suptitle(capitalised(words(scene.name)), x=0.01, ha="left", fontsize=11, weight="bold")
    return sheet


def _columns(labels: Sequence[str]) -> tuple[int, float]:
    """Return the number of columns of a legend with these labels, and its height [in]."""
    lines = [label.count("\n") + 1 for label in labels]
    columns = math.ceil(sum(lines) / _LINES)
    rows = math.ceil(len(lines) / columns)
    most = max(sum(lines[first : first + rows]) for first in range(0, len(lines), rows))
    return columns, 0.5 + 0.14 * most + 0.07 * rows


def _own(scene: Scene, given: Mapping[str, Any]) -> str:
    """Return the parameters that are not the defaults, in words."""
    known, usual = parameters_of(scene), defaults(scene, given)
    return ", ".join(
        named(name, value, known[name].unit)
        for name, value in given.items()
        if value not in (None, usual[name]) and isinstance(value, str | int | float)
    )


def _shown(scene: Scene, parameters: Any, view: View) -> _Subject:
    if scene.sketch is not None and (sketch := scene.sketch(parameters)) is not None:
        return _Subject(own=sketch, axes=view.map_axes)
    try:
        model: Model = scene.model(parameters)
    except NotImplementedError:
        raise StudyError("scene", scene.name, "has no model to draw") from None
    turned = model.bodies[0].kinematics == "axisymmetric"
    middle = "axis of rotation" if turned else "line of symmetry" if view.symmetric else ""
    pairs = tuple((pair.slave, pair.master) for pair in model.contacts)
    own = Sketch(model.bodies, pairs)
    return _Subject(
        own=own, rigid=model.rigid, links=model.links, axes=view.map_axes, middle=middle
    )


# -- what is seen ----------------------------------------------------------------------------------


def _extent(shown: _Subject) -> Box:
    """Return the box around all bodies; of rigid bodies and curves only what is near."""
    p = np.hstack([body.mesh.p for body in shown.own.bodies])
    first, last = low, high = p.min(axis=1), p.max(axis=1)
    size = float(np.max(last - first))
    others = [s.points for body in shown.rigid for s in body.surfaces.values()]
    for each in (*others, *shown.own.curves.values()):
        start, end = np.asarray(each).min(axis=1), np.asarray(each).max(axis=1)
        near = _NEAR * size
        if np.max(end - start) <= size and np.all((start >= first - size) & (end <= last + size)):
            near = size
        low = np.minimum(low, np.maximum(start, first - near))
        high = np.maximum(high, np.minimum(end, last + near))
    return float(low[0]), float(high[0]), float(low[1]), float(high[1])


def _side(box: Box) -> float:
    return max(box[1] - box[0], box[3] - box[2])


def _around(box: Box) -> Box:
    more = _MARGIN * _side(box)
    return box[0] - more, box[1] + more, box[2] - more, box[3] + more


def _close(shown: _Subject, view: View) -> Box | None:
    """Return a box around the map, or else where surfaces with short edges are in contact."""
    across, up = view.map_grid
    if across.size and up.size:
        low, high = (float(across.min()), float(up.min())), (float(across.max()), float(up.max()))
        return _around((low[0], high[0], low[1], high[1]))
    if not shown.own.pairs:
        return None
    side, (x, y) = _finest(shown)
    reach = _AROUND * side
    left, right, bottom, top = _extent(shown)
    more = 2 * _MARGIN * reach
    return (
        max(x - reach, left - more), min(x + reach, right + more),
        max(y - reach, bottom - more), min(y + reach, top + more),
    )  # fmt: skip


def _finest(shown: _Subject) -> tuple[float, Array]:
    """Return where surfaces in contact have their shortest edges, and the least side there [mm].

    Of edges as short, all along a fillet for example, it is the one nearest to the other surface;
    of those as near, the one in their middle. The side is that of the elements at these edges.
    """
    bodies = {body.name: body for body in shown.own.bodies}
    tools = {body.name: body.surfaces for body in shown.rigid}
    found = []
    for pair in shown.own.pairs:
        for (name, boundary), (other, facing) in (pair, pair[::-1]):
            if name in bodies:
                body = bodies[name]
                edges = _edges(body.mesh, body.facets(boundary))
                if other in tools:
                    beside = _dense(np.asarray(tools[other][facing].points))
                else:
                    beside = _edges(bodies[other].mesh, bodies[other].facets(facing))[0]
                found.append((*edges, cKDTree(beside.T).query(edges[0].T)[0]))
    middles, length, least, gap = (
        np.concatenate(each, axis=-1) for each in zip(*found, strict=True)
    )
    near = length <= _ALIKE * length.min()
    near &= gap <= gap[near].min() + length.min()
    middles = middles[:, near]
    away = np.linalg.norm(middles - middles.mean(axis=1, keepdims=True), axis=0)
    return float(least[near].min()), middles[:, int(away.argmin())]


def _dense(points: Array) -> Array:
    """Return many points (2, n) on a line through a few."""
    count = np.arange(points.shape[1])
    return np.stack([np.interp(np.linspace(0, count[-1], _DENSE), count, x) for x in points])


def _edges(mesh: Mesh, facets: Array) -> tuple[Array, Array, Array]:
    """Return middles (2, n) and lengths of edges, and the least side of each element there [mm]."""
    ends = mesh.p[:, mesh.facets]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=0)
    least = length[mesh.t2f[:, mesh.f2t[0, facets]]].min(axis=0)
    return ends[:, :, facets].mean(axis=1), length[facets], least


def _check_part(name: str, value: Any, box: Box, whole: Box, shown: _Subject) -> None:
    sides = box[1] - box[0], box[3] - box[2]
    least = _SMALLEST * max(map(abs, whole))
    ordered = all(map(math.isfinite, (*box, *sides))) and min(sides) > least
    inside = box[0] < whole[1] and box[1] > whole[0] and box[2] < whole[3] and box[3] > whole[2]
    if not (ordered and inside):
        if name == "window":
            raise empty_window(value, *shown.axes)
        allowed = f"must be a length [mm] above {least / 2:.1g} within which there is a body"
        raise StudyError(name, value, allowed)


def _fitted(box: Box) -> tuple[float, float]:
    """Return width and height of the axes of a box [in]."""
    width, height = box[1] - box[0], box[3] - box[2]
    scale = min(_PANEL[0] / width, _PANEL[1] / height)
    return max(scale * width, 1.6), max(scale * height, 1.2)


# -- drawing ---------------------------------------------------------------------------------------


def _draw(
    axes: Axes, shown: _Subject, view: View, places: NamedPlaces | None, inch: float
) -> dict[str, Any]:
    """Draw all in a panel, in which an inch is so many mm; return the entries of the legend."""
    handles: dict[str, Any] = {}
    taken: list[Box] = []
    colours: dict[tuple[str, str], list[str]] = {}
    for k, pair in enumerate(shown.own.pairs):
        for side in pair:
            colours.setdefault(side, []).append(_PAIRS[k % len(_PAIRS)])
    for number, body in enumerate(shown.own.bodies):
        fill = _FILLS[number % len(_FILLS)]
        _draw_mesh(axes, body.mesh, fill)
        handles[_told(body)] = Patch(facecolor=fill, edgecolor="0.55", linewidth=0.5)
    for rigid in shown.rigid:
        for name, surface in rigid.surfaces.items():
            colour = colours.get((rigid.name, name), ["k"])[0]
            axes.plot(*surface.points, color=colour, linewidth=2.0, solid_capstyle="butt")
            points = np.asarray(surface.points)
            _label(
                axes,
                np.stack([points[:, :-1], points[:, 1:]], axis=2),
                f"{rigid.name}.{name}",
                inch,
                taken,
            )
        if rigid.surfaces:  # else it is a point that moves boundaries by links
            of = {colours.get((rigid.name, name), ["k"])[0] for name in rigid.surfaces}
            colour = of.pop() if len(of) == 1 else "k"
            handles[f"{rigid.name}: rigid"] = Line2D([], [], color=colour, linewidth=2.0)
    for name, curve in shown.own.curves.items():
        axes.plot(*curve, color="0.25", linewidth=1.6)
        handles[name] = Line2D([], [], color="0.25", linewidth=1.6)
    for k, (slave, master) in enumerate(shown.own.pairs):
        text = f"contact {'.'.join(slave)} – {'.'.join(master)}"
        handles[text] = Line2D([], [], color=_PAIRS[k % len(_PAIRS)], linewidth=2.4)
    for body in shown.own.bodies:
        thin = float(np.ptp(body.mesh.p, axis=1).min()) < _THIN * inch
        for name in body.mesh.boundaries or {}:
            lines = _polylines(body.mesh, body.mesh.boundaries[name])
            own = colours.get((body.name, name))
            axes.add_collection(
                LineCollection(
                    list(lines.transpose(2, 1, 0)),
                    colors=_striped(lines, own) if own else "0.25",
                    linewidths=2.4 if own else 1.1,
                )
            )
            ends = outward(body.mesh, body.mesh.boundaries[name])[0]
            _label(axes, ends, name, inch, taken, outside=thin)
        handles |= _draw_removed(axes, body)
        handles |= draw_supports(axes, body, inch, shown.own.springs.get(body.name, ()))
    for link, colour in zip(shown.links, cycle(_LINKED), strict=False):
        handles |= _draw_link(axes, shown.own.bodies, link, colour)
    for each in acting(shown.own.bodies, shown.rigid):
        handles |= draw_acting(axes, each, inch)
    if shown.middle:
        axes.axvline(0.0, color="0.3", linewidth=0.8, linestyle=(0, (8, 2, 1, 2)))
        handles[f"{shown.middle}: ${shown.axes[0]} = 0$"] = Line2D(
            [], [], color="0.3", linewidth=0.8, linestyle=(0, (8, 2, 1, 2))
        )
    return handles | _draw_results(axes, view, places)


def _draw_link(axes: Axes, bodies: Sequence[Body], link: Link, colour: str) -> dict[str, Any]:
    """Draw the boundaries of a link; return its entry of the legend."""
    known = {body.name: body for body in bodies}
    sides = [side for side in (link.slave, link.master) if side is not None]
    for name, boundary in sides:
        if name in known:
            lines = _polylines(known[name].mesh, known[name].facets(boundary))
            pieces = list(lines.transpose(2, 1, 0))
            axes.add_collection(LineCollection(pieces, colors=colour, linewidths=2.4))
    kind = "springs" if math.isfinite(link.stiffness) else "link"
    last = link.rigid or ("ground" if link.grounded else "")
    ends = " – ".join([*(".".join(side) for side in sides), *([last] if last else [])])
    text = f"{kind} {link.components}: {ends}"
    return {text: Line2D([], [], color=colour, linewidth=2.4)}


def _striped(lines: Array, colours: Sequence[str]) -> list[str]:
    """Return a colour for each facet (2, n, n_facets): in stripes where pairs share a boundary."""
    at = lines.mean(axis=1)
    along = at[int(np.ptp(at, axis=1).argmax())]
    share = (along - along.min()) / (float(np.ptp(along)) or 1.0)
    return [colours[int(each)] for each in (share * _STRIPES) % len(colours)]


def _draw_removed(axes: Axes, body: Body) -> dict[str, Any]:
    """Hatch the regions of a body that are removed; return their entries of the legend."""
    handles: dict[str, Any] = {}
    look: dict[str, Any] = {
        "facecolor": "none",
        "edgecolor": "0.35",
        "linewidth": 0.0,
        "hatch": "////",
    }
    for region in (load.removes for load in body.every_load if load.removes):
        every = list(_outlines(body.mesh))
        cells = [every[k] for k in body.region(region)]
        axes.add_collection(PolyCollection(cells, **look, zorder=0.6))
        handles[f"removal {body.name}.{region}"] = Patch(**look)
    return handles


def _draw_mesh(axes: Axes, mesh: Mesh, fill: str) -> None:
    """Draw the elements; fine ones are seen as a tint."""
    cells = list(_outlines(mesh))
    axes.add_collection(
        PolyCollection(
            cells, facecolors=fill, edgecolors="0.5", linewidths=0.2, rasterized=True, zorder=0.5,
        )
    )  # fmt: skip


def _outlines(mesh: Mesh) -> Iterator[Array]:
    """Yield the outline of each element (n, 2), through the middles of curved sides."""
    corners = mesh.t.shape[0]
    nodes = mesh.dofs.element_dofs
    order = list(range(corners))
    if nodes.shape[0] >= 2 * corners:
        order = [k for pair in zip(order, range(corners, 2 * corners), strict=True) for k in pair]
    yield from mesh.doflocs[:, nodes[order]].transpose(2, 1, 0)


def _polylines(mesh: Mesh, facets: Array) -> Array:
    """Return points (2, n, n_facets) along facets."""
    ends = mesh.facets[:, facets]
    if (middles := mesh.dofs.facet_dofs) is not None and len(middles):
        ends = np.stack([ends[0], middles[0, facets], ends[1]])
    return np.asarray(mesh.doflocs[:, ends])


def _label(
    axes: Axes, ends: Array, name: str, inch: float, taken: list[Box], *, outside: bool = False
) -> None:
    """Write the name of a line, given by the ends of its pieces (2, n, 2), inside its body.

    It stands at the middle of the part of the line that is seen, unless that is too short. Where it
    would stand on other names, whose boxes are ``taken``, or beyond the axes, it is moved along the
    line, or across it.
    Names of a thin body stand outside of it.
    """
    middle, along = ends.mean(axis=2), ends[:, :, 1] - ends[:, :, 0]
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    seen = (x0 < middle[0]) & (middle[0] < x1) & (y0 < middle[1]) & (middle[1] < y1)
    if np.linalg.norm(along[:, seen], axis=0).sum() < _NAMED * inch:
        return
    here, length = middle[:, seen], np.linalg.norm(along[:, seen], axis=0)
    way = along[:, seen]
    centre = (here * length).sum(axis=1) / length.sum()
    first = int(np.linalg.norm(here - centre[:, None], axis=0).argmin())
    place = np.cumsum(length) - length / 2
    others = [int(np.abs(place - share * length.sum()).argmin()) for share in _SHARES]
    best: tuple[float, int, Array, str, Box] | None = None
    for side in (-1.0, 1.0) if outside else (1.0, -1.0):
        for k in (first, *others):
            left = side * np.array([-way[1, k], way[0, k]]) / length[k]
            ha = "center" if abs(left[0]) < 0.5 else "left" if left[0] > 0 else "right"
            box = _box_of(name, here[:, k] + _OFF * inch * left, ha, inch)
            beyond = (box[1] - box[0]) * (box[3] - box[2]) - _shared(box, (x0, x1, y0, y1))
            covered = beyond + sum(_shared(box, each) for each in taken)
            if best is None or covered < best[0]:
                best = covered, k, left, ha, box
    assert best is not None
    _, k, left, ha, box = best
    taken.append(box)
    axes.annotate(
        name, here[:, k], xytext=tuple(72.0 * _OFF * left), textcoords="offset points",
        fontsize=_NAME, color="0.15", ha=ha, va="center", annotation_clip=True,
        bbox={"boxstyle": "round,pad=0.15", "facecolor": "w", "edgecolor": "none", "alpha": 0.7},
    )  # fmt: skip


def _box_of(name: str, at: Array, ha: str, inch: float) -> Box:
    """Return the box of a name that stands at a place, in which an inch is so many mm."""
    width, height = 0.6 * _NAME / 72.0 * len(name) * inch, 1.4 * _NAME / 72.0 * inch
    x = float(at[0]) - {"left": 0.0, "center": width / 2, "right": width}[ha]
    y = float(at[1]) - height / 2
    return x, x + width, y, y + height


def _shared(one: Box, other: Box) -> float:
    """Return the area that two boxes have in common."""
    across = min(one[1], other[1]) - max(one[0], other[0])
    up = min(one[3], other[3]) - max(one[2], other[2])
    return max(across, 0.0) * max(up, 0.0)


def _told(body: Body) -> str:
    """Return size, elements and kind of a body."""
    mesh = body.mesh
    sides = np.linalg.norm(np.diff(mesh.p[:, mesh.facets], axis=1)[:, 0], axis=0)
    law = "elastic" if body.material.elastic else "elastic-plastic"
    width, height, least, most = map(typeset_number, (*body.box, sides.min(), sides.max()))
    count = f"{mesh.t.shape[1]} elements {body.element}"
    return f"{body.name}: {law}, {width} × {height} mm\n{count}, sides {least} to {most} mm"


def _draw_results(axes: Axes, view: View, places: NamedPlaces | None) -> dict[str, Any]:
    """Draw where results are taken."""
    handles: dict[str, Any] = {}
    across, up = view.map_grid
    if across.size and up.size:
        (x0, x1), (y0, y1) = ((float(each.min()), float(each.max())) for each in (across, up))
        frame = Rectangle(
            (x0, y0),
            x1 - x0,
            y1 - y0,
            fill=False,
            edgecolor=_RESULTS,
            linewidth=1.0,
            linestyle="--",
        )
        axes.add_patch(frame)
        size = f"{typeset_number(x1 - x0)} × {typeset_number(y1 - y0)} mm"
        handles[f"map: {size}"] = Line2D([], [], color=_RESULTS, linewidth=1.0, linestyle="--")
    if view.station.size and view.depth.size:
        rows = [AXES.index(name) for name in view.map_axes]
        for profile in np.split(view.profiles[rows], view.station.size, axis=1):
            axes.plot(*profile, color=_RESULTS, linewidth=1.0, linestyle=":")
        text = f"profiles, {typeset_number(view.depth.max())} mm deep"
        handles[text] = Line2D([], [], color=_RESULTS, linewidth=1.0, linestyle=":")
    lines, points = (places.lines, places.points) if places else ({}, {})
    for (name, line), dashes in zip(lines.items(), cycle(STYLES), strict=False):
        axes.plot(*line.X[:2], color=_RESULTS, linewidth=1.3, linestyle=dashes)
        handles[f"line {name}"] = Line2D([], [], color=_RESULTS, linewidth=1.3, linestyle=dashes)
    for (name, point), marker in zip(points.items(), cycle(_POINTS), strict=False):
        axes.plot(*point.X[:2], color=_RESULTS, marker=marker, linestyle="none")
        handles[f"point {name}"] = Line2D([], [], color=_RESULTS, marker=marker, linestyle="none")
    return handles
