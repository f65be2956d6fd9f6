"""One equation at each point, solved for one unknown."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_ROUNDING = 4 * float(np.finfo(float).eps)
_MAX_ITERATIONS = 60


def falling_root(
    excess: Callable[[Array], tuple[Array, Array]],
    low: Array,
    high: Array,
    scale: Array,
    start: Array | None = None,
) -> Array:
    """Return where functions fall through zero (n,).

    Newton's method. Where a step leaves the bracket of values known to be too small and too large,
    the bracket is halved instead. What is not found is NaN.

    Parameters
    ----------
    excess : values (n,) -> (functions (n,), their derivatives), not negative at ``low``, falling
    low, high : (n,) values that are not too large, and values that are too large
    scale : (n,) size of the terms of the functions, which are solved to the rounding of these
    start : (n,) first values, ``low`` if not given; from values inside the bracket steps may swing
        about the zero and come hardly nearer: there it is halved too
    """
    x = low if start is None else start
    found, least, last = x, np.full_like(high, np.inf), np.zeros_like(high)
    for _ in range(_MAX_ITERATIONS):
        off, slope = excess(x)
        better = np.abs(off) < least
        found, least = np.where(better, x, found), np.where(better, np.abs(off), least)
        small = least <= _ROUNDING * scale
        if small.all():
            return found
        low, high = np.where(off > 0, x, low), np.where(off > 0, high, x)
        step = x - off / slope
        inside = (step > low) & (step < high)
        if start is not None:
            inside &= ~((off * last < 0) & (np.abs(off) > 0.5 * np.abs(last)))
        x = np.where(inside, step, 0.5 * (low + high))
        x, last = np.where(small, found, x), off
    closed = high - low <= _ROUNDING * high
    return np.where(small | closed, found, np.nan)
