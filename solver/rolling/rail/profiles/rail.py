"""Sections of rails: 60E1, new or with a measured running surface, upright or canted.

Coordinates are (z, y): z across the rail, y up; z = 0 is the axis of the upright rail. The highest
point of the running surface is at y = 0.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
import scipy

from solver.errors import ModelError
from solver.rolling.rail.profiles.outline import Outline, RoundedCorner, arcs, smooth_curve
from solver.typing import Array

Pair = tuple[float, float]


_HEIGHT, _FOOT, _HEAD, _WEB, _TOE = 172.0, 150.0, 72.0, 16.5, 11.5
"""Height; widths of foot, head and web; thickness of the foot at its ends [mm]."""
_UPPER, _LOWER = 51.0, 31.5
"""Fishing surfaces, extended to the axis: depth below the top, height above the base [mm]."""
_FISHING, _SIDE, _TAPER = 1 / 2.75, 1 / 20, 1 / 14
"""Slopes of the fishing surfaces, of the sides of the head (off the vertical), of the foot near its
ends."""
_CROWN, _WIDE, _NARROW = (13.0, 80.0, 300.0), 52.053, 20.456
"""Arcs from the side of the head to its top; widths at the ends of the latter two [mm]."""
_FILLET, _STRAIGHT, _FROM = (120.0, 35.0, 7.0), 32.0, 71.0
"""Arcs from the web to a fishing surface; distances between the centres of the two of 120 and of
the two of 35 on one side, about the middle between the fishing surfaces [mm]."""

_BELOW = 31
"""Number of pieces of the outline below the running surface. They begin at the left side of the
head; piece `_BELOW` - 1 - k on the right mirrors piece k on the left."""
_PLACES = {
    "heads": (0, 0.5),
    "necks": (3, 0.0),
    "ankles": (8, 0.25),
    "toes": (12, 0.5),
    "soles": (14, 0.5),
}
"""Piece of the outline on the left, and share of its length."""


class Rail(ABC):
    """The rail as a wheel sees it."""

    __slots__ = ()

    @property
    @abstractmethod
    def outline(self) -> Outline:
        """Outline of the section, counterclockwise."""

    @property
    @abstractmethod
    def running(self) -> Pair:
        """Lengths along the outline between which a wheel may touch it [mm].

        The first is on the right: z decreases in between.
        """

    def place(self, at: float) -> float:
        """Return the length along the outline of the point of the running surface at z [mm].

        Raises
        ------
        ModelError
            for ``at``, if the head does not reach so far
        """
        ends = np.sort(self.outline.at(np.array(self.running))[0])
        if not ends[0] <= at <= ends[1]:
            raise ModelError("at", at, f"must be from {ends[0]:.4g} to {ends[1]:.4g} [mm]")
        return float(
            scipy.optimize.brentq(
                lambda s: self.outline.at(np.array(s))[0] - at, *self.running, xtol=1e-12
            )
        )


@dataclass(frozen=True, slots=True)
class RailSection(Rail):
    """The section of a rail.

    Attributes
    ----------
    outline : its outline, counterclockwise; it begins at the lower left corner of the head
    """

    outline: Outline

    @property
    def places(self) -> dict[str, Pair]:
        """Lengths along the outline on the left and on the right of corners, by name [mm].

        ``heads``, the lower corners of the head; ``necks`` and ``ankles``, where the fillets of the
        web become narrow at head and foot; ``toes`` and ``soles``, the upper and lower corners of
        the foot.
        """
        lengths = self.outline.lengths
        starts = np.cumsum([0.0, *lengths[:_BELOW]])

        def length(piece: int, share: float) -> float:
            return float(starts[piece] + share * lengths[piece])

        return {
            name: (length(piece, share), length(_BELOW - 1 - piece, 1 - share))
            for name, (piece, share) in _PLACES.items()
        }

    @property
    def running(self) -> Pair:
        """See `Rail.running`; the sides of the head are part of it."""
        left, right = self.places["heads"]
        return right, self.outline.length + left

    def canted(self, slope: float) -> RailSection:
        """Return the section turned about its top, counterclockwise by atan(slope).

        A rail on the right of the track, where z points away from its middle, is canted by 1/40 or
        1/20, one on the left by -1/40 or -1/20.
        """
        return self._with(self.outline.turned(math.atan(slope)))

    def worn(self, points: Array) -> RailSection:
        """Return the section with a measured running surface.

        Its ends are joined to the lower corners of the head by straight sides.

        Parameters
        ----------
        points : (2, n) points (z, y) from left to right, in the frame of this section [mm]. A cubic
            spline goes through them: measurements with noise must be smoothed before.

        Raises
        ------
        ModelError
            for ``points``, if they are fewer than four or z does not increase
        """
        joints, bends = smooth_curve(points)
        below = self.outline.joints[:, : _BELOW + 1], self.outline.bends[: _BELOW + 1]
        return self._with(
            Outline(
                np.hstack([below[0], joints[:, ::-1]]),
                np.concatenate([below[1][:-1], [0.0], -bends[::-1], [0.0]]),
            )
        )

    def _with(self, outline: Outline) -> RailSection:
        """Return a section of this outline, moved so that its top is at y = 0."""
        section = RailSection(outline)
        top = outline.at(np.array(outline.highest(section.running)))[1]
        return RailSection(outline.moved((0.0, -float(top))))


def rail_60e1() -> RailSection:
    """Return the rail 60E1, upright: height 172 mm, foot 150, head 72, web 16.5.

    Its running surface has radii of 300, 80 and 13 mm.

    References
    ----------
    EN 13674-1:2011, annex A: 60E1. Its published area is 76.70 cm2, its second moments are 3 038.3
    and 512.3 cm4, its centroid is 80.95 mm above the base.
    """
    web, foot = _WEB / 2, _FOOT / 2
    ankle, neck = _LOWER - web * _FISHING, _HEIGHT - _UPPER + web * _FISHING
    knee = (_LOWER - _TOE - foot * _TAPER) / (_FISHING - _TAPER)
    crown, width = _crown()
    low = (width + _SIDE * _UPPER) / (1 + _SIDE * _FISHING)
    fillet = _fillet()
    right = (
        RoundedCorner((foot, 0.0), (2.0,)),
        RoundedCorner((foot, _TOE), (4.0,)),
        RoundedCorner((knee, _LOWER - knee * _FISHING), (40.0,)),
        RoundedCorner((web, ankle), _FILLET[::-1], fillet[::-1]),
        RoundedCorner((web, neck), _FILLET, fillet),
        RoundedCorner((low, _HEIGHT - _UPPER + low * _FISHING), (3.0,)),
        RoundedCorner((width, _HEIGHT), _CROWN, crown),
    )
    top, *below = (
        RoundedCorner((-each.at[0], each.at[1]), each.radii[::-1], each.turns[::-1])
        for each in reversed(right)
    )
    return RailSection(Outline.rounded([*below, *right, top]).moved((0.0, -_HEIGHT)))


def _crown() -> tuple[tuple[float, ...], float]:
    """Return the turns of the arcs of the crown, and the half width of the sides at its top.

    The last arc ends at z = 0, so that half the width of the head is the length of the tangent
    there.
    """
    side, (_, middle, last) = math.atan(_SIDE), _CROWN
    first = math.asin(_NARROW / 2 / last)
    second = math.asin((_WIDE / 2 - (last - middle) * math.sin(first)) / middle)
    turns = math.pi / 2 - side - second, second - first, first
    z, y = arcs(math.pi / 2 + side, np.array(_CROWN), np.array(turns)).sum(axis=1)
    return turns, float(-z - y * _SIDE)


def _fillet() -> tuple[float, ...]:
    """Return the turns of the arcs from the web to a fishing surface.

    The centres of the first two are at given heights; the third touches the fishing surface.
    """
    large, middle, small = _FILLET
    first = math.asin((_FROM - _STRAIGHT) / 2 / (large - middle))
    z = _WEB / 2 + large - (large - middle) * math.cos(first)
    slope = math.atan(_FISHING)
    above = (_HEIGHT - _UPPER - _LOWER - _FROM) / 2 + z * _FISHING
    last = math.acos((above * math.cos(slope) - small) / (middle - small))
    return first, math.pi / 2 - slope - first - last, last
