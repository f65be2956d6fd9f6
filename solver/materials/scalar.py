"""Solve one scalar equation at each point."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from solver.typing import Array

_ROUNDING = 4 * float(np.finfo(float).eps)
_MAX_ITERATIONS = 60


def falling_root(
    excess: Callable[[Array], tuple[Array, Array]],
    low: Array,
    high: Array,
    scale: Array,
    start: Array | None = None,
) -> Array:
    """Return the zeros (n,) of falling functions; NaN where none is found.

    Newton's method. If a step leaves the bracket of values known to be too small and too large, the
    bracket is halved instead.

    Parameters
    ----------
    excess : maps values (n,) to falling functions (n,), not negative at ``low``, and their
        derivatives (n,)
    low, high : (n,) lower and upper bounds of the zeros
    scale : (n,) magnitude of the terms of the functions; the zeros are solved to their rounding
    start : (n,) first values, by default ``low``; steps from values inside the bracket may
        oscillate about the zero and converge slowly: the bracket is then halved too
    """
    x = low if start is None else start
    found, least, last = x, np.full_like(high, np.inf), np.zeros_like(high)
    for _ in range(_MAX_ITERATIONS):
        off, slope = excess(x)
        size = np.abs(off)
        better = size < least
        found, least = np.where(better, x, found), np.where(better, size, least)
        small = least <= _ROUNDING * scale
        if small.all():
            return found
        low, high = np.where(off > 0, x, low), np.where(off > 0, high, x)
        step = x - off / slope
        inside = (step > low) & (step < high)
        if start is not None:
            inside &= ~((off * last < 0) & (size > 0.5 * np.abs(last)))
        x = np.where(inside, step, 0.5 * (low + high))
        x, last = np.where(small, found, x), off
    closed = high - low <= _ROUNDING * high
    return np.where(small | closed, found, np.nan)
