"""Searches that begin where others let expect their goal: which wait for which, and where it is.

The places of the axes are points, with each number scaled to its range; words part them into
groups. Of a group the first place comes first, then always the one that is farthest from all before
it. The first two are of level 0. Of the others the distance tells the level: from the largest one
down to half of it they are of level 1, down to half of that of level 2, and so on. A place waits
for those nearest to it of lower levels, so that the places of one level are searched at the same
time. Between them a cubic spline through their values tells where the goal may be.

References
----------
Gonzalez, T. F. (1985), Clustering to minimize the maximum intercluster distance, Theor. Comput.
Sci. 38, 293: the order. Wendland, H. (2005), Scattered Data Approximation, section 8.3: radial
functions r^3 with a linear polynomial, in one dimension the natural cubic spline.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from heapq import heapify, heappop, heappush
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from solver.parameters import is_number
from studies.definition.identity import canonical

Array = NDArray[np.float64]

_NEAREST = 12
"""Largest number of places by which a value is foreseen."""
_ROUNDING = 1.0 + 1e-9
"""Factor on a distance within which all places of this distance are found."""


class Neighbours:
    """The places of the axes of a study.

    Attributes
    ----------
    before : of each place the numbers of those it waits for; none of the first ones
    """

    def __init__(self, sets: Sequence[Mapping[str, Any]]) -> None:
        names = [name for name in sets[0] if all(is_number(each[name]) for each in sets)]
        numbers = np.array([[float(each[name]) for name in names] for each in sets])
        span = np.ptp(numbers, axis=0)
        self._at = _without_switches(numbers[:, span > 0.0] / span[span > 0.0])
        self.before: list[list[int]] = [[] for _ in sets]
        groups: dict[str, list[int]] = {}
        for number, each in enumerate(sets):
            words = {name: value for name, value in each.items() if name not in names}
            groups.setdefault(canonical(words), []).append(number)
        for group in groups.values():
            self._order(np.array(group))

    def _order(self, group: NDArray[np.int64]) -> None:
        """Tell of each place of a group which it waits for."""
        at = self._at[group]
        level = _levels(at)
        for each in range(1, level.max() + 1):
            lower, own = (np.flatnonzero(level < each), np.flatnonzero(level == each))
            tree = KDTree(at[lower])
            farthest = tree.query(at[own], [min(_NEAREST, len(lower))])[0][:, 0]
            balls = tree.query_ball_point(at[own], farthest * _ROUNDING)
            for k, ball in zip(own.tolist(), balls, strict=True):
                near = lower[np.sort(ball)]  # several may be equally far: the first ones count
                apart = np.linalg.norm(at[near] - at[k], axis=1)
                nearest = near[np.argsort(apart, kind="stable")[:_NEAREST]]
                self.before[group[k]] = group[nearest].tolist()

    def foreseen(self, number: int, values: Sequence[float]) -> float | None:
        """Return what the values of the places it waits for let expect at a place; None of none.

        Those that are NaN do not count.
        """
        known = np.isfinite(values)
        if not known.any():
            return None
        places = self._at[np.array(self.before[number])[known]]
        count, dimensions = places.shape

        def terms(at: Array) -> Array:
            apart = np.linalg.norm(at[:, None] - places[None], axis=2)
            return np.hstack([apart**3, np.ones((len(at), 1)), at - places[0]])

        system = np.zeros((count + dimensions + 1,) * 2)
        system[:count] = terms(places)
        system[count:, :count] = system[:count, count:].T
        right = np.zeros(len(system))
        right[:count] = np.asarray(values)[known]
        weights = np.linalg.lstsq(system, right, rcond=1e-10)[0]  # too few places: the least slope
        return float((terms(self._at[[number]]) @ weights).item())


def _levels(at: Array) -> NDArray[np.int64]:
    """Return the level (n,) of each place (n, d) of a group.

    A place that comes changes the distances only of places nearer to it than it was to all before
    it: these are found by a tree, and the farthest of all by a heap.
    """
    level = np.zeros(len(at), dtype=int)
    away = np.linalg.norm(at - at[0], axis=1)
    farthest = float(away.max())
    if farthest == 0.0:
        return level
    tree, first = KDTree(at), True
    order = [(-far, k) for k, far in enumerate(away.tolist())]
    heapify(order)
    while order[0][0] < 0.0:
        far, k = heappop(order)
        if -far != away[k]:
            continue  # it is in the order once more, as it is now
        level[k] = 0 if first else 1 + int(math.log2(farthest / away[k]) + 1e-9)
        first = False
        near = np.array(tree.query_ball_point(at[k], -far * _ROUNDING))
        apart = np.linalg.norm(at[near] - at[k], axis=1)
        closer = apart < away[near]
        away[near[closer]] = apart[closer]
        for each, distance in zip(near[closer].tolist(), apart[closer].tolist(), strict=True):
            heappush(order, (-distance, each))
    return level


def _without_switches(at: Array) -> Array:
    """Return places (n, d) without numbers of two values, if all differ in the others too.

    Such as a traction that is 0 without friction, and else 1: distances count along the friction.
    """
    several = [len(np.unique(each)) > 2 for each in at.T]
    rest = at[:, several]
    return rest if len(np.unique(rest, axis=0)) == len(np.unique(at, axis=0)) else at
