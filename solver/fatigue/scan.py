"""What acts on the same planes at every point, as bounds; loops compiled by numba.

Paths are (n_points, n_kinds, 6, n_instants): stress, and strain if a criterion reads it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import float64, int64, njit

from solver.typing import Array, Ints

_TABLE, _PATHS = float64[:, ::1], float64[:, :, :, ::1]
_LONGEST = 16
"""Largest number of instants between two that a simplified path has."""
_ROUNDED = 1e-6
"""Rounding in single precision, over the largest component of a path."""
_SEEN = 0.932
"""Share of a radius that ranges along six directions see at least: two or three points of any
acute triangle on the circle."""


@njit((_PATHS, float64), cache=True)
def simplified(paths: Array, share: float) -> tuple[Ints, Ints]:
    """Return instants (n_points, n_instants) of simpler paths near the given, and their number.

    Every instant that is left out is nearer to the line between those before and after it than a
    share of the size of the path: the components on planes change by no more.
    """
    n_points, n_kinds, _, n = paths.shape
    kept, counts = np.zeros((n_points, n), dtype=np.int64), np.empty(n_points, dtype=np.int64)
    weight = np.empty((n_kinds, 6))
    for point in range(n_points):
        x, count, last = paths[point], 1, 0
        for k in range(n_kinds):
            size = 1e-300
            for t in range(n):
                own = 0.0
                for a in range(6):
                    own += (2.0 if a > 2 else 1.0) * (x[k, a, t] - x[k, a, 0]) ** 2
                size = max(size, own)
            for a in range(6):
                weight[k, a] = (2.0 if a > 2 else 1.0) / size
        for t in range(2, n + 1):
            far = t == n or t - last > _LONGEST
            for i in range(last + 1, t if not far else 0):
                dot = whole = apart = 0.0
                for k in range(n_kinds):
                    for a in range(6):
                        d, e = x[k, a, t] - x[k, a, last], x[k, a, i] - x[k, a, last]
                        dot += weight[k, a] * d * e
                        whole += weight[k, a] * d * d
                        apart += weight[k, a] * e * e
                s = min(max(dot / max(whole, 1e-300), 0.0), 1.0)
                far = far or apart + s * s * whole - 2 * s * dot > share * share
            if far:
                last = t - 1
                kept[point, count] = last
                count += 1
        counts[point] = count
    return kept, counts


@njit(cache=True, inline="always")
def _widen(low: Array, high: Array, j: int, m: int, value: float) -> None:
    """Widen a range so that it contains a value."""
    low[j, m] = value if value < low[j, m] else low[j, m]
    high[j, m] = value if value > high[j, m] else high[j, m]


@njit(cache=True)
def _directions(normals: Array) -> Array:
    """Return factors (18, n_planes) of components along two directions, and along the normal."""
    w: Any = np.empty((18, len(normals)), dtype=np.float32)
    for m in range(len(normals)):
        a = normals[m]
        b = np.zeros(3)
        b[np.argmin(np.abs(a))] = 1.0
        b -= (a * b).sum() * a
        b /= math.sqrt((b * b).sum())
        c = np.cross(a, b)
        for j in range(3):
            d = b if j == 0 else (c if j == 1 else a)
            for k in range(3):
                w[6 * j + k, m] = a[k] * d[k]
            w[6 * j + 3, m] = a[0] * d[1] + a[1] * d[0]
            w[6 * j + 4, m] = a[1] * d[2] + a[2] * d[1]
            w[6 * j + 5, m] = a[2] * d[0] + a[0] * d[2]
    return w


@njit(
    (_PATHS, int64[:, ::1], int64[::1], _TABLE, int64[:, ::1], float64),
    cache=True, error_model="numpy", fastmath=True,
)  # fmt: skip
def scan(
    paths: Array, kept: Ints, counts: Ints, normals: Array, used: Ints, share: float
) -> tuple[Array, Array]:
    """Return bounds of what acts on planes, in single precision.

    Loops over planes are innermost: they are the ones that a processor does several at a time. The
    amplitude of shear, the radius of a circle, is bounded by the ranges along six directions of the
    plane: it is not less than half of each, nor than the mean of the farthest values along three
    directions 120 degrees apart; and the largest of these is at least `_SEEN` of it.

    Parameters
    ----------
    kept, counts, share : of `simplified`
    normals : (n_planes, 3)
    used : (n_kinds, 3) which values are asked for; others are 0

    Returns
    -------
    below, above : (3 n_kinds, n_points, n_planes) shear amplitude, largest normal component and
        half its range of each kind
    """
    n_points, n_kinds, _, n = paths.shape
    n_planes = len(normals)
    w = _directions(normals)
    half, third, root = np.float32(0.5), np.float32(1 / 3), np.float32(math.sqrt(0.75))
    room: Any = np.empty((2, 7, n_planes), dtype=np.float32)
    low, high = room
    below = np.zeros((3 * n_kinds, n_points, n_planes), dtype=np.float32)
    above = np.zeros((3 * n_kinds, n_points, n_planes), dtype=np.float32)
    for point in range(n_points):
        for k in range(n_kinds):
            if not used[k].any():
                continue
            x, circle, across = paths[point, k].astype(np.float32), used[k, 0], used[k, 1:].any()
            low[:], high[:] = 1e37, -1e37
            for i in range(counts[point]):
                t = kept[point, i]
                xx, yy, zz, xy, yz, zx = x[0, t], x[1, t], x[2, t], x[3, t], x[4, t], x[5, t]
                for m in range(n_planes if circle else 0):
                    u = (w[0, m] * xx + w[1, m] * yy + w[2, m] * zz
                         + w[3, m] * xy + w[4, m] * yz + w[5, m] * zx)  # fmt: skip
                    v = (w[6, m] * xx + w[7, m] * yy + w[8, m] * zz
                         + w[9, m] * xy + w[10, m] * yz + w[11, m] * zx)  # fmt: skip
                    _widen(low, high, 0, m, u)
                    _widen(low, high, 1, m, root * u + half * v)
                    _widen(low, high, 2, m, half * u + root * v)
                    _widen(low, high, 3, m, v)
                    _widen(low, high, 4, m, root * v - half * u)
                    _widen(low, high, 5, m, half * v - root * u)
                for m in range(n_planes if across else 0):
                    s = (w[12, m] * xx + w[13, m] * yy + w[14, m] * zz
                         + w[15, m] * xy + w[16, m] * yz + w[17, m] * zx)  # fmt: skip
                    _widen(low, high, 6, m, s)
            shear = below[3 * k, point]
            for j in range(6 if circle else 0):
                for m in range(n_planes):
                    shear[m] = max(shear[m], half * (high[j, m] - low[j, m]))
            for m in range(n_planes if circle else 0):
                one = max(high[0, m] + high[4, m] - low[2, m], high[1, m] + high[5, m] - low[3, m])
                two = max(high[2, m] - low[0, m] - low[4, m], high[3, m] - low[1, m] - low[5, m])
                shear[m] = max(shear[m], third * max(one, two))
            size = largest = np.float32(0.0)
            for t in range(n):
                d = e = np.float32(0.0)
                for a in range(6):
                    of = np.float32(2.0 if a > 2 else 1.0)
                    d += of * (x[a, t] - x[a, 0]) ** 2
                    e += of * x[a, t] ** 2
                size, largest = max(size, d), max(largest, e)
            apart = share * math.sqrt(size) + _ROUNDED * math.sqrt(largest)
            for m in range(n_planes):
                above[3 * k, point, m] = shear[m] / _SEEN + apart * math.sqrt(0.5) * circle
            for m in range(n_planes if across else 0):
                below[3 * k + 1, point, m] = high[6, m]
                below[3 * k + 2, point, m] = half * (high[6, m] - low[6, m])
            for j in range(1, 3):
                for m in range(n_planes):
                    above[3 * k + j, point, m] = below[3 * k + j, point, m] + apart
    return below, above
