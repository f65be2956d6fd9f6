"""Loops compiled by numba: smallest enclosing balls, and what acts on a plane in a cycle.

The types of all arguments are fixed, as in `solver.rolling.kernels`: importing this module compiles
all that is ever used, or reads what an earlier import compiled. Its users import it at the first
call. Tensors are tensor components xx, yy, zz, xy, yz, zx.
"""

from __future__ import annotations

import math

import numpy as np
from numba import float64, int64, njit

from solver.typing import Array, Ints

_LINE, _TABLE, _STEPS = float64[::1], float64[:, ::1], float64[:, :, ::1]
_ROUNDING = 1e-14
"""Relative difference of squares of lengths that is rounding."""
_FLAT = 1e-20
"""Square of the distance of a point from a plane over that from its points: on the plane."""
_MOST = 400
"""Largest number of points that join a ball; of a path of 100 points about 6 do."""


@njit(cache=True, inline="always")
def _solved(A: Array, b: Array, n: int) -> None:
    """Replace b (n,) by the solution of A x = b, symmetric and positive definite (Cholesky)."""
    for j in range(n):
        for k in range(j):
            A[j, j] -= A[j, k] * A[j, k]
        A[j, j] = math.sqrt(max(A[j, j], 1e-300))
        for i in range(j + 1, n):
            for k in range(j):
                A[i, j] -= A[i, k] * A[j, k]
            A[i, j] /= A[j, j]
    for i in range(n):
        for k in range(i):
            b[i] -= A[i, k] * b[k]
        b[i] /= A[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= A[k, i] * b[k]
        b[i] /= A[i, i]


@njit(cache=True, inline="always")
def _farthest(x: Array, centre: Array) -> tuple[int, float]:
    """Return the point of x (k, n) farthest from a centre (k,), and its distance squared."""
    far, most = -1, 0.0
    for i in range(x.shape[1]):
        size = 0.0
        for a in range(len(x)):
            size += (x[a, i] - centre[a]) ** 2
        if size > most:
            far, most = i, size
    return far, most


@njit(cache=True)
def _ball(x: Array, centre: Array, support: Array, share: Array, work: Array) -> tuple[float, int]:
    """Find the smallest ball around points x (k, n); return its radius and its support's size.

    It is the dual method of active sets: every ball is the smallest one around its support, its
    centre is their mean with positive shares, and each is larger than the one before.

    1. The point farthest from the centre joins, unless it is in the ball: then this is the ball.
    2. Its share t grows from zero. The centre c + t w stays equally far from the support, where w
       is the distance of the point from the plane through the support; the shares fall by t b,
       where b are the barycentric coordinates of the point's projection onto that plane.
    3. If a share falls to zero first, its point is dropped, and 2 goes on; this also happens if
       the point is on that plane. Else it goes on until the point is on the ball.

    `centre` (k,), `support` (k + 2,) and `share` (k + 2,) receive the result; `work`
    (k + 2, 2 k + 4) is overwritten.

    References
    ----------
    D. Goldfarb, A. Idnani, Math. Program. 27 (1983) 1-33, for quadratic programs.
    """
    k = len(x)
    A, edges, b = work[:, : k + 2], work[:, k + 2 : 2 * k + 2], work[:, 2 * k + 2]
    way = work[:k, 2 * k + 3]
    centre[:] = x[:, 0]
    support[0], share[0], count = 0, 1.0, 1
    radius = scale = 0.0
    for turn in range(_MOST):
        far, most = _farthest(x, centre)
        if turn == 0:
            scale = most
        if most <= radius * (1 + _ROUNDING) + _ROUNDING**2 * scale:
            break
        gained = 0.0
        while True:
            p, m = int(support[0]), count - 1
            for i in range(m):
                b[i + 1] = 0.0
                for a in range(k):
                    edges[i, a] = x[a, int(support[i + 1])] - x[a, p]
                    b[i + 1] += edges[i, a] * (x[a, far] - x[a, p])
                for j in range(i + 1):
                    A[i, j] = 0.0
                    for a in range(k):
                        A[i, j] += edges[i, a] * edges[j, a]
            _solved(A, b[1:], m)
            b[0] = 1.0
            for i in range(m):
                b[0] -= b[i + 1]
            length = whole = radius = away = 0.0
            for a in range(k):
                way[a] = x[a, far] - x[a, p]
                whole += way[a] * way[a]
                for i in range(m):
                    way[a] -= b[i + 1] * edges[i, a]
                length += way[a] * way[a]
                radius += (x[a, p] - centre[a]) ** 2
                away += (x[a, far] - centre[a]) ** 2
            free = m < k and length > _FLAT * whole
            step, drop = (away - radius) / (2 * length) if free else math.inf, -1
            for i in range(count):
                if b[i] > 0.0 and share[i] < step * b[i]:
                    step, drop = share[i] / b[i], i
            if step == math.inf:  # it is on the plane, and rounding alone puts it outside
                break
            for i in range(count):
                share[i] -= step * b[i]
            if free:
                for a in range(k):
                    centre[a] += step * way[a]
            gained += step
            if drop < 0:
                break
            count -= 1
            for i in range(drop, count):
                support[i], share[i] = support[i + 1], share[i + 1]
            if count == 0:
                break
        support[count], share[count] = far, gained
        count += 1
        radius = 0.0
        for a in range(k):
            radius += (x[a, far] - centre[a]) ** 2
    return math.sqrt(radius), count


@njit((_STEPS,), cache=True)
def balls(x: Array) -> tuple[Array, Array]:
    """Return centres (n_paths, k) and radii (n_paths,) of the smallest balls around paths.

    Parameters
    ----------
    x : (n_paths, k, n_instants)
    """
    n_paths, k, _ = x.shape
    centres, radii = np.empty((n_paths, k)), np.empty(n_paths)
    support, share, work = np.empty(k + 2), np.empty(k + 2), np.empty((k + 2, 2 * k + 4))
    for path in range(n_paths):
        radii[path], _count = _ball(x[path], centres[path], support, share, work)
    return centres, radii


@njit(cache=True, inline="always")
def _widen(low: Array, high: Array, j: int, m: int, value: float) -> None:
    """Widen a range so that it contains a value."""
    low[j, m] = value if value < low[j, m] else low[j, m]
    high[j, m] = value if value > high[j, m] else high[j, m]


@njit((_STEPS, _TABLE), cache=True, fastmath=True)
def scan(paths: Array, normals: Array) -> tuple[Array, Array, Array]:
    """Return what acts on the same planes at every point.

    Loops over planes are innermost: they are the ones that a processor does several at a time.

    Parameters
    ----------
    paths : (n_points, 6, n_instants)
    normals : (n_planes, 3)

    Returns
    -------
    amplitude of shear, at most 3.4 % too small: the largest of half its ranges along six directions
    of the plane; largest normal component; half its range, each (n_points, n_planes)
    """
    n_points, _, n = paths.shape
    n_planes = len(normals)
    w = np.zeros((18, n_planes))  # along two directions of the plane, and along the normal
    for m in range(n_planes):
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
    half, root = 0.5, math.sqrt(0.75)
    low, high = np.empty((7, n_planes)), np.empty((7, n_planes))
    shear = np.zeros((n_points, n_planes))
    normal, across = np.empty((n_points, n_planes)), np.empty((n_points, n_planes))
    for point in range(n_points):
        low[:], high[:] = 1e300, -1e300
        for t in range(n):
            xx, yy, zz = paths[point, 0, t], paths[point, 1, t], paths[point, 2, t]
            xy, yz, zx = paths[point, 3, t], paths[point, 4, t], paths[point, 5, t]
            for m in range(n_planes):
                u = (w[0, m] * xx + w[1, m] * yy + w[2, m] * zz
                     + w[3, m] * xy + w[4, m] * yz + w[5, m] * zx)  # fmt: skip
                v = (w[6, m] * xx + w[7, m] * yy + w[8, m] * zz
                     + w[9, m] * xy + w[10, m] * yz + w[11, m] * zx)  # fmt: skip
                s = (w[12, m] * xx + w[13, m] * yy + w[14, m] * zz
                     + w[15, m] * xy + w[16, m] * yz + w[17, m] * zx)  # fmt: skip
                _widen(low, high, 0, m, u)
                _widen(low, high, 1, m, root * u + half * v)
                _widen(low, high, 2, m, half * u + root * v)
                _widen(low, high, 3, m, v)
                _widen(low, high, 4, m, root * v - half * u)
                _widen(low, high, 5, m, half * v - root * u)
                _widen(low, high, 6, m, s)
        for m in range(n_planes):
            for j in range(6):
                shear[point, m] = max(shear[point, m], (high[j, m] - low[j, m]) / 2)
            normal[point, m], across[point, m] = high[6, m], (high[6, m] - low[6, m]) / 2
    return shear, normal, across


@njit((_STEPS, int64[::1], _TABLE), cache=True)
def resolve(paths: Array, points: Ints, normals: Array) -> tuple[Array, Array]:
    """Return what acts on planes at points, and its derivatives by the normal.

    The amplitude of shear is the radius of the smallest circle around its path in the plane.

    Parameters
    ----------
    paths : (n_points, 6, n_instants)
    points : (n,) the point of each plane
    normals : (n, 3)

    Returns
    -------
    amplitude of shear, largest normal component, half its range (3, n); derivatives (3, n, 3),
    tangent to the plane
    """
    n, n_planes = paths.shape[2], len(points)
    values, slopes = np.empty((3, n_planes)), np.zeros((3, n_planes, 3))
    flat, across, traction = np.empty((2, n)), np.empty(n), np.empty((3, n))
    centre, support, share, work = np.empty(2), np.empty(4), np.empty(4), np.empty((4, 8))
    b = np.empty(3)
    for plane in range(n_planes):
        x, a = paths[points[plane]], normals[plane]
        b[:] = 0.0
        b[np.argmin(np.abs(a))] = 1.0
        b -= (a * b).sum() * a
        b /= math.sqrt((b * b).sum())
        c = np.cross(a, b)
        low = high = 0
        for t in range(n):
            tx = x[0, t] * a[0] + x[3, t] * a[1] + x[5, t] * a[2]
            ty = x[3, t] * a[0] + x[1, t] * a[1] + x[4, t] * a[2]
            tz = x[5, t] * a[0] + x[4, t] * a[1] + x[2, t] * a[2]
            traction[0, t], traction[1, t], traction[2, t] = tx, ty, tz
            flat[0, t] = tx * b[0] + ty * b[1] + tz * b[2]
            flat[1, t] = tx * c[0] + ty * c[1] + tz * c[2]
            across[t] = tx * a[0] + ty * a[1] + tz * a[2]
            if across[t] > across[high]:
                high = t
            if across[t] < across[low]:
                low = t
        radius, count = _ball(flat, centre, support, share, work)
        values[0, plane] = radius
        values[1, plane], values[2, plane] = across[high], (across[high] - across[low]) / 2
        if radius > 0.0:
            for i in range(count):
                t, s = int(support[i]), share[i] / radius
                d = (flat[0, t] - centre[0]) * b + (flat[1, t] - centre[1]) * c
                gx = x[0, t] * d[0] + x[3, t] * d[1] + x[5, t] * d[2]
                gy = x[3, t] * d[0] + x[1, t] * d[1] + x[4, t] * d[2]
                gz = x[5, t] * d[0] + x[4, t] * d[1] + x[2, t] * d[2]
                slopes[0, plane, 0] += s * (gx - across[t] * d[0])
                slopes[0, plane, 1] += s * (gy - across[t] * d[1])
                slopes[0, plane, 2] += s * (gz - across[t] * d[2])
        for j in range(3):
            slopes[1, plane, j] = 2 * traction[j, high]
            slopes[2, plane, j] = traction[j, high] - traction[j, low]
        for k in range(3):
            along = (slopes[k, plane] * a).sum()
            slopes[k, plane] -= along * a
    return values, slopes


@njit((_STEPS,), cache=True)
def largest_shear(x: Array) -> Array:
    """Return half the difference of the outer principal values (n_points, n_instants).

    The closed form loses half the digits where two values are equal: use it to choose an instant.

    Parameters
    ----------
    x : (n_points, 6, n_instants) deviators
    """
    n_points, _, n = x.shape
    found = np.empty((n_points, n))
    for point in range(n_points):
        for t in range(n):
            a, b, c = x[point, 0, t], x[point, 1, t], x[point, 2, t]
            d, e, f = x[point, 3, t], x[point, 4, t], x[point, 5, t]
            second = (a * a + b * b + c * c) / 2 + d * d + e * e + f * f
            third = a * (b * c - e * e) - d * (d * c - e * f) + f * (d * e - b * f)
            sine = 0.0
            if second > 0.0:
                sine = max(-1.0, min(1.0, 1.5 * math.sqrt(3.0) * third / second**1.5))
            found[point, t] = math.sqrt(second) * math.cos(math.asin(sine) / 3)
    return found
