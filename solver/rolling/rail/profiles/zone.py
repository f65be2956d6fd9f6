"""Meshes of plane sections with a zone of small equal elements under a contact.

All are 8-node quadrilaterals, their coordinates (z, y). The zone has rows along the running surface
and straight columns, which turn with the surface, but less. Columns and rows continue through the
section, with growing distances. The boundary ``running`` is the surface of the zone, its facets in
the order of increasing z. The elements of the zone have the first numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from skfem import MeshQuad2

from solver.errors import ModelError
from solver.mesh.lines import graded
from solver.parameters import Coordinate, Length, check
from solver.rolling.rail.profiles.patches import (
    even,
    halved,
    joined_patches,
    patch,
    smooth_patch,
    straight,
)
from solver.rolling.rail.profiles.rail import RailSection
from solver.typing import Array

_GROWTH, _LARGEST = 2.0, 14.0
"""Ratio of neighbouring elements outside the zone; their largest side in a rail [mm]."""
_WEB_ROWS, _FOOT_ROWS, _FOOT_COLUMNS = 4, 3, 7
"""Elements along the web, across the foot, and along the foot on either side of the web."""
_SOLE = 10.0
"""Half the width of the part of the base below the web [mm]."""
_SHARE = 0.4
"""Share of the width of the web that columns of the zone have."""
_TURN = 0.6
"""Turn of columns over that of the surface, at most; and largest share of their distance that they
lose at the bottom of the zone. Parallel columns would meet those next to the zone at 20 degrees
where it reaches the side of the head."""
_SHARPEST = math.sin(math.radians(15.0))
"""Least sine of the angles of elements."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Zone:
    """Where elements are small.

    Attributes
    ----------
    at : position z of the middle on the running surface [mm]
    half_width : half its width, along the surface [mm]
    depth : its depth [mm]
    size : side of the elements [mm]; width and depth are divided into whole numbers of elements
    layer : their side in depth, ``size`` if None [mm]
    split : number of the uppermost rows that are divided into two

    Raises
    ------
    ModelError
        if a length is not positive, a side exceeds half of the width or one in depth the depth, or
        more rows are to be divided than there are
    """

    at: Coordinate
    half_width: Length
    depth: Length
    size: Length
    layer: Length | None = None
    split: int = 0

    def __post_init__(self) -> None:
        check(self)
        deepest = "size" if self.layer is None else "layer"
        for name, most in (("size", self.half_width), (deepest, self.depth)):
            if getattr(self, name) > most:
                raise ModelError(name, getattr(self, name), f"must be at most {most:g} [mm]")
        if not 0 <= self.split <= self._whole:
            raise ModelError("split", self.split, f"must be in 0 to {self._whole}, the rows")

    @property
    def columns(self) -> int:
        """Number of elements across."""
        return round(2 * self.half_width / self.size)

    @property
    def elements(self) -> int:
        """Number of elements."""
        return self.columns * self.rows

    @property
    def _whole(self) -> int:
        """Number of elements in depth before some are divided."""
        return round(self.depth / (self.layer or self.size))

    @property
    def rows(self) -> int:
        """Number of elements in depth."""
        return self._whole + self.split

    @property
    def shares(self) -> Array:
        """Depths (rows + 1,) of the lines between elements, from 0 to 1 of the zone's depth."""
        whole = np.linspace(0.0, 1.0, self._whole + 1)
        upper = halved(whole[: self.split + 1])
        return np.concatenate([upper, whole[self.split + 1 :]])


