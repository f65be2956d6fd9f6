"""Meshes of the built-in shapes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.errors import ModelError
from studies.scenes import shape_tables as tables
from studies.scenes.table import Span

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from skfem import Mesh

    Array = NDArray[np.float64]

MOST_ELEMENTS = 200_000
"""Elements a built-in shape may have."""
_SAME = 1e-9
_CORE, _BULGE = 0.45, 0.15  # of a disc: half side of its middle square / radius, how round it is


def mesh_of(shape: Any, cells: str) -> Mesh:
    """Return the mesh of a shape, its boundaries named.

    Parameters
    ----------
    shape : a table of `studies.scenes.tables`
    cells : ``quad`` or ``tri``; shapes with curved sides have quadrilaterals

    Raises
    ------
    ModelError
        naming the entry of the shape that is wrong
    """
    if cells == "tri" and not isinstance(shape, tables.RectangleTable | tables.HalfPlaneTable):
        raise ModelError("element", cells, f"a {shape.kind} is meshed with quadrilaterals")
    match shape:
        case tables.RectangleTable():
            return _rectangle(shape, shape.x, shape.y, cells)
        case tables.HalfPlaneTable(extent=extent):
            return _rectangle(
                shape, (0.0 if shape.symmetric else -extent, extent), (-extent, 0.0), cells
            )
        case tables.PadTable():
            return _pad(shape)
        case tables.RingTable():
            return _ring(shape)
        case tables.FilletTable():
            return _fillet(shape)
        case tables.DiscTable():
            return _disc(shape)
        case _:
            return _round(shape)


def _rectangle(
    shape: tables.RectangleTable | tables.HalfPlaneTable | tables.PadTable,
    x: Span,
    y: Span,
    cells: str,
) -> Mesh:
    from solver.mesh import grid

    along, up = _limited([
        _lines(shape, name, span, [(n.at[k], n.size, n.radius) for n in shape.near], shape.size)
        for k, (name, span) in enumerate((("x", x), ("y", y)))
    ])  # fmt: skip
    return grid(along, up, cells)


def _pad(shape: tables.PadTable) -> Mesh:
    from solver.mesh import mapped

    half, R = shape.width / 2, shape.radius
    if not half < R:
        raise ModelError("radius", R, f"must be greater than {half:g}, half the width")
    if not R - math.sqrt(R**2 - half**2) < shape.height:
        raise ModelError("height", shape.height, "must be greater than the arc is high")

    def bent(X: Array) -> Array:
        arc = X[0] ** 2 / (R + np.sqrt(R**2 - X[0] ** 2))
        return np.stack([X[0], arc + X[1] * (1 - arc / shape.height)])

    block = _rectangle(shape, (-half, half), (0.0, shape.height), "quad")
    return mapped(block, bent)


def _ring(shape: tables.RingTable) -> Mesh:
    from solver.mesh import grid, mapped
    from solver.mesh.grids import merged

    inner, outer = shape.radii
    start, end = np.radians(shape.angles)
    if end - start > 2 * np.pi * (1 + _SAME):
        raise ModelError("angles", shape.angles, "must span at most 360 degrees")
    around, across = [], []
    for near in shape.near:
        x, y = near.at[0] - shape.centre[0], near.at[1] - shape.centre[1]
        r = float(np.hypot(x, y))
        if not r:
            raise ModelError("near", near.at, "must not be the centre of the ring")
        angle = start + (np.arctan2(y, x) - start) % (2 * np.pi)
        side = near.size / (r + near.radius)  # as large where the fine part is widest
        across.append((r, near.size, near.radius))
        turns = (angle, angle - 2 * np.pi, angle + 2 * np.pi)  # of a closed ring, both ends
        around += [(float(turn), side, near.radius / r) for turn in turns]
    out, turn = _limited([
        _lines(shape, "radii", (inner, outer), across, shape.size),
        _lines(shape, "angles", (float(start), float(end)), around, shape.size / outer),
    ])  # fmt: skip
    cx, cy = shape.centre
    bent = mapped(
        grid(out, turn),
        lambda X: np.stack([cx + X[0] * np.cos(X[1]), cy + X[0] * np.sin(X[1])]),
    )
    if end - start > 2 * np.pi * (1 - _SAME):
        return _named(merged(bent), {"inner": "left", "outer": "right"})
    names = {"inner": "left", "outer": "right", "start": "bottom", "end": "top"}
    return _named(bent, names)


def _fillet(shape: tables.FilletTable) -> Mesh:
    from solver.mesh import grid, mapped

    wide, narrow, r = shape.wide, shape.narrow, shape.radius
    below, above = shape.lengths
    if not narrow + r < wide:
        raise ModelError("radius", r, f"must be less than {wide - narrow:g}, wide - narrow")
    if not r < above:
        raise ModelError("radius", r, f"must be less than {above:g}, the length above")
    # along the surface from its upper end; across from the surface to the axis and the bottom
    bends = np.array([above - r, np.pi / 2 * r, wide - narrow - r])
    marks = np.concatenate([[0.0], np.cumsum(bends)])
    middle, half = float(marks[1] + bends[1] / 2), float(bends[1] / 2)
    near = [(middle, n.size, max(n.radius, half)) for n in shape.near]
    depth = [(0.0, n.size, n.radius) for n in shape.near]
    across = math.hypot(narrow + r, below + r)  # the longest line across
    lines = _limited([
        _lines(shape, "near", (0.0, float(marks[-1])), near, shape.size, marks[1:3].tolist()),
        _lines(shape, "near", (0.0, across), depth, shape.size),
    ])  # fmt: skip

    def place(X: Array) -> Array:
        s, t = X[0], X[1] / across
        angle = np.clip((s - marks[1]) / r, 0.0, np.pi / 2)
        surface = np.stack([
            narrow + r * (1 - np.cos(angle)) + np.maximum(s - marks[2], 0.0),
            above - np.minimum(s, marks[1]) - r * np.sin(angle),
        ])  # fmt: skip
        down, along = (
            np.minimum(s / middle, 1.0),
            np.maximum((s - middle) / (marks[-1] - middle), 0),
        )
        inside = np.stack([wide * along, above - (above + below) * down])
        return np.asarray((1 - t) * surface + t * inside)

    # the first direction is across, so that elements keep their orientation
    flat = grid(lines[1], lines[0])
    mesh = _named(mapped(flat, lambda X: place(X[::-1])), {"top": "bottom", "right": "top"})
    middles = flat.p[1, flat.facets].mean(axis=0)
    outer, inner = (np.asarray(flat.boundaries[name]) for name in ("left", "right"))
    arc = (middles[outer] > marks[1]) & (middles[outer] < marks[2])
    return mesh.with_boundaries({
        "surface": outer, "fillet": outer[arc],
        "left": inner[middles[inner] < middle], "bottom": inner[middles[inner] > middle],
    })  # fmt: skip


def _disc(shape: tables.DiscTable) -> Mesh:
    from solver.mesh import grid, mapped
    from solver.mesh.grids import merged

    R, size = shape.radius, shape.size
    n = max(2, 2 * round(np.pi * R / 4 / size))  # elements along a quarter of the rim
    m = max(1, round((1 - _CORE) * R / size))
    _few(n * (n + 4 * m))
    square = np.linspace(-1.0, 1.0, n + 1)

    def core(X: Array) -> Array:
        return np.asarray(_CORE * R * X * (1 + _BULGE * (1 - X[::-1] ** 2)))

    def quarter(turn: float) -> Any:
        def place(X: Array) -> Array:
            t, side = X[0], X[1]
            inner = core(np.stack([np.ones_like(side), side]))
            angle = side * np.pi / 4
            rim = R * np.stack([np.cos(angle), np.sin(angle)])
            x, y = (1 - t) * inner + t * rim
            c, s = np.cos(turn), np.sin(turn)
            return np.stack([c * x - s * y, s * x + c * y])

        return place

    blocks = [mapped(grid(square, square), core)]
    strip = grid(np.linspace(0.0, 1.0, m + 1), square)
    blocks += [mapped(strip, quarter(k * np.pi / 2)) for k in range(4)]
    mesh = merged(_joined(blocks))
    cx, cy = shape.centre
    outside = mesh.boundary_facets()
    x, y = mesh.p[:, mesh.facets[:, outside]].mean(axis=1)
    side = np.round(np.arctan2(y, x) / (np.pi / 2)).astype(int) % 4
    names = dict(zip(("east", "north", "west", "south"), range(4), strict=True))
    named = {"rim": outside} | {name: outside[side == k] for name, k in names.items()}
    return mesh.translated((cx, cy)).with_boundaries(named)


def _joined(blocks: Sequence[Any]) -> Any:
    """Return quadratic meshes as one, their common nodes twice."""
    from skfem import MeshQuad, MeshQuad2

    corners = [block.p[:, : block.nvertices] for block in blocks]
    first = np.cumsum([0, *(c.shape[1] for c in corners)])
    cells = np.hstack([block.t + k for block, k in zip(blocks, first, strict=False)])
    straight = MeshQuad(np.hstack(corners), cells, sort_t=False)
    joined = MeshQuad2.from_mesh(straight)
    nodes = joined.doflocs.copy()
    own = np.dstack([block.doflocs[:, block.dofs.element_dofs] for block in blocks])
    nodes[:, joined.dofs.element_dofs] = own
    return MeshQuad2(doflocs=nodes, t=joined.t, sort_t=False, validate=False)


def _round(shape: tables.RoundTable) -> Mesh:
    from solver.mesh import grid, mapped
    from solver.mesh.ball import ball_lines, onto_disc

    if not shape.size <= shape.fine <= shape.radius:
        raise ModelError("fine", shape.fine, f"must be from {shape.size:g} to {shape.radius:g}")
    lines = ball_lines(shape.radius, shape.fine, shape.size, shape.growth)
    along = lines if shape.symmetric else np.concatenate([-lines[:0:-1], lines])
    _limited([along, lines])
    across = lines if shape.above else -lines[::-1]
    bent = mapped(grid(along, across), lambda X: onto_disc(X, shape.radius))
    surface, cap = ("bottom", "top") if shape.above else ("top", "bottom")
    names = {"surface": surface, "cap": cap, "left": "left", "right": "right"}
    return _named(bent, names).translated(shape.at)


def _lines(
    shape: Any, name: str, span: Span, near: Sequence[tuple[float, float, float]],
    largest: float, through: Sequence[float] = (),
) -> Array:  # fmt: skip
    """Return node positions over a span, fine near some positions: (position, side, radius).

    Of those it goes ``through``, each is a node.
    """
    from solver.mesh.grids import refined

    start, end = span
    if not end > start:
        raise ModelError(name, list(span), "must be two increasing numbers")
    if (end - start) / largest > MOST_ELEMENTS:
        raise ModelError("size", shape.size, f"makes more than {MOST_ELEMENTS} elements")
    marks: dict[float, float] = dict.fromkeys((start, *through, end), np.inf)
    fine: list[tuple[float, float, float]] = []
    for at, side, radius in near:
        low, high = max(at - radius, start), min(at + radius, end)
        if low > high:
            continue  # outside of this span: the elements nearest to it stay as they are
        for mark in (low, high):
            marks[mark] = min(marks.get(mark, np.inf), side)
        fine.append((low, high, side))
    points = sorted(marks)
    points = [p for k, p in enumerate(points) if not k or p - points[k - 1] > _SAME * (end - start)]
    sides = [min((s for low, high, s in fine if low <= a and b <= high), default=largest)
             for a, b in pairwise(points)]  # fmt: skip
    return refined(points, [marks[p] for p in points], shape.growth, sides)


def _limited(lines: list[Array]) -> list[Array]:
    """Return the lines of a grid, if its elements are not too many."""
    _few((len(lines[0]) - 1) * (len(lines[1]) - 1))
    return lines


def _few(count: int) -> None:
    """Refuse a mesh of too many elements."""
    if count > MOST_ELEMENTS:
        raise ModelError("size", f"{count} elements", f"at most {MOST_ELEMENTS} elements")


def _named(mesh: Mesh, names: dict[str, str]) -> Mesh:
    """Return a mesh whose boundaries have these names in place of those of its grid."""
    from dataclasses import replace

    known = mesh.boundaries or {}
    return replace(mesh, _boundaries={new: known[old] for new, old in names.items()})
