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
_CLIMBS, _NEWTON = 30, 3
"""Largest number of changes of the instants that decide, and of Newton steps between them."""
_GAINED = 0.003
"""Share by which other instants may raise a maximum, at most."""
_KEPT, _TRIALS = 256, 12
"""Largest number of instants that may decide near a maximum, and of planes tried for them."""
_SURE = 2.0
"""Factor on the expected gain of a plane: if this is too little it is dropped."""
_DOUBT = 0.5
"""Share of its deficit at the maximum that an instant may make up by what the model leaves out."""
_RINGS, _RATIO, _WAYS, _LENGTHS = 8, 1.5, 12, 4
"""Number and ratio of the distances from a maximum at which the gain of others is bounded; number
of directions and of distances from which they are searched."""
_FLATTEST = 1e-3
"""Least curvature of a maximum over its largest, for planes tried near it."""
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
def simplified(paths: Array, share: float) -> tuple[Array, Ints, Array, Array]:
    """Return paths of fewer instants, the number of instants of each, their sizes and lengths.

    The size of a path is the largest distance of an instant from the first; its length is the
    largest norm. Every instant that is left out is nearer to the line between those before and
    after it than a share of the size: the components on planes change by no more.

    Parameters
    ----------
    paths : (n_points, 6, n_instants)
    """
    n_points, _, n = paths.shape
    made: Any = np.empty(paths.shape, dtype=np.float32)
    counts = np.empty(n_points, dtype=np.int64)
    sizes, lengths = np.empty(n_points), np.empty(n_points)
    for point in range(n_points):
        x, count, last = paths[point], 1, 0
        size = length = 0.0
        for t in range(n):
            own = whole = 0.0
            for a in range(6):
                own += (2.0 if a > 2 else 1.0) * (x[a, t] - x[a, 0]) ** 2
                whole += (2.0 if a > 2 else 1.0) * x[a, t] ** 2
            size, length = max(size, own), max(length, whole)
        sizes[point], lengths[point] = math.sqrt(size), math.sqrt(length)
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
    return made, counts, sizes, lengths


_COSINES = tuple(math.cos(math.radians(30.0 * j)) for j in range(6))
"""Of the directions of a plane along which the ranges of a path are taken."""


@njit(cache=True, inline="always")
def _widen(low: Array, high: Array, j: int, m: int, value: float) -> None:
    """Widen a range so that it contains a value."""
    low[j, m] = value if value < low[j, m] else low[j, m]
    high[j, m] = value if value > high[j, m] else high[j, m]


