"""The runs around a cell of a refinement, which tell the errors that are left between its own.

A line along an axis goes on beyond a cell. Where its slope changes tells whether what is left
between two runs is that of a kink or that of a smooth curve.
"""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from studies.kinds.refine.cells import Cell, Known, Misses, Point, edges

_NEAR = 1.0 + 1e-9
"""Factor on a distance within which all runs of this distance are found."""


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
