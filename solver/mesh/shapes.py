"""Meshes of shapes: rectangle, half-plane, pad, ring, fillet, disc and ball.

All have named boundaries. ``size`` is the largest element side. A `Near` sets a smaller side around
a point, from which elements grow by ``growth``, the ratio of neighbouring sides. Lengths are in mm.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
from annotated_types import Interval, Unit
from skfem import Mesh

from solver.errors import ModelError
from solver.mesh.grids import grid, joined, mapped, merged, renamed
from solver.mesh.lines import continued, refined
from solver.parameters import Checked, Coordinate, Length, require
from solver.typing import Array

Pair = tuple[Coordinate, Coordinate]
Lengths = tuple[Length, Length]
Angles = tuple[Annotated[float, Unit("deg")], Annotated[float, Unit("deg")]]
Growth = Annotated[float, Interval(gt=1.0, le=3.0)]
Radius = Annotated[float, Interval(ge=0.0, le=1e6), Unit("mm")]


_MOST_ELEMENTS = 200_000
"""Largest number of elements of a shape."""
_SAME = 1e-9
_CORE, _BULGE = 0.45, 0.15
"""Middle square of a disc: half side over radius, and roundness."""
_EXTENT = 6.0
"""Side of the grid that is mapped onto a ball, over its radius. The map leaves out a cap on the far
side."""
_FINE = 3.0
"""Fine extent of a ball over its radius, at most."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Near(Checked):
    """A finely meshed region: elements have the side ``size`` within ``radius`` of ``at`` [mm]."""

    at: Pair
    size: Length
    radius: Radius = 0.0


def rectangle(
    x: Pair,
    y: Pair,
    *,
    size: Length,
    growth: Growth = 1.3,
    near: Sequence[Near] = (),
    cells: str = "quad",
) -> Mesh:
    """Return the rectangle from ``x[0]`` to ``x[1]`` and ``y[0]`` to ``y[1]``.

    Its boundaries are left, right, bottom and top; its cells are ``quad`` or ``tri``.
    """
    spread = _Spread(size, growth)
    along, up = (
        spread.lines(name, span, [(n.at[k], n.size, n.radius) for n in near])
        for k, (name, span) in enumerate((("x", x), ("y", y)))
    )
    few((len(along) - 1) * (len(up) - 1))
    return grid(along, up, cells)


def half_plane(
    extent: Length,
    *,
    size: Length,
    growth: Growth = 1.3,
    near: Sequence[Near] = (),
    symmetric: bool = False,
    cells: str = "quad",
) -> Mesh:
    """Return a rectangle below y = 0 of depth ``extent`` and twice this width.

    If ``symmetric``, it is the half x >= 0. Its boundaries are left, right, bottom and top.
    """
    _positive(extent=extent)
    x = (0.0 if symmetric else -extent, extent)
    return rectangle(x, (-extent, 0.0), size=size, growth=growth, near=near, cells=cells)


def pad(
    width: Length,
    height: Length,
    radius: Length,
    *,
    size: Length,
    growth: Growth = 1.3,
    near: Sequence[Near] = (),
) -> Mesh:
    """Return a block above y = 0 whose bottom is an arc of ``radius`` that touches the origin.

    Its top is at y = ``height``. Its boundaries are left, right, bottom and top.
    """
    _positive(width=width, height=height, radius=radius)
    half, R = width / 2, radius
    if not half < R:
        raise ModelError("radius", R, f"must be greater than {half:g}, half the width")
    if not R - math.sqrt(R**2 - half**2) < height:
        raise ModelError("height", height, "must be greater than the height of the arc")

    def bent(X: Array) -> Array:
        arc = X[0] ** 2 / (R + np.sqrt(R**2 - X[0] ** 2))
        return np.stack([X[0], arc + X[1] * (1 - arc / height)])

    block = rectangle((-half, half), (0.0, height), size=size, growth=growth, near=near)
    return mapped(block, bent)


def ring(
    radii: Lengths,
    angles: Angles = (0.0, 360.0),
    centre: Pair = (0.0, 0.0),
    *,
    size: Length,
    growth: Growth = 1.3,
    near: Sequence[Near] = (),
) -> Mesh:
    """Return the sector between two radii and between two angles [degrees].

    Its boundaries are inner, outer, and, unless it is closed, start and end.
    """
    inner, outer = radii
    _positive(radii=inner)
    start, end = (math.radians(angle) for angle in angles)
    if end - start > 2 * np.pi * (1 + _SAME):
        raise ModelError("angles", angles, "must span at most 360 degrees")
    along, across = [], []
    for each in near:
        x, y = each.at[0] - centre[0], each.at[1] - centre[1]
        r = math.hypot(x, y)
        if not r:
            raise ModelError("near", each.at, "must not be the centre of the ring")
        angle = start + (math.atan2(y, x) - start) % (2 * np.pi)
        side = each.size / (r + each.radius)  # elements are widest at the outer end of the part
        across.append((r, each.size, each.radius))
        turns = (angle, angle - 2 * np.pi, angle + 2 * np.pi)  # both ends of a closed ring
        along += [(turn, side, each.radius / r) for turn in turns]
    out = _Spread(size, growth).lines("radii", (inner, outer), across)
    turn = _Spread(size / outer, growth).lines("angles", (start, end), along)
    few((len(out) - 1) * (len(turn) - 1))
    cx, cy = centre
    bent = mapped(
        grid(out, turn),
        lambda X: np.stack([cx + X[0] * np.cos(X[1]), cy + X[0] * np.sin(X[1])]),
    )
    if end - start > 2 * np.pi * (1 - _SAME):
        return renamed(merged(bent), {"inner": "left", "outer": "right"})
    names = {"inner": "left", "outer": "right", "start": "bottom", "end": "top"}
    return renamed(bent, names)