@njit(
    (float32[:, :, ::1], int64[::1], float64[:, ::1], int64),
    cache=True,
    error_model="numpy",
    fastmath=True,
)
def scan(paths: Array, counts: Ints, normals: Array, circle: int) -> tuple[Array, Array, Array]:
    """Return what acts on the same planes at every point, in single precision.

    Loops over planes are innermost: they are the ones that a processor does several at a time.

    Parameters
    ----------
    paths : (n_points, 6, n_instants)
    counts : (n_points,) number of instants of each
    normals : (n_planes, 3)
    circle : whether the amplitude of shear is asked for

    Returns
    -------
    bounds of the amplitude of shear (2, n_points, n_planes): the largest of half its ranges along
    six directions of the plane, and the farthest corner of the dodecagon of these ranges; largest
    normal component; half its range, each (n_points, n_planes)
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
    far: Any = np.empty((12, n_planes), dtype=np.float32)
    shear = np.zeros((2, n_points, n_planes))
    normal, across = np.empty((n_points, n_planes)), np.empty((n_points, n_planes))
    for point in range(n_points):
        low[:], high[:] = 1e37, -1e37
        for t in range(counts[point]):
            xx, yy, zz = paths[point, 0, t], paths[point, 1, t], paths[point, 2, t]
            xy, yz, zx = paths[point, 3, t], paths[point, 4, t], paths[point, 5, t]
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
            for m in range(n_planes):
                s = (w[12, m] * xx + w[13, m] * yy + w[14, m] * zz
                     + w[15, m] * xy + w[16, m] * yz + w[17, m] * zx)  # fmt: skip
                _widen(low, high, 6, m, s)
        for m in range(n_planes):
            normal[point, m], across[point, m] = high[6, m], (high[6, m] - low[6, m]) / 2
        if not circle:
            continue
        for j in range(6):
            # the middle of the ranges along the first and the fourth direction is the origin
            cosine, sine = np.float32(_COSINES[j]), np.float32(_COSINES[abs(3 - j)])
            for m in range(n_planes):
                origin = (cosine * (high[0, m] + low[0, m]) + sine * (high[3, m] + low[3, m])) / 2
                far[j, m], far[j + 6, m] = high[j, m] - origin, origin - low[j, m]
                shear[0, point, m] = max(shear[0, point, m], (high[j, m] - low[j, m]) / 2)
        for j in range(12):
            for m in range(n_planes):
                p, q = far[j, m], far[(j + 1) % 12, m]
                shear[1, point, m] = max(shear[1, point, m], p * p + q * q - 2 * root * p * q)
        for m in range(n_planes):
            shear[1, point, m] = 2 * math.sqrt(shear[1, point, m])
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
    x: Array, a: Array, value: Array, active: Ints, circles: Ints, flat: Array, across: Array,
    room: Array,
) -> None:  # fmt: skip
    """Write what acts on the plane a, and the instants that decide it, of each kind.

    `active` (n_kinds, 6) receives the instants of the largest and the smallest normal component,
    the number of instants on the smallest circle, and up to three of these. The circle is left out
    of kinds whose `circles` (n_kinds,) are 0. `room` (6, 8) is overwritten.
    """
    centre, support, share = room[4, 6:], room[4, :4], room[5, :4]
    for k in range(len(x)):
        _tangents(a, room[4], room[5])
        _projected(x, k, a, room[4], room[5], flat, across)
        high = low = 0
        for t in range(len(across)):
            high = t if across[t] > across[high] else high
            low = t if across[t] < across[low] else low
        count = 0
        value[3 * k] = 0.0
        if circles[k]:
            value[3 * k], count = _ball(flat, centre, support, share, room[:4])
        value[3 * k + 1] = across[high]
        value[3 * k + 2] = (across[high] - across[low]) / 2
        active[k, 0], active[k, 1], active[k, 2] = high, low, min(count, 3)
        for i in range(active[k, 2]):
            active[k, 3 + i] = int(support[i])


@njit(cache=True, inline="always")
def _middle(p: float, q: float, g: float) -> tuple[float, float]:
    """Return the shares of the last two of three points in the centre of the circle on them.

    p and q are the squares of their distances from the first one, g is the product of these; of two
    points q and g are zero.
    """
    det = p * q - g * g
    if det <= 1e-14 * p * q:
        return 0.5, 0.0
    return q * (p - g) / (2 * det), p * (q - g) / (2 * det)


@njit(cache=True)
def _given(x: Array, k: int, a: Array, active: Ints, value: Array, slope: Array, T: Array) -> None:
    """Write what acts on a plane for given instants of a kind, and its slopes by the normal.

    Of three instants the radius is that of the circle through them. `T` (8, 3) is overwritten.
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
    across, moved = T[6], T[7]
    for i in range(n):
        across[i] = _traction(x, k, active[k, 3 + i], a, T[i])
        for j in range(3):
            T[i, j] -= across[i] * a[j]
    for j in range(3):
        T[3, j] = T[1, j] - T[0, j]
        T[4, j] = T[2, j] - T[0, j] if n == 3 else 0.0
    p, q, g = _dot(T[3], T[3]), _dot(T[4], T[4]), _dot(T[3], T[4])
    u, v = _middle(p, q, g)
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
        _traction(x, k, t, d, moved)
        for j in range(3):
            slope[o, j] += s * (moved[j] - across[i] * d[j])
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
) -> float:  # fmt: skip
    """Move the plane a to the maximum of the model for given instants; return the last step.

    The curvature is that of the first plane.

    `work` (6, 3) then has the tangents b and c of the last step, the gradient, and the directions
    and sizes of its curvatures.
    """
    cosine, sine, most, least, floor, step = 1.0, 0.0, 0.0, 0.0, 1e-300, 0.0
    b, c, g, one, other, trial = work[0], work[1], work[2], work[3], work[4], work[5]
    _tangents(a, b, c)
    for count in range(steps):
        _slopes(x, a, active, start, weight, curve, value, g, slope, T)
        u, v = _dot(g, b), _dot(g, c)
        if count == 0:
            _turned(a, _NEAR, b, 0.0, c, trial)
            _slopes(x, trial, active, start, weight, curve, value, one, slope, T)
            _turned(a, 0.0, b, _NEAR, c, trial)
            _slopes(x, trial, active, start, weight, curve, value, other, slope, T)
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
    return step