def rail_mesh(section: RailSection, zone: Zone) -> MeshQuad2:
    """Return the mesh of a rail; its boundaries are ``running`` and ``foot``, the base.

    With zones of 20 x 14 mm and less in the middle of the head, up to 25 mm from its axis, angles
    of elements are from 30 to 150 degrees. A zone over the corner of the head may reach from 13 mm
    below the top to the middle of the head, if it is 10 mm deep. Corners of the rail are flattened
    a little: the area of the mesh is 0.1 % too small.

    Raises
    ------
    ModelError
        for ``at`` or ``half_width``, if the zone leaves the running surface, or reaches so far over
        the side of the head that the elements next to it have too sharp angles; for ``depth``, if
        it is deeper than the head
    """
    outline, places, (right, left) = section.outline, section.places, section.running
    middle = section.place(zone.at)
    low, high = middle - zone.half_width, middle + zone.half_width
    if not right < low < high < left:
        most = min(middle - right, left - middle)
        raise ModelError("half_width", zone.half_width, f"must be below {most:.4g} [mm] there")
    beside = [_beyond(length, zone.size) for length in (left - high, low - right)]
    fans = [len(lines) - 1 for lines in beside]
    widths = np.full(sum(fans), (1 - _SHARE) / sum(fans))
    widths = np.insert(widths, fans[0], np.full(zone.columns, _SHARE / zone.columns))
    shares = halved(np.concatenate([[0.0], np.cumsum(widths)]))

    def across(start: float, end: float) -> Array:
        ends = outline.at(np.array([start, end]))
        return straight(ends[:, 0], ends[:, 1], shares)

    neck, ankle = across(*places["necks"]), across(*places["ankles"])
    web = [
        outline.at(a + (n - a) * even(_WEB_ROWS))
        for a, n in zip(places["ankles"], places["necks"], strict=True)
    ]
    s = halved(np.linspace(high, low, zone.columns + 1))
    block = _columns(outline.at(s), -outline.direction(s), zone)
    foot, base = _foot(section, ankle, shares)
    patches = [
        *_head(section, zone, block, neck, beside, (high, low)),
        patch(ankle, web[1], neck, web[0]),
        *foot,
    ]
    mesh = joined_patches(patches, {"running": block[:, 1::2, -1], "foot": base[:, 1::2]})
    if _sharpest(mesh) < _SHARPEST:
        allowed = "must be smaller or less deep: elements beside the zone would be too sharp"
        raise ModelError("half_width", zone.half_width, allowed)
    return mesh


def _sharpest(mesh: MeshQuad2) -> float:
    """Return the least sine of an angle between the straight sides of an element."""
    X = mesh.p[:, mesh.t]
    side = np.roll(X, -1, axis=1) - X
    side /= np.hypot(*side)
    before = np.roll(side, 1, axis=1)
    return float((before[0] * side[1] - before[1] * side[0]).min())


