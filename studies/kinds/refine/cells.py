"""Cells of a refinement: boxes in the space of the axes that are numbers, and what is known there.

A cell knows the runs at its corners and at the middles of its edges. In between, a number is
multilinear between the corners, and on each edge it is corrected to the run at its middle. The
correction fades linearly along the edge, and multilinearly towards the other edges of the same
direction. What it leaves is of fourth order inside the cell, and on an edge what is left between
runs that are half an edge apart: three points a cell in two dimensions, where a grid takes four.

The runs around a cell tell the errors that are left between its own: a line along an axis goes on
beyond it, and where its slope changes tells whether what is left between two runs is that of a kink
or that of a smooth curve.

References
----------
Gordon, W. J. and Hall, C. A. (1973), Transfinite element methods, Numer. Math. 21, 109: the blend
of edges. Bungartz, H.-J. and Griebel, M. (2004), Sparse grids, Acta Numerica 13, 147, section 3:
hierarchical surpluses, here on edges.
"""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left
from collections.abc import Collection, Container, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from studies.definition.schema import rounded

Point = tuple[float, ...]
"""A value for each axis that is a number."""
Known = Mapping[Point, tuple[float, ...]]
"""The numbers of runs, by where they are."""
Misses = Sequence[tuple[float, ...]]
"""Of each axis, the largest miss of each number on the edges along it."""

ERROR = "cell_error_"
"""Beginning of the name of an error that is left in the cells, in the data set."""
_NEAR = 1.0 + 1e-9
"""Factor on a distance within which all runs of this distance are found."""
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


class Around:
    """The runs of a refinement, to be found from its cells.

    Parameters
    ----------
    span : length of each axis that is a number
    numbers : by branch and place, the numbers of each run; None if it failed
    """

    def __init__(
        self, span: Sequence[float], numbers: Mapping[tuple[int, Point], tuple[float, ...] | None]
    ) -> None:
        from scipy.spatial import KDTree  # takes long to load

        self._numbers, self._span = numbers, np.array(span)
        self._points: dict[int, list[Point]] = {}
        for branch, at in numbers:
            self._points.setdefault(branch, []).append(at)
        self._trees = {
            branch: KDTree(np.array(each) / self._span) for branch, each in self._points.items()
        }
        self._lines: dict[Any, list[float]] = {}
        for (branch, at), number in numbers.items():
            for axis, value in enumerate(at if number else ()):
                line = branch, axis, at[:axis], at[axis + 1 :]
                self._lines.setdefault(line, []).append(value)
        for values in self._lines.values():
            values.sort()

    def of(self, cell: Cell) -> dict[Point, tuple[float, ...] | None]:
        """Return the numbers of the runs in a cell and on its boundary, by their places."""
        low, high = np.array(cell.low) / self._span, np.array(cell.high) / self._span
        reach = (high - low).max() / 2.0 * _NEAR
        near = self._trees[cell.branch].query_ball_point((low + high) / 2.0, reach, p=math.inf)
        places = (self._points[cell.branch][k] for k in sorted(near))
        held = (at for at in places if cell.holds(cell.branch, at))
        return {at: self._numbers[cell.branch, at] for at in held}

    def left(self, cell: Cell, known: Known) -> tuple[Misses, tuple[float, ...]]:
        """Return of each axis the largest error of each number that is left on the edges along it.

        Beyond the first and the last run of a line the slope is taken to change as it does inside.
        It is infinite along an axis where all lines end with their edges, without a third run.
        The second result is the largest error of each number that kinks at corners may leave: a
        quarter of what a change of slope at a corner makes along an edge.
        """
        none = (0.0,) * len(next(iter(known.values())))
        found, turns, untold = [none for _ in cell.low], none, set(range(len(cell.low)))
        every = list(edges(cell.low, cell.high))
        for axis, low, high, mid in every:
            sides = mid[:axis], mid[axis + 1 :]
            line = self._lines[cell.branch, axis, *sides]
            own = [each[axis] for each in (low, mid, high) if each in known]
            first, last, beyond = own[1] - own[0], own[-1] - own[-2], 4 - len(own)
            below = _beyond(line, own[0], -first, beyond)
            above = _beyond(line, own[-1], last, beyond)
            xs = [*below[::-1], *own, *above]
            if len(xs) == 2:
                continue
            untold -= {axis}
            runs = [self._numbers[cell.branch, (*sides[0], x, *sides[1])] or () for x in xs]
            slopes = np.diff(runs, axis=0).T / np.diff(xs)
            before, after = beyond - len(below), beyond - len(above)
            errors, corners = [], []
            for each in np.diff(slopes).tolist():
                jumps = [each[0]] * before + each + [each[-1]] * after
                ends = between(first, *jumps[-3:]), between(last, *jumps[2::-1])
                errors.append(max(ends))
                inner = itertools.pairwise(jumps[beyond - 1 : len(jumps) + 1 - beyond])
                corners.append(max(abs(a - b) for a, b in inner) * (own[-1] - own[0]) / 4.0)
            found[axis] = tuple(map(max, zip(found[axis], errors, strict=True)))
            turns = tuple(map(max, zip(turns, corners, strict=True)))
        for axis in untold & {each.axis for each in every}:
            found[axis] = (math.inf,) * len(none)
        return found, turns


def _beyond(line: Sequence[float], at: float, step: float, count: int) -> list[float]:
    """Return runs of a line beyond another one, each about a step further, as far as there are."""
    found: list[float] = []
    for _ in range(count):
        k = bisect_left(line, at + step)
        near = [each for each in line[max(k - 1, 0) : k + 1] if (each - at) * step > 0.0]
        if not near:
            break
        at = min(near, key=lambda each: abs(math.log((each - at) / step)))
        found.append(at)
    return found


def between(length: float, before: float, after: float, further: float) -> float:
    """Return the error that is left between two runs, by the changes of slope around them.

    A kink between the two changes the slope at both and nowhere else: it is where the straight
    lines from both sides meet, and the error is its distance from the line between the runs. A
    change of slope that is also at a third run is that of a smooth curve.

    Parameters
    ----------
    length : distance of the two runs
    before, after : change of slope at each of them
    further : the same at the run behind the second one

    References
    ----------
    Rote, G. (1992), The convergence rate of the sandwich algorithm for approximating convex
    functions, Computing 48, 337: the triangle of two tangents and their secant.
    """
    smooth = 0.0
    if before * after > 0.0 and after * further > 0.0:
        smooth = math.copysign(min(abs(before), abs(after), abs(further)), after)
    a, b = before - smooth, after - smooth
    kink = a * b / (a + b) if a * b > 0.0 else 0.5 * min(abs(a), abs(b))
    return length * (abs(kink) + abs(smooth) / 8.0)