@njit((_PATHS, int64[::1], _TABLE, int64[::1]), cache=True)
def resolve(paths: Array, points: Ints, normals: Array, circles: Ints) -> Array:
    """Return what acts on planes (3 n_kinds, n) at points: see `climb`."""
    n_kinds, n = paths.shape[1], paths.shape[3]
    values, value = np.empty((3 * n_kinds, len(points))), np.empty(3 * n_kinds)
    active, room = np.empty((n_kinds, 6), dtype=np.int64), np.empty((6, 8))
    flat, across = np.empty((2, n)), np.empty(n)
    for i in range(len(points)):
        _decided(paths[points[i]], normals[i], value, active, circles, flat, across, room)
        values[:, i] = value
    return values


@njit(cache=True)
def _noted(
    near: Array, count: int, part: int, deficit: float, u: float, v: float, little: float
) -> int:
    """Note an instant that may decide a part of the function near a maximum; return their number.

    `u` and `v` are slopes over the roots of curvatures. Five parts that rise alike gain 25 / 2 of
    the square of one, and lose five deficits.
    """
    if count < _KEPT and (1 - _DOUBT) * deficit + little < 2.5 * (u * u + v * v):
        near[count, 0], near[count, 1], near[count, 2], near[count, 3] = part, deficit, u, v
        near[count, 4] = math.hypot(u, v)
        return count + 1
    return count


@njit(cache=True)
def _rivals(
    x: Array, a: Array, active: Ints, start: Array, weight: Array, curve: Array, value: Array,
    flat: Array, across: Array, work: Array, T: Array, near: Array, little: float,
) -> int:  # fmt: skip
    """Write the instants that may decide near the maximum a instead of the active ones.

    The function is a sum of parts: each is the value of one instant, of the normal component or at
    the side of one of the support of a circle, whose radius is the mean of their distances from the
    centre. Near the maximum another instant takes a part if its deficit (the difference of the
    part at the maximum) is less than the difference of slopes gains. `near` (n, 5) receives part,
    deficit, and the difference of slopes by the principal directions of curvature, `work`, over the
    roots of the curvatures.
    """
    b, c = work[0], work[1]
    cosine, sine = work[3, 0], work[3, 1]
    floor = _FLATTEST * work[4, 0]
    p, q = 1 / math.sqrt(work[4, 0]), 1 / math.sqrt(max(work[4, 1], floor))
    count = 0
    for k in range(len(x)):
        slope = np.zeros(3)
        for i in range(3):
            slope[i] = weight[3 * k + i]
            for m in range(len(value)):
                slope[i] += curve[3 * k + i, m] * (value[m] - start[m])
        _projected(x, k, a, b, c, flat, across)
        for side in range(2):
            of = active[k, side]
            w = slope[2] / 2 if side else slope[1] + slope[2] / 2
            sign = -1.0 if side else 1.0
            if w <= 0.0:
                continue
            for t in range(len(across)):
                deficit = w * sign * (across[of] - across[t])
                u = 2 * w * sign * (flat[0, t] - flat[0, of])
                v = 2 * w * sign * (flat[1, t] - flat[1, of])
                along, beside = (cosine * u + sine * v) * p, (cosine * v - sine * u) * q
                count = _noted(near, count, 5 * k + side, deficit, along, beside, little)
        n, w = active[k, 2], slope[0]
        if n < 2 or w <= 0.0:
            continue
        count = _around(x, k, a, active, w, flat, across, work, T, (p, q), near, count, little)
    return count


