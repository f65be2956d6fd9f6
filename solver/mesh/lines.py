"""Node positions along one direction of a grid."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from solver.errors import ModelError
from solver.typing import Array

_MOST = 1_000_000
"""Largest number of elements along a line."""
_SLIVER = 0.5
"""Length of the elements that grow from a point, over their first side. If the ratio is smaller,
the elements from the other point fill the whole length."""


def graded(length: float, smallest: float, ratio: float, largest: float) -> Array:
    """Return node positions from 0 to ``length``, growing geometrically from ``smallest``.

    Element sizes are smallest, smallest * ratio, ... up to ``largest``. One factor, at most 1, then
    scales them all to fill ``length`` exactly.
    """
    if not 0 < smallest <= length:
        raise ModelError("smallest", smallest, f"must be in (0, {length:g}] [mm]")
    if not ratio >= 1:
        raise ModelError("ratio", ratio, "must be at least 1")
    sizes: list[float] = []
    total, size, most = 0.0, smallest, max(largest, smallest)
    too_long = length > 2 * _MOST * most  # saves the loop
    while total < length * (1 - 1e-9):
        if too_long or len(sizes) == _MOST:
            allowed = f"must make at most {_MOST} elements along {length:g} mm"
            raise ModelError("size", smallest, allowed)
        sizes.append(min(size, most))
        total += sizes[-1]
        size *= ratio
    nodes = np.concatenate([[0.0], np.cumsum(sizes)])
    return np.asarray(nodes * (length / nodes[-1]))


def continued(
    lines: Array,
    length: float,
    smallest: float,
    ratio: float,
    largest: float,
    *,
    both: bool = False,
) -> Array:
    """Return grid lines extended by ``length`` beyond the last, graded as by `graded` [mm].

    With ``both`` they are extended before the first line too.
    """
    beyond = graded(length, smallest, ratio, largest)[1:]
    before = lines[0] - beyond[::-1] if both else lines[:0]
    return np.concatenate([before, lines, lines[-1] + beyond])


def cells(length: float, smallest: float, ratio: float, largest: float) -> Array:
    """Return the midpoints of the elements of `graded` [mm]."""
    nodes = graded(length, smallest, ratio, largest)
    return (nodes[1:] + nodes[:-1]) / 2


def closer(start: float, stop: float, num: int, near: float, size: float) -> Array:
    """Return points from ``start`` to ``stop`` with spacing ``size`` at ``near``, wider elsewhere.

    Positions follow a hyperbolic sine: the spacing is nearly constant close to ``near``, then grows
    by a constant ratio. If equal spacing is at most ``size``, the points are equally spaced.

    Parameters
    ----------
    num : number of points
    near : position between start and stop [mm]
    size : spacing of points at ``near`` [mm]

    Raises
    ------
    ModelError
        if neighbouring spacings would differ by more than a factor of two
    """
    if (stop - start) / (num - 1) <= size:
        return np.linspace(start, stop, num)
    sides = np.array([start - near, stop - near])

    def needed(growth: float) -> float:
        """Return the number of spacings that fill the length; growth is the log of the ratio."""
        return float(np.ptp(np.arcsinh(sides * growth / size))) / growth

    low, high = 0.0, math.log(2)
    if needed(high) > num - 1:
        raise ModelError(
            "size", size, f"is too small for {num} points: take more, or a larger size"
        )
    while high - low > 1e-15:
        middle = (low + high) / 2
        low, high = (middle, high) if needed(middle) > num - 1 else (low, middle)
    first, last = np.arcsinh(sides * high / size)
    points = near + size / high * np.sinh(np.linspace(first, last, num))
    points[[0, -1]] = start, stop
    return np.asarray(points)


def refined(
    points: Sequence[float],
    sizes: Sequence[float],
    ratio: float,
    largest: Sequence[float],
    parts: Sequence[int | None] = (),
) -> Array:
    """Return node positions through ``points``; elements grow away from each point by ``ratio``.

    Between two points elements grow from both, up to the position where they are equally large.

    Parameters
    ----------
    points : (n,) increasing positions, each a node [mm]
    sizes : (n,) largest element next to each point; inf sets no limit [mm]
    ratio : ratio of neighbouring element sides, above 1
    largest : (n - 1,) largest element between neighbouring points [mm]
    parts : (n - 1,) number of equal elements between neighbouring points; None if they grow, by
        default everywhere
    """
    if not ratio > 1:
        raise ModelError("ratio", ratio, "must be above 1")
    pieces = [np.array([points[0]], dtype=float)]
    counts = parts or [None] * len(largest)
    spans = zip(pairwise(points), pairwise(sizes), largest, counts, strict=True)
    for (start, end), (first, last), limit, count in spans:
        if count is not None:
            pieces.append(np.linspace(start, end, count + 1)[1:])
            continue
        length, most = end - start, limit
        ahead = _meeting(length, first, last, ratio)
        back = length - ahead
        if ahead < _SLIVER * min(first, most, length):
            ahead, back, most = 0.0, length, min(most, first)
        elif back < _SLIVER * min(last, most, length):
            ahead, back, most = length, 0.0, min(most, last)
        if ahead:
            pieces.append(start + graded(ahead, min(first, most, ahead), ratio, most)[1:])
        if back:
            pieces.append(end - graded(back, min(last, most, back), ratio, most)[-2::-1])
    return np.concatenate(pieces)


def _meeting(length: float, first: float, last: float, ratio: float) -> float:
    """Return the distance from the first end at which elements from both ends are equally large.

    Sides that grow by ``ratio`` from element to element grow by ``ratio - 1`` per length.
    """
    if math.isinf(last):
        return length if math.isfinite(first) else 0.0
    return min(max((length + (last - first) / (ratio - 1)) / 2, 0.0), length)
