"""Cells of a refinement: boxes in the space of the axes that are numbers, and what is known there.

A cell knows the runs at its corners and at the middles of its edges. In between, a number is
multilinear between the corners, and on each edge it is corrected to the run at its middle. The
correction fades linearly along the edge, and multilinearly towards the other edges of the same
direction. What it leaves is of fourth order inside the cell, and on an edge what is left between
runs that are half an edge apart: three points a cell in two dimensions, where a grid takes four.

References
----------
Gordon, W. J. and Hall, C. A. (1973), Transfinite element methods, Numer. Math. 21, 109: the blend
of edges. Bungartz, H.-J. and Griebel, M. (2004), Sparse grids, Acta Numerica 13, 147, section 3:
hierarchical surpluses, here on edges.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Container, Iterator, Mapping, Sequence
from typing import NamedTuple

from studies.definition.schema import rounded

Point = tuple[float, ...]
"""A value for each axis that is a number."""
Known = Mapping[Point, tuple[float, ...]]
"""The numbers of runs, by where they are."""
Misses = Sequence[tuple[float, ...]]
"""Of each axis, the largest miss of each number on the edges along it."""

ERROR = "cell_error_"
"""Beginning of the name of an error that is left in the cells, in the data set."""
KINK = 0.5
"""Part of a miss in the middle of an edge that may be left once the middle is known, where nothing
is known beyond the edge. The error in a cell is the sum of these over its axes."""


class Edge(NamedTuple):
    """An edge of a cell: its direction, its ends, and its middle."""

    axis: int
    low: Point
    high: Point
    middle: Point


class Cell(NamedTuple):
    """A box.

    Attributes
    ----------
    low, high : corners with the smallest and the largest values
    branch : number of the combination of values on the other axes
    halved : how often it was halved along each axis
    bare : axes along whose edges it asks for no runs in the middle
    """

    low: Point
    high: Point
    branch: int
    halved: tuple[int, ...]
    bare: tuple[int, ...] = ()

    @property
    def corners(self) -> list[Point]:
        """All corners."""
        return list(itertools.product(*zip(self.low, self.high, strict=True)))

    @property
    def edges(self) -> list[Edge]:
        """The edges in whose middle it asks for a run."""
        return [each for each in edges(self.low, self.high) if each.axis not in self.bare]

    @property
    def centre(self) -> Point:
        """The point in the middle; along an axis that cannot be halved, at its low end."""
        pairs = zip(self.low, self.high, strict=True)
        return tuple(low if (m := middle(low, high)) is None else m for low, high in pairs)

    def holds(self, branch: int, point: Point) -> bool:
        """Whether a point of a branch is inside it or on its boundary."""
        sides = zip(self.low, point, self.high, strict=True)
        return branch == self.branch and all(low <= at <= high for low, at, high in sides)

    def divisible(self, axis: int, most: int) -> bool:
        """Whether it can be halved along an axis, and was halved fewer times than ``most``."""
        return self.halved[axis] < most and middle(self.low[axis], self.high[axis]) is not None

    def bared(self, most: int, axes: Collection[int] = ()) -> Cell:
        """Return it without middles of edges along some axes, and along those not `divisible`."""
        every = range(len(self.low))
        bare = tuple(k for k in every if k in axes or not self.divisible(k, most))
        return self._replace(bare=bare)

    def parts(self, axes: Sequence[int]) -> list[Cell]:
        """Return the cells into which halving along some axes divides it."""
        ends: list[list[tuple[float, float]]] = []
        for axis, (low, high) in enumerate(zip(self.low, self.high, strict=True)):
            half = middle(low, high) if axis in axes else None
            ends.append([(low, high)] if half is None else [(low, half), (half, high)])
        halved = tuple(times + (axis in axes) for axis, times in enumerate(self.halved))
        return [
            Cell(tuple(low for low, _ in box), tuple(high for _, high in box), self.branch, halved)
            for box in itertools.product(*ends)
        ]

    @property
    def points(self) -> list[Point]:
        """Where it has runs: at corners, middles of edges, and the first at their centre."""
        own = [*self.corners, *(edge.middle for edge in self.edges)]
        return own if any(self.halved) else list(dict.fromkeys([*own, self.centre]))

    def misses(self, known: Known) -> Misses:
        """Return by how much the ends of the edges miss what is known in their middles."""
        count = len(known[self.low])
        most = [[0.0] * count for _ in self.low]
        for axis, low, high, mid in self.edges:
            share = (mid[axis] - low[axis]) / (high[axis] - low[axis])
            for k, (a, b, m) in enumerate(zip(known[low], known[high], known[mid], strict=True)):
                most[axis][k] = max(most[axis][k], abs(m - a - (b - a) * share))
        return [tuple(each) for each in most]

    def twists(self, known: Known) -> tuple[float, ...]:
        """Return by how much each number at the centre may be off without a miss on any edge.

        A kink through two opposite corners of a face leaves no miss on its edges: all that tells
        is that its corners are in no plane.
        """
        most = [0.0] * len(known[self.low])
        for (a, b), corner in itertools.product(
            itertools.combinations(range(len(self.low)), 2), self.corners
        ):
            if corner[a] != self.low[a] or corner[b] != self.low[b]:
                continue
            one, other = ((*corner[:axis], self.high[axis], *corner[axis + 1 :]) for axis in (a, b))
            both = (*one[:b], self.high[b], *one[b + 1 :])
            corners = zip(*(known[at] for at in (corner, one, other, both)), strict=True)
            for k, (p, q, r, s) in enumerate(corners):
                most[k] = max(most[k], abs(p - q - r + s) / 4.0)
        return tuple(most)

    def off(self, known: Known, at: Point, there: tuple[float, ...]) -> tuple[float, ...]:
        """Return by how much its runs miss the numbers of another run in it."""
        parts = weights(self.low, self.high, at, known).items()
        return tuple(
            abs(number - sum(weight * known[each][k] for each, weight in parts))
            for k, number in enumerate(there)
        )


def middle(low: float, high: float) -> float | None:
    """Return the middle of two values; None if nothing is between them. Of integers an integer."""
    if isinstance(low, int) and isinstance(high, int):
        half: float = (low + high) // 2
    else:
        half = rounded((low + high) / 2.0)
    return half if low < half < high else None


def edges(low: Point, high: Point) -> Iterator[Edge]:
    """Yield the edges of a box that have a middle."""
    for axis, (first, last) in enumerate(zip(low, high, strict=True)):
        half = middle(first, last)
        if half is None:
            continue
        sides = [*zip(low, high, strict=True)]
        for at in itertools.product(*sides[:axis], (half,), *sides[axis + 1 :]):
            start, end = ((*at[:axis], each, *at[axis + 1 :]) for each in (first, last))
            yield Edge(axis, start, end, at)


def weights(low: Point, high: Point, at: Point, runs: Container[Point]) -> dict[Point, float]:
    """Return the weights of the runs of a box in the value at a point in it; their sum is 1.

    Edges without a run in the middle, among all ``runs``, are straight.
    """
    share = [(x - a) / (b - a) for x, a, b in zip(at, low, high, strict=True)]
    found: dict[Point, float] = {}

    def add(point: Point, weight: float) -> None:
        found[point] = found.get(point, 0.0) + weight

    def product(point: Point, leave: int = -1) -> float:
        sides = (s if p == b else 1.0 - s for p, b, s in zip(point, high, share, strict=True))
        return math.prod(side for axis, side in enumerate(sides) if axis != leave)

    for corner in itertools.product(*zip(low, high, strict=True)):
        add(corner, product(corner))
    for axis, first, last, mid in edges(low, high):
        if mid not in runs:
            continue
        a, m, b, x = low[axis], mid[axis], high[axis], at[axis]
        fading = (x - a) / (m - a) if x <= m else (b - x) / (b - m)
        weight = fading * product(mid, leave=axis)
        add(mid, weight)
        add(first, -weight * (b - m) / (b - a))
        add(last, -weight * (m - a) / (b - a))
    return found