@njit(cache=True)
def _around(
    x: Array, k: int, a: Array, active: Ints, w: float, flat: Array, across: Array, work: Array,
    T: Array, scale: tuple[float, float], near: Array, count: int, little: float,
) -> int:  # fmt: skip
    """Note the instants near a smallest circle: see `_rivals`. `T` (8, 3) is overwritten."""
    b, c = work[0], work[1]
    cosine, sine = work[3, 0], work[3, 1]
    n = active[k, 2]
    share, middle, moved, room = T[0], T[1], T[2:4], T[6]
    share[1], share[2] = 0.5, 0.0
    if n == 3:
        i, j, m = active[k, 3], active[k, 4], active[k, 5]
        d, e = flat[0, j] - flat[0, i], flat[1, j] - flat[1, i]
        u, v = flat[0, m] - flat[0, i], flat[1, m] - flat[1, i]
        share[1], share[2] = _middle(d * d + e * e, u * u + v * v, d * u + e * v)
    share[0] = 1 - share[1] - share[2]
    middle[:], moved[:] = 0.0, 0.0
    for i in range(n):
        t = active[k, 3 + i]
        for j in range(2):
            middle[j] += share[i] * flat[j, t]
        s = _turning(x, k, t, b, c, across[t], room)
        moved[0, 0] += share[i] * s[0]
        moved[0, 1] += share[i] * s[1]
        moved[1, 1] += share[i] * s[2]
    t = active[k, 3]
    radius = math.hypot(flat[0, t] - middle[0], flat[1, t] - middle[1])
    own = T[4:6]
    for i in range(n):
        t = active[k, 3 + i]
        d, e = (flat[0, t] - middle[0]) / radius, (flat[1, t] - middle[1]) / radius
        s = _turning(x, k, t, b, c, across[t], room)
        own[0, i] = d * (s[0] - moved[0, 0]) + e * (s[1] - moved[0, 1])
        own[1, i] = d * (s[1] - moved[0, 1]) + e * (s[2] - moved[1, 1])
    for t in range(len(across)):
        d, e = flat[0, t] - middle[0], flat[1, t] - middle[1]
        away = math.hypot(d, e)
        if away < 0.8 * radius:
            continue
        side, most = 0, -math.inf
        for i in range(n):
            f = active[k, 3 + i]
            along = (flat[0, f] - middle[0]) * d + (flat[1, f] - middle[1]) * e
            if along > most:
                side, most = i, along
        if t == active[k, 3 + side]:
            continue
        s = _turning(x, k, t, b, c, across[t], room)
        d, e = d / away, e / away
        u = d * (s[0] - moved[0, 0]) + e * (s[1] - moved[0, 1]) - own[0, side]
        v = d * (s[1] - moved[0, 1]) + e * (s[2] - moved[1, 1]) - own[1, side]
        of = w * share[side]
        u, v = of * (cosine * u + sine * v) * scale[0], of * (cosine * v - sine * u) * scale[1]
        count = _noted(near, count, 5 * k + 2 + side, of * (radius - away), u, v, little)
    return count


@njit(cache=True, inline="always")
def _turning(
    x: Array, k: int, t: int, b: Array, c: Array, along: float, room: Array
) -> tuple[float, float, float]:
    """Return slopes of the shear along b by b, along b by c or c by b, and along c by c."""
    bb = _traction(x, k, t, b, room)
    bc = _dot(room, c)
    return bb - along, bc, _traction(x, k, t, c, room) - along


@njit(cache=True)
def _able(near: Array, count: int, farthest: float, most: Array) -> tuple[int, float]:
    """Keep the instants that may decide a larger plane; return their number and how far it may be.

    At a distance s (times the root of the curvature) each part adds the most of its instants, slope
    times s less deficit, and the curvature takes s^2 / 2. `most` (n_parts,) is overwritten.
    """
    reach, ahead = 0.0, farthest
    for _ in range(_RINGS):
        most[:] = 0.0
        for i in range(count):
            part = int(near[i, 0])
            most[part] = max(most[part], ahead * near[i, 4] - (1 - _DOUBT) * near[i, 1])
        if most.sum() > (ahead / _RATIO) ** 2 / 2:
            reach = ahead
            break
        ahead /= _RATIO
    kept = 0
    for i in range(count):
        if reach * near[i, 4] > (1 - _DOUBT) * near[i, 1]:
            near[kept] = near[i]
            kept += 1
    return kept, reach


@njit(cache=True, inline="always")
def _best(near: Array, count: int, u: float, v: float, parts: Array) -> tuple[float, float, float]:
    """Return the sum of slopes (2,) and of deficits of the best instants of all parts on a way."""
    parts[:, 0], parts[:, 1] = 0.0, -1.0
    for j in range(count):
        rise = near[j, 2] * u + near[j, 3] * v - near[j, 1]
        k = int(near[j, 0])
        if rise > parts[k, 0]:
            parts[k, 0], parts[k, 1] = rise, j
    x = y = deficit = 0.0
    for k in range(len(parts)):
        j = int(parts[k, 1])
        if j >= 0:
            x, y, deficit = x + near[j, 2], y + near[j, 3], deficit + near[j, 1]
    return x, y, deficit