def fillet(
    wide: Length,
    narrow: Length,
    radius: Length,
    lengths: Lengths,
    *,
    size: Length,
    growth: Growth = 1.3,
    near: Sequence[Near] = (),
) -> Mesh:
    """Return the half x >= 0 of a bar that narrows from ``wide`` to ``narrow`` over a fillet.

    The fillet begins at y = 0; the bar extends by ``lengths`` below and above. Widths are those of
    the half. A `Near` refines the whole fillet. Its boundaries are left (the axis), bottom, right
    (the side of the wide part), surface, fillet and top.
    """
    below, above = lengths
    _positive(wide=wide, narrow=narrow, radius=radius, lengths=min(lengths))
    r = radius
    if not narrow + r < wide:
        raise ModelError("radius", r, f"must be less than {wide - narrow:g}, wide - narrow")
    if not r < above:
        raise ModelError("radius", r, f"must be less than {above:g}, the length above")
    # along the surface from its upper end; across from the surface to the axis and the bottom
    bends = np.array([above - r, np.pi / 2 * r, wide - narrow - r])
    marks = np.concatenate([[0.0], np.cumsum(bends)])
    middle, half = float(marks[1] + bends[1] / 2), float(bends[1] / 2)
    along = [(middle, n.size, max(n.radius, half)) for n in near]
    depth = [(0.0, n.size, n.radius) for n in near]
    across = math.hypot(narrow + r, below + r)  # length of the longest line across
    spread = _Spread(size, growth)
    through = [float(marks[1]), middle, float(marks[2])]  # also the corner of axis and bottom
    along_it = spread.lines("near", (0.0, float(marks[-1])), along, through)
    across_it = spread.lines("near", (0.0, across), depth)
    few((len(along_it) - 1) * (len(across_it) - 1))

    def place(X: Array) -> Array:
        s, t = X[0], X[1] / across
        angle = np.clip((s - marks[1]) / r, 0.0, np.pi / 2)
        surface = np.stack([
            narrow + r * (1 - np.cos(angle)) + np.maximum(s - marks[2], 0.0),
            above - np.minimum(s, marks[1]) - r * np.sin(angle),
        ])  # fmt: skip
        down = np.minimum(s / middle, 1.0)
        aside = np.maximum((s - middle) / (marks[-1] - middle), 0)
        inside = np.stack([wide * aside, above - (above + below) * down])
        return np.asarray((1 - t) * surface + t * inside)

    # the first direction is across, so that elements keep their orientation
    flat = grid(across_it, along_it)
    mesh = renamed(mapped(flat, lambda X: place(X[::-1])), {"top": "bottom", "right": "top"})
    middles = flat.p[1, flat.facets].mean(axis=0)
    outer, inner = (np.asarray(flat.boundaries[name]) for name in ("left", "right"))
    arc = (middles[outer] > marks[1]) & (middles[outer] < marks[2])
    return mesh.with_boundaries({
        "surface": outer, "fillet": outer[arc],
        "left": inner[middles[inner] < middle], "bottom": inner[middles[inner] > middle],
    })  # fmt: skip


def disc(radius: Length, centre: Pair = (0.0, 0.0), *, size: Length) -> Mesh:
    """Return a whole disc of nearly equal elements.

    Its boundaries are the rim and its quarters east, north, west and south.
    """
    _positive(radius=radius, size=size)
    R = radius
    n = max(2, 2 * round(np.pi * R / 4 / size))  # elements along a quarter of the rim
    m = max(1, round((1 - _CORE) * R / size))
    few(n * (n + 4 * m))
    square = np.linspace(-1.0, 1.0, n + 1)

    def core(X: Array) -> Array:
        return np.asarray(_CORE * R * X * (1 + _BULGE * (1 - X[::-1] ** 2)))

    def quarter(turn: float) -> Callable[[Array], Array]:
        def place(X: Array) -> Array:
            t, side = X[0], X[1]
            inner = core(np.stack([np.ones_like(side), side]))
            angle = side * np.pi / 4
            rim = R * np.stack([np.cos(angle), np.sin(angle)])
            x, y = (1 - t) * inner + t * rim
            c, s = np.cos(turn), np.sin(turn)
            return np.stack([c * x - s * y, s * x + c * y])

        return place

    strip = grid(np.linspace(0.0, 1.0, m + 1), square)
    quarters = [mapped(strip, quarter(k * np.pi / 2)) for k in range(4)]
    mesh = joined([mapped(grid(square, square), core), *quarters])
    outside = mesh.boundary_facets()
    x, y = mesh.p[:, mesh.facets[:, outside]].mean(axis=1)
    side = np.round(np.arctan2(y, x) / (np.pi / 2)).astype(int) % 4
    named = {"rim": outside}
    named |= {each: outside[side == k] for k, each in enumerate(("east", "north", "west", "south"))}
    return mesh.translated(centre).with_boundaries(named)