def _head(
    section: RailSection,
    zone: Zone,
    block: Array,
    neck: Array,
    beside: list[Array],
    ends: tuple[float, float],
) -> list[Array]:
    """Return the patches of the head: the zone, below it, and fans on its left and right.

    Parameters
    ----------
    block : nodes of the zone
    neck : (2, n) nodes across the upper end of the web
    beside : distances from the zone of the lines on its left and on its right [mm]
    ends : lengths along the outline at the left and right end of the zone [mm]
    """
    outline, (right, _) = section.outline, section.running
    first, last = 2 * len(beside[0]) - 2, neck.shape[1] - 2 * len(beside[1]) + 1
    way = block[:, zone.columns, 0] - neck[:, (first + last) // 2]
    if not way[1] > zone.size:
        raise ModelError("depth", zone.depth, f"must be below {zone.depth + way[1]:.4g} [mm]")
    height = float(np.hypot(*way))
    below = height - _beyond(height, zone.size)[::-1]
    sides = [
        straight(neck[:, k], block[:, end, 0], halved(below / height))
        for k, end in ((first, 0), (last, -1))
    ]
    edges = [
        np.concatenate([side[:, :-1], block[:, end]], axis=1)
        for side, end in zip(sides, (0, -1), strict=True)
    ]
    up = 1 - zone.shares[::-1]
    rows = np.concatenate([below, height + zone.depth * up[1:]])
    share = halved(rows / rows[-1])
    fishing = [
        _flattened(outline.at(start + (end - start) * share), -1)
        for start, end in zip(
            section.places["necks"], (section.places["heads"][0], right), strict=True
        )
    ]
    crown = (
        _flattened(outline.at(ends[0] + halved(beside[0][::-1])), 0),
        _flattened(outline.at(ends[1] - halved(beside[1])), -1),
    )
    return [
        block,
        patch(neck[:, first : last + 1], sides[1], block[:, :, 0], sides[0]),
        smooth_patch(
            (neck[:, : first + 1], edges[0], crown[0], fishing[0]), -beside[0][::-1], rows
        ),
        smooth_patch((neck[:, last:], fishing[1], crown[1], edges[1]), beside[1], rows),
    ]


def _foot(section: RailSection, ankle: Array, shares: Array) -> tuple[list[Array], Array]:
    """Return the patches of the foot, below the web and on its left and right, and the base (2, n).

    Parameters
    ----------
    ankle : (2, n) nodes across the lower end of the web
    shares : (n,) their shares of its width
    """
    outline, places = section.outline, section.places
    middle = sum(places["soles"]) / 2
    inner = middle - _SOLE, middle + _SOLE
    bottom = outline.at(inner[0] + 2 * _SOLE * shares)
    inside = [straight(bottom[:, k], ankle[:, k], even(_FOOT_ROWS)) for k in (0, -1)]
    soles, tops, toes = [], [], []
    for k in (0, 1):
        sole, toe, ankles = (places[name][k] for name in ("soles", "toes", "ankles"))
        share = even(_FOOT_COLUMNS)
        soles.append(_flattened(outline.at(sole + (inner[k] - sole) * share), 0))
        tops.append(_flattened(outline.at(toe + (ankles - toe) * share), 0))
        toes.append(_flattened(outline.at(sole + (toe - sole) * even(_FOOT_ROWS)), 0, -1))
    patches = [
        patch(bottom, inside[1], ankle, inside[0]),
        patch(soles[0], inside[0], tops[0], toes[0]),
        patch(soles[1][:, ::-1], toes[1], tops[1][:, ::-1], inside[1]),
    ]
    return patches, np.concatenate([soles[0][:, :-1], bottom, soles[1][:, -2::-1]], axis=1)


def raceway_mesh(
    width: float, height: float, zone: Zone, groove: tuple[float, float] | None = None
) -> MeshQuad2:
    """Return the mesh of a block; its boundaries are ``running`` and ``foot``, the bottom.

    It reaches from -width / 2 to width / 2 and, at z = 0, from y = -height to 0. The zone is in the
    middle, within the groove.

    Parameters
    ----------
    groove : radius of a groove along the block, its lowest line at z = 0, and half the width of
        the groove [mm]; the shoulders beside it are flat. None for a flat block
    """
    half = width / 2
    radius, edge = groove or (math.inf, half)

    def surface(z: Array) -> Array:
        near = np.clip(z, -edge, edge)
        return near**2 / (radius + np.sqrt(radius**2 - near**2)) if groove else 0.0 * z

    s = np.linspace(-zone.half_width, zone.half_width, zone.columns + 1)
    z = radius * np.sin(s / radius) if groove else s
    low, high = z[0], z[-1]
    left = low - _beyond(low + edge, zone.size, half)[:0:-1]
    z = np.concatenate([left, z, high + _beyond(edge - high, zone.size, half)[1:]])
    if edge < half:
        shoulder = edge + _beyond(half - edge, z[-1] - z[-2], half)[1:]
        z = np.concatenate([-shoulder[::-1], z, shoulder])
    below = zone.depth + _beyond(height - zone.depth, zone.layer or zone.size, height)[1:]
    depths = np.concatenate([zone.depth * zone.shares, below])
    lines = halved(z)
    deep = halved(depths)[::-1]
    fade = np.minimum(1.0, (height - deep) / (height - zone.depth))
    X = np.stack(np.broadcast_arrays(lines[:, None], surface(lines)[:, None] * fade - deep))
    middles = X[:, 1::2, -1]
    running = middles[:, (middles[0] > low) & (middles[0] < high)]
    left, right = (2 * int(np.flatnonzero(z == end)[0]) for end in (low, high))
    down = X.shape[2] - 1 - 2 * zone.rows
    beside = X[:, : left + 1, down:], X[:, right:, down:], X[:, :, : down + 1]
    patches = [X[:, left : right + 1, down:], *beside]
    return joined_patches(patches, {"running": running, "foot": X[:, 1::2, 0]})


def _columns(surface: Array, direction: Array, zone: Zone) -> Array:
    """Return the nodes (2, n, m) of the zone, from its bottom to the surface.

    Parameters
    ----------
    surface, direction : (2, n) nodes of the surface, and unit tangents there
    """
    chord = surface[:, -1] - surface[:, 0]
    middle = np.arctan2(chord[1], chord[0])
    turned = np.arctan2(*direction[::-1]) - middle
    step = np.hypot(*np.diff(surface)).min()
    most = abs(np.diff(turned)).max() * zone.depth / step
    angle = middle + min(_TURN, _TURN / most if most else _TURN) * turned
    depth = zone.depth * halved(zone.shares)[::-1]
    return surface[:, :, None] + np.stack([np.sin(angle), -np.cos(angle)])[:, :, None] * depth


def _beyond(length: float, size: float, largest: float = _LARGEST) -> Array:
    """Return the distances of lines from the zone, 0 to ``length``, with growing elements [mm]."""
    return graded(length, min(length, _GROWTH * size), _GROWTH, largest)


def _flattened(points: Array, *ends: int) -> Array:
    """Return a side (2, n) with the edge at its end 0 or -1 flattened by half.

    There it meets another side in the middle of the small arc of a corner. Edges that followed the
    arc would meet at 180 degrees, straight ones would take a quarter of a percent off the area.
    """
    out = points.copy()
    for end in ends:
        a, middle, b = (0, 1, 2) if end == 0 else (-1, -2, -3)
        out[:, middle] = out[:, middle] / 2 + (out[:, a] + out[:, b]) / 4
    return out
