"""Loops compiled by numba: smallest enclosing balls, and what acts on a plane in a cycle.

The types of all arguments are fixed, as in `solver.rolling.kernels`: importing this module compiles
all that is ever used, or reads what an earlier import compiled. Its users import it at the first
call. Tensors are tensor components xx, yy, zz, xy, yz, zx.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import float32, float64, int64, njit

from solver.typing import Array, Ints

_TABLE, _STEPS, _PATHS = float64[:, ::1], float64[:, :, ::1], float64[:, :, :, ::1]
_ROUNDING = 1e-14
"""Relative difference of squares of lengths that is rounding."""
_FLAT = 1e-20
"""Square of the distance of a point from a plane over that from its points: on the plane."""
_LONGEST = 16
"""Largest number of instants between two that a simplified path has."""
_NEAR, _FARTHEST, _CLOSE = 1e-5, 0.2, 1e-9
"""Angle for differences of gradients; largest of a Newton step, and that at which they end."""
_GAINED = 0.003
"""Share by which other instants may raise a maximum, at most."""
_SURE = 2.0
"""Factor on the expected gain of other instants: if this is too little they are not tried."""
_CLIMBS, _NEWTON = 30, 8
"""Largest number of changes of the instants that decide, and of Newton steps between them."""
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


@njit((_STEPS, float64), cache=True)
def simplified(paths: Array, share: float) -> tuple[Array, Ints]:
    """Return paths of fewer instants near the given ones, and the number of instants of each.

    Every instant that is left out is nearer to the line between those before and after it than a
    share of the size of the path: the components on planes change by no more.

    Parameters
    ----------
    paths : (n_points, 6, n_instants)
    """
    n_points, _, n = paths.shape
    made: Any = np.empty(paths.shape, dtype=np.float32)
    counts = np.empty(n_points, dtype=np.int64)
    for point in range(n_points):
        x, count, last = paths[point], 1, 0
        size = 0.0
        for t in range(n):
            own = 0.0
            for a in range(6):
                own += (2.0 if a > 2 else 1.0) * (x[a, t] - x[a, 0]) ** 2
            size = max(size, own)
        made[point, :, 0] = x[:, 0]
        for t in range(2, n + 1):
            far = t == n or t - last > _LONGEST
            for k in range(last + 1, t if not far else 0):
                dot = whole = apart = 0.0
                for a in range(6):
                    weight = 2.0 if a > 2 else 1.0
                    d, e = x[a, t] - x[a, last], x[a, k] - x[a, last]
                    dot += weight * d * e
                    whole += weight * d * d
                    apart += weight * e * e
                s = min(max(dot / max(whole, 1e-300), 0.0), 1.0)
                far = far or apart + s * s * whole - 2 * s * dot > share * share * size
            if far:
                last = t - 1
                made[point, :, count] = x[:, last]
                count += 1
        counts[point] = count
    return made, counts


@njit(cache=True, inline="always")
def _widen(low: Array, high: Array, j: int, m: int, value: float) -> None:
    """Widen a range so that it contains a value."""
    low[j, m] = value if value < low[j, m] else low[j, m]
    high[j, m] = value if value > high[j, m] else high[j, m]


@njit(
    (float32[:, :, ::1], int64[::1], float64[:, ::1]),
    cache=True,
    error_model="numpy",
    fastmath=True,
)
def scan(paths: Array, counts: Ints, normals: Array) -> tuple[Array, Array, Array]:
    """Return what acts on the same planes at every point, in single precision.

    Loops over planes are innermost: they are the ones that a processor does several at a time.

    Parameters
    ----------
    paths : (n_points, 6, n_instants)
    counts : (n_points,) number of instants of each
    normals : (n_planes, 3)

    Returns
    -------
    amplitude of shear, the largest of half its ranges along six directions of the plane: at most
    3.4 % too small for a straight path, 16.4 % for any (Jung's theorem); largest normal component;
    half its range, each (n_points, n_planes)
    """
    n_points = len(paths)
    n_planes = len(normals)
    w = np.zeros(
        (18, n_planes), dtype=np.float32
    )  # along two directions of the plane, and along the normal
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
    half, root = np.float32(0.5), np.float32(math.sqrt(0.75))
    room: Any = np.empty((2, 7, n_planes), dtype=np.float32)
    low, high = room
    shear = np.zeros((n_points, n_planes))
    normal, across = np.empty((n_points, n_planes)), np.empty((n_points, n_planes))
    for point in range(n_points):
        low[:], high[:] = 1e37, -1e37
        for t in range(counts[point]):
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


@njit(cache=True, inline="always")
def _dot(a: Array, b: Array) -> float:
    """Return the product of two vectors (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, inline="always")
def _turned(a: Array, u: float, b: Array, v: float, c: Array, out: Array) -> None:
    """Write the unit vector along a + u b + v c."""
    for j in range(3):
        out[j] = a[j] + u * b[j] + v * c[j]
    size = math.sqrt(_dot(out, out))
    for j in range(3):
        out[j] /= size


@njit(cache=True, inline="always")
def _tangents(a: Array, b: Array, c: Array) -> None:
    """Write two unit vectors in the plane of normal a."""
    k = 0 if abs(a[0]) <= abs(a[1]) else 1
    k = k if abs(a[k]) <= abs(a[2]) else 2
    for j in range(3):
        b[j] = (1.0 if j == k else 0.0) - a[k] * a[j]
    size = math.sqrt(_dot(b, b))
    for j in range(3):
        b[j] /= size
    c[0] = a[1] * b[2] - a[2] * b[1]
    c[1] = a[2] * b[0] - a[0] * b[2]
    c[2] = a[0] * b[1] - a[1] * b[0]


@njit(cache=True, inline="always")
def _traction(x: Array, k: int, t: int, a: Array, out: Array) -> float:
    """Write the traction on the plane a at an instant; return its normal component."""
    out[0] = x[k, 0, t] * a[0] + x[k, 3, t] * a[1] + x[k, 5, t] * a[2]
    out[1] = x[k, 3, t] * a[0] + x[k, 1, t] * a[1] + x[k, 4, t] * a[2]
    out[2] = x[k, 5, t] * a[0] + x[k, 4, t] * a[1] + x[k, 2, t] * a[2]
    return _dot(out, a)


@njit(cache=True, fastmath=True)
def _projected(x: Array, k: int, a: Array, b: Array, c: Array, flat: Array, across: Array) -> None:
    """Write the components of a path along b, c (2, n) and along the normal a (n,)."""
    for t in range(x.shape[2]):
        tx = x[k, 0, t] * a[0] + x[k, 3, t] * a[1] + x[k, 5, t] * a[2]
        ty = x[k, 3, t] * a[0] + x[k, 1, t] * a[1] + x[k, 4, t] * a[2]
        tz = x[k, 5, t] * a[0] + x[k, 4, t] * a[1] + x[k, 2, t] * a[2]
        flat[0, t] = tx * b[0] + ty * b[1] + tz * b[2]
        flat[1, t] = tx * c[0] + ty * c[1] + tz * c[2]
        across[t] = tx * a[0] + ty * a[1] + tz * a[2]


@njit(cache=True)
def _decided(
    x: Array, a: Array, value: Array, active: Ints, flat: Array, across: Array, room: Array
) -> None:
    """Write what acts on the plane a, and the instants that decide it, of each kind.

    `active` (n_kinds, 6) receives the instants of the largest and the smallest normal component,
    the number of instants on the smallest circle, and up to three of these. `room` (6, 8) is
    overwritten.
    """
    centre, support, share = room[4, 6:], room[4, :4], room[5, :4]
    for k in range(len(x)):
        _tangents(a, room[4], room[5])
        _projected(x, k, a, room[4], room[5], flat, across)
        high = low = 0
        for t in range(len(across)):
            high = t if across[t] > across[high] else high
            low = t if across[t] < across[low] else low
        value[3 * k], count = _ball(flat, centre, support, share, room[:4])
        value[3 * k + 1] = across[high]
        value[3 * k + 2] = (across[high] - across[low]) / 2
        active[k, 0], active[k, 1], active[k, 2] = high, low, min(count, 3)
        for i in range(active[k, 2]):
            active[k, 3 + i] = int(support[i])


@njit(cache=True)
def _given(x: Array, k: int, a: Array, active: Ints, value: Array, slope: Array, T: Array) -> None:
    """Write what acts on a plane for given instants of a kind, and its slopes by the normal.

    Of three instants the radius is that of the circle through them. `T` (6, 3) is overwritten.
    """
    o = 3 * k
    high = _traction(x, k, active[k, 0], a, T[0])
    low = _traction(x, k, active[k, 1], a, T[1])
    value[o], value[o + 1], value[o + 2] = 0.0, high, (high - low) / 2
    for j in range(3):
        slope[o, j], slope[o + 1, j] = 0.0, 2 * (T[0, j] - high * a[j])
        slope[o + 2, j] = slope[o + 1, j] / 2 - (T[1, j] - low * a[j])
    n = active[k, 2]
    if n < 2:
        return
    for i in range(n):
        along = _traction(x, k, active[k, 3 + i], a, T[i])
        for j in range(3):
            T[i, j] -= along * a[j]
    for j in range(3):
        T[3, j] = T[1, j] - T[0, j]
        T[4, j] = T[2, j] - T[0, j] if n == 3 else 0.0
    p, q, g = _dot(T[3], T[3]), _dot(T[4], T[4]), _dot(T[3], T[4])
    u, v = 0.5, 0.0
    if n == 3:
        det = p * q - g * g
        if det <= 1e-14 * p * q:
            return
        u, v = q * (p - g) / (2 * det), p * (q - g) / (2 * det)
    radius = math.sqrt(max(u * u * p + v * v * q + 2 * u * v * g, 0.0))
    value[o] = radius
    if radius == 0.0:
        return
    d = T[5]
    for i in range(n):
        t = active[k, 3 + i]
        s = (1 - u - v if i == 0 else (u if i == 1 else v)) / radius
        for j in range(3):
            d[j] = T[i, j] - T[0, j] - u * T[3, j] - v * T[4, j]
        along = (
            a[0] * (x[k, 0, t] * a[0] + 2 * x[k, 3, t] * a[1])
            + a[1] * (x[k, 1, t] * a[1] + 2 * x[k, 4, t] * a[2])
            + a[2] * (x[k, 2, t] * a[2] + 2 * x[k, 5, t] * a[0])
        )
        slope[o, 0] += s * (
            x[k, 0, t] * d[0] + x[k, 3, t] * d[1] + x[k, 5, t] * d[2] - along * d[0]
        )
        slope[o, 1] += s * (
            x[k, 3, t] * d[0] + x[k, 1, t] * d[1] + x[k, 4, t] * d[2] - along * d[1]
        )
        slope[o, 2] += s * (
            x[k, 5, t] * d[0] + x[k, 4, t] * d[1] + x[k, 2, t] * d[2] - along * d[2]
        )
    along = _dot(slope[o], a)
    for j in range(3):
        slope[o, j] -= along * a[j]


@njit(cache=True, inline="always")
def _risen(value: Array, start: Array, weight: Array, curve: Array) -> float:
    """Return the model's rise from the values at the start."""
    rise = 0.0
    for k in range(len(value)):
        change = weight[k]
        for m in range(len(value)):
            change += curve[k, m] * (value[m] - start[m]) / 2
        rise += change * (value[k] - start[k])
    return rise


@njit(cache=True)
def _slopes(
    x: Array, a: Array, active: Ints, start: Array, weight: Array, curve: Array, value: Array,
    gradient: Array, slope: Array, T: Array,
) -> None:  # fmt: skip
    """Write what acts on the plane a for given instants, and the model's gradient (3,) there."""
    for k in range(len(x)):
        _given(x, k, a, active, value, slope, T)
    for j in range(3):
        gradient[j] = 0.0
    for k in range(len(value)):
        change = weight[k]
        for m in range(len(value)):
            change += curve[k, m] * (value[m] - start[m])
        for j in range(3):
            gradient[j] += change * slope[k, j]


@njit(cache=True)
def _newton(
    x: Array, a: Array, active: Ints, start: Array, weight: Array, curve: Array, value: Array,
    slope: Array, T: Array, work: Array, steps: int,
) -> None:  # fmt: skip
    """Move the plane a to the maximum of the model for given instants.

    `work` (6, 3) then has the tangents b and c of the last step, the gradient, and the directions
    and sizes of its curvatures: see `_gain`.
    """
    cosine, sine, most, least, floor = 1.0, 0.0, 0.0, 0.0, 1e-300
    b, c, g, one, other, trial = work[0], work[1], work[2], work[3], work[4], work[5]
    for _ in range(steps):
        _slopes(x, a, active, start, weight, curve, value, g, slope, T)
        _tangents(a, b, c)
        _turned(a, _NEAR, b, 0.0, c, trial)
        _slopes(x, trial, active, start, weight, curve, value, one, slope, T)
        _turned(a, 0.0, b, _NEAR, c, trial)
        _slopes(x, trial, active, start, weight, curve, value, other, slope, T)
        u, v = _dot(g, b), _dot(g, c)
        p, q = (_dot(one, b) - u) / _NEAR, (_dot(other, c) - v) / _NEAR
        off = (_dot(one, c) - v + _dot(other, b) - u) / (2 * _NEAR)
        angle, size = math.atan2(off, (p - q) / 2) / 2, math.hypot((p - q) / 2, off)
        most, least = abs((p + q) / 2 + size), abs((p + q) / 2 - size)
        floor = 1e-6 * max(most, least) + 1e-300
        cosine, sine = math.cos(angle), math.sin(angle)
        along = (cosine * u + sine * v) / max(most, floor)  # up along each eigenvector
        beside = (cosine * v - sine * u) / max(least, floor)
        step = math.hypot(along, beside)
        if step > _FARTHEST:
            along, beside = along * _FARTHEST / step, beside * _FARTHEST / step
        _turned(a, cosine * along - sine * beside, b, sine * along + cosine * beside, c, trial)
        for j in range(3):
            a[j] = trial[j]
        if step < _CLOSE:
            break
    one[0], one[1] = cosine, sine
    other[0], other[1] = max(most, floor), max(least, floor)


@njit((_PATHS, int64[::1], _TABLE), cache=True)
def resolve(paths: Array, points: Ints, normals: Array) -> Array:
    """Return what acts on planes (3 n_kinds, n) at points: see `climb`."""
    n_kinds, n = paths.shape[1], paths.shape[3]
    values, value = np.empty((3 * n_kinds, len(points))), np.empty(3 * n_kinds)
    active, room = np.empty((n_kinds, 6), dtype=np.int64), np.empty((6, 8))
    flat, across = np.empty((2, n)), np.empty(n)
    for i in range(len(points)):
        _decided(paths[points[i]], normals[i], value, active, flat, across, room)
        values[:, i] = value
    return values


@njit(cache=True, inline="always")
def _gain(work: Array) -> float:
    """Return about how much a Newton step would gain; of the curvatures of the last one."""
    u, v = _dot(work[2], work[0]), _dot(work[2], work[1])
    along, beside = work[3, 0] * u + work[3, 1] * v, work[3, 0] * v - work[3, 1] * u
    return (along * along / work[4, 0] + beside * beside / work[4, 1]) / 2


@njit(cache=True)
def _exchanged(
    x: Array, a: Array, active: Ints, new: Ints, variant: int, best: float, start: Array,
    weight: Array, curve: Array, value: Array, slope: Array, T: Array, work: Array, trial: Array,
) -> int:  # fmt: skip
    """Return the next variant of deciding instants with a larger maximum, written to trial; or 0.

    Of each kind the variants are the neighbours of each instant.
    """
    last = x.shape[2] - 1
    for at in range(variant, 10 * len(x) + 1):
        k, m = (at - 1) // 10, (at - 1) % 10
        place = m // 2 if m < 4 else m // 2 + 1
        of = 3 * k + (0 if place > 2 else 2)
        matters = (
            weight[of] != 0.0 or curve[of, of] != 0.0 or (place == 0 and weight[of - 1] != 0.0)
        )
        if place >= 3 + active[k, 2] or not matters:
            continue
        new[:] = active
        moved = active[k, place] + (1 if m % 2 else -1)
        new[k, place] = 0 if moved > last else (last if moved < 0 else moved)
        _slopes(x, a, new, start, weight, curve, value, work[2], slope, T)
        if _risen(value, start, weight, curve) + _SURE * _gain(work) <= best:
            continue
        trial[:] = a
        _newton(x, trial, new, start, weight, curve, value, slope, T, work, 2)
        for kind in range(len(x)):
            _given(x, kind, trial, new, value, slope, T)
        if _risen(value, start, weight, curve) > best:
            return at
    return 0


@njit(cache=True)
def _before(
    i: int, a: Array, level: float, points: Ints, met: Array, reached: Array
) -> tuple[int, bool]:
    """Return the earlier start of a point that met a plane, or -1; and whether one is better."""
    j, better = i - 1, False
    while j >= 0 and points[j] == points[i]:
        better = better or reached[j] - level > _GAINED * abs(reached[j])
        if abs(_dot(met[j], a)) > 1 - 1e-12:
            return j, better
        j -= 1
    return -1, better


@njit((_PATHS, int64[::1], _TABLE, float64[::1], _TABLE, _STEPS), cache=True)
def climb(
    paths: Array, points: Ints, starts: Array, levels: Array, weights: Array, curves: Array
) -> tuple[Array, Array]:
    """Return planes (n, 3) on which a function is largest, near starts, and what acts on them.

    The function is quadratic in what acts on a plane: `weights` (n, 3 n_kinds) and `curves`
    (n, 3 n_kinds, 3 n_kinds) are its derivatives at the start. What acts is decided by a few
    instants: those of the largest and the smallest normal component and those on the smallest
    circle.

    1. Newton's method for these instants as given, then the instants are decided anew.
    2. If the function is not larger there, the way is shortened.
    3. At the end each deciding instant is exchanged for its neighbours: a path of many instants has
       several maxima close together. It is left out where another start of the point has come to
       the same plane, or is better by more than it could gain.

    Parameters
    ----------
    paths : (n_points, n_kinds, 6, n_instants) of stress, and of strain
    points : (n,) the point of each start; those of a point follow one another
    levels : (n,) the function at the starts

    Returns
    -------
    normals, and shear amplitude, largest normal component and half its range of each kind
    (3 n_kinds, n)
    """
    n_kinds, n = paths.shape[1], paths.shape[3]
    size = 3 * n_kinds
    flat, across, room = np.empty((2, n)), np.empty(n), np.empty((6, 8))
    slope, work, T = np.empty((size, 3)), np.empty((6, 3)), np.empty((6, 3))
    active, new = np.empty((2, n_kinds, 6), dtype=np.int64)
    start, value, a, trial = np.empty(size), np.empty(size), np.empty(3), np.empty(3)
    normals, values = np.empty((len(points), 3)), np.empty((size, len(points)))
    met, reached = np.empty((len(points), 3)), np.empty(len(points))
    for i in range(len(points)):
        x, weight, curve = paths[points[i]], weights[i], curves[i]
        a[:] = starts[i]
        _decided(x, a, start, active, flat, across, room)
        values[:, i] = start
        little = best = 0.0
        for k in range(size):
            little += 1e-13 * abs(weight[k] * start[k])
        variant, begun, met[i] = 0, False, starts[i]
        for _ in range(_CLIMBS):
            if variant:
                variant = _exchanged(
                    x, a, active, new, variant, best + little, start, weight, curve, value, slope,
                    T, work, trial,
                )  # fmt: skip
                if not variant:
                    break
            else:
                trial[:] = a
                _newton(x, trial, active, start, weight, curve, value, slope, T, work, _NEWTON)
            found = best
            for _half in range(1 if variant else 4):
                _decided(x, trial, value, new, flat, across, room)
                found = _risen(value, start, weight, curve)
                if found > best - little:
                    break
                _turned(trial, 3.0, a, 0.0, a, trial)
            if found > best + (little if variant else -little):
                same = True
                for k in range(n_kinds):
                    for m in range(active[k, 2] + 3):
                        same = same and new[k, m] == active[k, m]
                a[:], active[:], best, values[:, i] = trial, new, found, value
                first = same and variant == 0
                variant = 1 if same else 0
            else:
                first = variant == 0
                variant += 1
            if first and not begun:
                begun, met[i] = True, a
                same_as, better = _before(i, a, levels[i] + best, points, met, reached)
                if same_as >= 0:
                    a[:], values[:, i] = normals[same_as], values[:, same_as]
                if same_as >= 0 or better:
                    break
        normals[i], reached[i] = a, levels[i] + best
    return normals, values


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