@njit(cache=True)
def _proposed(near: Array, count: int, reach: float, parts: Array, ways: Array) -> int:
    """Write ways (n, 2) to planes that may be larger, and their gains; return how many.

    The model of the function is the sum of what the best instants of all parts add, less half the
    square of the way. From ways of many lengths and directions its maxima are found by turns.
    `parts` (n_parts, 2) is overwritten.
    """
    found = 0
    for at in range(_WAYS * _LENGTHS if count else 0):
        angle, s = 2 * math.pi * (at % _WAYS) / _WAYS, reach / _RATIO ** (at // _WAYS)
        u, v = s * math.cos(angle), s * math.sin(angle)
        x, y, deficit = _best(near, count, u, v, parts)
        gain = (x * x + y * y) / 2 - (1 - _DOUBT) * deficit
        for _ in range(3 if gain > 0.0 else 0):
            u, v = x, y
            x, y, deficit = _best(near, count, u, v, parts)
            if x == u and y == v:
                break
            gain = max(gain, (x * x + y * y) / 2 - (1 - _DOUBT) * deficit)
        known = gain <= 0.0
        for j in range(found):
            known = known or (ways[j, 0] == u and ways[j, 1] == v)
        if not known and found < len(ways):
            ways[found, 0], ways[found, 1], ways[found, 2] = u, v, gain
            found += 1
    return found


@njit(cache=True)
def _before(i: int, a: Array, points: Ints, met: Array) -> int:
    """Return the earlier start of a point that met a plane, or -1."""
    j = i - 1
    while j >= 0 and points[j] == points[i]:
        if abs(_dot(met[j], a)) > 1 - 1e-12:
            return j
        j -= 1
    return -1


@njit(cache=True)
def _reached(i: int, points: Ints, reached: Array) -> float:
    """Return the most that earlier starts of a point have reached."""
    j, most = i - 1, -math.inf
    while j >= 0 and points[j] == points[i]:
        most = max(most, reached[j])
        j -= 1
    return most


@njit(cache=True)
def _ascended(
    x: Array, a: Array, best: float, target: float, little: float, active: Ints, circles: Ints,
    start: Array, weight: Array, curve: Array, kept: Array, room: tuple[Any, ...],
) -> float:  # fmt: skip
    """Move the plane a up to a maximum, with its instants; return the rise of the function there.

    The way ends early where twice the last rise does not reach a target.
    """
    flat, across, ball, slope, work, T, value, trial, new = room
    for _ in range(_CLIMBS):
        trial[:] = a
        step = _newton(x, trial, active, start, weight, curve, value, slope, T, work, _NEWTON)
        found = best
        for _half in range(4):
            _decided(x, trial, value, new, circles, flat, across, ball)
            found = _risen(value, start, weight, curve)
            if found > best - little:
                break
            _turned(trial, 3.0, a, 0.0, a, trial)
        if found <= best - little:
            break
        same = step < _CLOSE
        for k in range(len(x)):
            for m in range(active[k, 2] + 3):
                same = same and new[k, m] == active[k, m]
        rise = found - best
        a[:], active[:], best, kept[:] = trial, new, found, value
        if same or best + 2 * rise < target:
            break
    return best


@njit(cache=True)
def _exchanged(
    x: Array, a: Array, best: float, little: float, active: Ints, circles: Ints, start: Array,
    weight: Array, curve: Array, kept: Array, room: tuple[Any, ...], near: Array,
) -> float:  # fmt: skip
    """Move the plane a from a maximum to higher ones near it; return the rise of the function."""
    flat, across, ball, slope, work, T, value, trial, _new = room
    ways, parts = np.empty((_WAYS * _LENGTHS, 3)), np.empty((5 * len(x), 2))
    other, tried = np.empty_like(active), np.empty_like(value)
    at, g, found, trials = np.empty(3), np.empty(3), 1, _TRIALS
    b, c, cosine, sine, p, q = at, at, 1.0, 0.0, 1.0, 1.0
    risen = True
    while found and trials:
        if risen:
            trial[:] = a
            _newton(x, trial, active, start, weight, curve, value, slope, T, work, 1)
            count = _rivals(
                x, a, active, start, weight, curve, kept, flat, across, work, T, near, little
            )
            farthest = _FARTHEST * math.sqrt(work[4, 0])
            count, reach = _able(near, count, farthest, parts[:, 0])
            found, risen = _proposed(near, count, reach, parts, ways), False
            b, c, cosine, sine = work[0].copy(), work[1].copy(), work[3, 0], work[3, 1]
            p, q = 1 / math.sqrt(work[4, 0]), 1 / math.sqrt(max(work[4, 1], _FLATTEST * work[4, 0]))
            continue
        trials -= 1
        k = int(np.argmax(ways[:found, 2]))
        u, v = ways[k, 0] * p, ways[k, 1] * q
        ways[k] = ways[found - 1]
        found -= 1
        length = max(math.hypot(u, v) / _FARTHEST, 1.0)
        u, v = u / length, v / length
        _turned(a, cosine * u - sine * v, b, sine * u + cosine * v, c, at)
        _decided(x, at, tried, other, circles, flat, across, ball)
        rise = _risen(tried, start, weight, curve)
        _slopes(x, at, other, start, weight, curve, value, g, slope, T)
        u, v = _dot(g, b), _dot(g, c)
        along, beside = (cosine * u + sine * v) * p, (cosine * v - sine * u) * q
        if rise + _SURE * (along * along + beside * beside) / 2 <= best + little:
            continue
        rise = _ascended(
            x, at, rise, best, little, other, circles, start, weight, curve, tried, room
        )
        if rise > best + little:
            a[:], active[:], kept[:], best, risen, found = at, other, tried, rise, True, 1
    return best


@njit(
    (_PATHS, int64[::1], _TABLE, int64[::1], float64[::1], float64[::1], _TABLE, _STEPS), cache=True
)
def climb(
    paths: Array, points: Ints, starts: Array, circles: Ints, levels: Array, falls: Array,
    weights: Array, curves: Array,
) -> tuple[Array, Array]:  # fmt: skip
    """Return planes (n, 3) on which a function is largest, near starts, and what acts on them.

    The function is quadratic in what acts on a plane: `weights` (n, 3 n_kinds) and `curves`
    (n, 3 n_kinds, 3 n_kinds) are its derivatives at the start. What acts is decided by a few
    instants: those of the largest and the smallest normal component and those on the smallest
    circle.

    1. Newton's method for these instants as given, then the instants are decided anew. If the
       function is not larger there, the way is shortened.
    2. A path of many instants has several maxima close together. Planes on which other instants
       may decide and gain (`_rivals`) are tried in the same way. This is left out where another
       start of the point has come to the same plane, or is better by more than it could gain.

    Parameters
    ----------
    paths : (n_points, n_kinds, 6, n_instants) of stress, and of strain
    points : (n,) the point of each start; those of a point follow one another
    circles : (n_kinds,) whether the amplitude of shear counts
    levels : (n,) the function at the starts
    falls : (n,) by how much a start may be below the maximum near it

    Returns
    -------
    normals, and shear amplitude, largest normal component and half its range of each kind
    (3 n_kinds, n)
    """
    n_kinds, n = paths.shape[1], paths.shape[3]
    size = 3 * n_kinds
    active, new = np.empty((2, n_kinds, 6), dtype=np.int64)
    start, value, kept = np.empty((3, size))
    a, trial = np.empty((2, 3))
    flat, across, ball = np.empty((2, n)), np.empty(n), np.empty((6, 8))
    slope, work, T = np.empty((size, 3)), np.empty((6, 3)), np.empty((8, 3))
    room = flat, across, ball, slope, work, T, value, trial, new
    normals, values = np.empty((len(points), 3)), np.empty((size, len(points)))
    met, reached = np.empty((len(points), 3)), np.empty(len(points))
    near = np.empty((_KEPT, 5))
    for i in range(len(points)):
        x, weight, curve = paths[points[i]], weights[i], curves[i]
        a[:] = starts[i]
        _decided(x, a, start, active, circles, flat, across, ball)
        kept[:] = start
        normals[i], reached[i], values[:, i], met[i] = a, levels[i], start, a
        target = _reached(i, points, reached)
        if levels[i] + falls[i] < target:
            continue
        little = 0.0
        for k in range(size):
            little += 1e-13 * abs(weight[k] * start[k])
        target -= _GAINED * abs(target) + levels[i]
        best = _ascended(
            x, a, 0.0, target, little, active, circles, start, weight, curve, kept, room
        )
        met[i] = a
        same = _before(i, a, points, met)
        if same >= 0:
            a[:], kept[:], best = normals[same], values[:, same], reached[same] - levels[i]
        elif best >= target:
            best = _exchanged(
                x, a, best, little, active, circles, start, weight, curve, kept, room, near
            )
        normals[i], reached[i], values[:, i] = a, levels[i] + best, kept
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
