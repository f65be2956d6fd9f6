"""One equation at each point, solved for the plastic multiplier."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_ROUNDING = 4 * float(np.finfo(float).eps)
_MAX_ITERATIONS = 60


def multiplier(excess: Callable[[Array], tuple[Array, Array]], most: Array, scale: Array) -> Array:
    """Return the multipliers (n,) for which no stress is beyond the yield surface.

    Newton's method from zero. Where a step leaves the bracket of multipliers known to be too small
    and too large, the bracket is halved instead. What is not found is NaN.

    Parameters
    ----------
    excess : multipliers (n,) -> (stress (n,) beyond the yield surface [MPa], its derivative): it is
        not negative at zero, and falls
    most : (n,) multipliers that are too large
    scale : (n,) size of the terms of the excess [MPa]; it is solved to their rounding
    """
    low, high = np.zeros_like(most), most
    found, least = np.zeros_like(most), np.full_like(most, np.inf)
    x = low
    for _ in range(_MAX_ITERATIONS):
        off, slope = excess(x)
        better = np.abs(off) < least
        found, least = np.where(better, x, found), np.where(better, np.abs(off), least)
        small = least <= _ROUNDING * scale
        if small.all():
            return found
        low, high = np.where(off > 0, x, low), np.where(off > 0, high, x)
        step = x - off / slope
        x = np.where((step > low) & (step < high), step, 0.5 * (low + high))
        x = np.where(small, found, x)
    closed = high - low <= _ROUNDING * high
    return np.where(small | closed, found, np.nan)