def ball(
    radius: Length,
    at: Pair = (0.0, 0.0),
    *,
    size: Length,
    fine: Length,
    growth: Growth = 1.3,
    above: bool = True,
    symmetric: bool = False,
) -> Mesh:
    """Return a disc, the section of a ball or a cylinder, that touches the line y = ``at[1]``.

    It touches the line at ``at`` from above or below, with its boundary ``surface``. If
    ``symmetric``, it is the half x >= ``at[0]``, and ``left`` is its axis. A cap is left out on the
    far side, from 1.5 radii away on the axis to 1.8 at the surface, with the boundaries ``cap`` and
    ``right``, and for a whole disc ``left``.

    Parameters
    ----------
    size : side of the elements at ``at`` [mm]
    fine : distance from ``at`` up to which elements have this side [mm]
    growth : ratio of neighbouring sides farther away
    """
    lines = ball_lines(radius, fine, size, growth)
    along = lines if symmetric else np.concatenate([-lines[:0:-1], lines])
    across = lines if above else -lines[::-1]
    few((len(along) - 1) * (len(across) - 1))
    bent = mapped(grid(along, across), lambda X: _onto_disc(X, radius))
    surface, cap = ("bottom", "top") if above else ("top", "bottom")
    sides = {"surface": surface, "cap": cap, "left": "left", "right": "right"}
    return renamed(bent, sides).translated(at)


def ball_lines(radius: Length, fine: Length, size: Length, growth: Growth) -> Array:
    """Return the lines, from 0 on, of the grid that is mapped onto a ball [mm].

    Their spacing is ``size`` up to ``fine``, then it grows.
    """
    _positive(radius=radius, size=size)
    if not size <= fine <= _FINE * radius:
        raise ModelError("fine", fine, f"must be from {size:g} to {_FINE * radius:g}")
    extent = _EXTENT * radius
    even = np.linspace(0.0, fine, max(1, round(fine / size)) + 1)
    return continued(even, extent - fine, size, growth, extent / 4)


def _onto_disc(x: Array, radius: Length) -> Array:
    """Map points (2, n) of a half-plane onto a disc in the same half-plane that touches y = 0.

    The Moebius map ``w = z / (1 - i z / 2 R)`` hardly moves points near the origin, and maps the
    line y = 0 to the circle. It preserves angles, so that squares remain nearly square.
    """
    side = np.where(x[1].mean() < 0, -1.0, 1.0)
    z = x[0] + 1j * side * x[1]
    w = z / (1 - 0.5j * z / radius)
    return np.stack([w.real, side * w.imag])


@dataclass(frozen=True, slots=True)
class _Spread(Checked):
    """Grading along one direction: the largest side, and the ratio of neighbouring sides."""

    size: Length
    growth: Growth

    def lines(
        self,
        name: str,
        span: Pair,
        near: Sequence[tuple[float, float, float]],
        through: Sequence[float] = (),
    ) -> Array:
        """Return node positions over a span, with nodes at the positions ``through``.

        ``near`` are the fine parts: position, side, radius.
        """
        start, end = span
        if not -math.inf < start < end < math.inf:
            raise ModelError(name, list(span), "must be two increasing numbers")
        if (end - start) / self.size > _MOST_ELEMENTS:
            raise ModelError("size", self.size, f"makes more than {_MOST_ELEMENTS} elements")
        marks: dict[float, float] = dict.fromkeys((start, *through, end), np.inf)
        fine: list[tuple[float, float, float]] = []
        for at, side, radius in near:
            low, high = max(at - radius, start), min(at + radius, end)
            if low > high:
                continue
            for mark in (low, high):
                marks[mark] = min(marks.get(mark, np.inf), side)
            fine.append((low, high, side))
        points = sorted(marks)
        same = _SAME * (end - start)
        points = [p for k, p in enumerate(points) if not k or p - points[k - 1] > same]
        sides = [
            min((s for low, high, s in fine if low <= a and b <= high), default=self.size)
            for a, b in pairwise(points)
        ]
        return refined(points, [marks[p] for p in points], self.growth, sides)


def few(count: int) -> None:
    """Raise `ModelError` if a mesh has too many elements."""
    if count > _MOST_ELEMENTS:
        raise ModelError("size", f"{count} elements", f"at most {_MOST_ELEMENTS} elements")


def _positive(**lengths: float) -> None:
    """Raise `ModelError` for lengths that are not positive and finite."""
    for name, length in lengths.items():
        require(name, length, Length)
