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
_MOST = 400
"""Largest number of points that join a ball; of a path of 100 points about 6 do."""
_NEAR = 1e-3
"""Angle between planes for second differences."""
_STENCIL = _NEAR * np.array([(0, 1, -1, 0, 0, 1, -1), (0, 0, 0, 1, -1, 1, -1)])
"""Planes of `beside`, by the angle along two tangents."""
_FARTHEST = 0.2
"""Largest angle of a step."""
_FLATTEST = 1e-6
"""Least curvature of a maximum over its largest: less is rounding."""
_WAYS, _AT_ONCE = 6, 4
"""Number of directions along which a scan takes ranges, and of instants that it takes at a time."""
_ALONG = tuple((math.cos(math.pi * j / _WAYS), math.sin(math.pi * j / _WAYS)) for j in range(_WAYS))


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


@njit(cache=True)
def _farthest(x: Array, centre: Array, size: Array) -> int:
    """Return the point of x (k, n) farthest from a centre (k,); write distances squared (n,)."""
    for a in range(len(x)):
        for i in range(x.shape[1]):
            size[i] = (0.0 if a == 0 else size[i]) + (x[a, i] - centre[a]) ** 2
    far = 0
    for i in range(1, x.shape[1]):
        far = i if size[i] > size[far] else far
    return far


@njit(cache=True)
def _ball(
    x: Array, centre: Array, support: Ints, share: Array, work: Array, size: Array
) -> float:  # fmt: skip
    """Find the smallest ball around points x (k, n); return its radius.

    It is the dual method of active sets: every ball is the smallest one around its support, its
    centre is their mean with positive shares, and each is larger than the one before.

    1. The point farthest from the centre joins, unless it is in the ball: then this is the ball.
    2. Its share t grows from zero. The centre c + t w stays equally far from the support, where w
       is the distance of the point from the plane through the support; the shares fall by t b,
       where b are the barycentric coordinates of the point's projection onto that plane.
    3. If a share falls to zero first, its point is dropped, and 2 goes on; this also happens if
       the point is on that plane. Else it goes on until the point is on the ball.

    `centre` (k,), `support` (k + 2,) and `share` (k + 2,) receive the result; `work`
    (k + 2, 2 k + 4) and `size` (n,) are overwritten.

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
    for _ in range(_MOST):
        far = _farthest(x, centre, size)
        most = size[far]
        scale = max(scale, most)
        if most <= radius * (1 + _ROUNDING) + _ROUNDING**2 * scale:
            break
        gained = 0.0
        while True:
            p, m = support[0], count - 1
            for i in range(m):
                b[i + 1] = 0.0
                for a in range(k):
                    edges[i, a] = x[a, support[i + 1]] - x[a, p]
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
    return math.sqrt(radius)


@njit((_STEPS,), cache=True)
def balls(x: Array) -> tuple[Array, Array]:
    """Return centres (n_paths, k) and radii (n_paths,) of the smallest balls around paths.

    Parameters
    ----------
    x : (n_paths, k, n_instants)
    """
    n_paths, k, n = x.shape
    centres, radii, size = np.empty((n_paths, k)), np.empty(n_paths), np.empty(n)
    support, share = np.zeros(k + 2, dtype=np.int64), np.empty(k + 2)
    work = np.empty((k + 2, 2 * k + 4))
    for path in range(n_paths):
        radii[path] = _ball(x[path], centres[path], support, share, work, size)
    return centres, radii


@njit((_PATHS, float64), cache=True)
def ends(x: Array, share: float) -> Ints:
    """Return the instants (n_points, 2) at the ends of straight paths; twice the first of others.

    An instant is on a line if its distance from it is less than a share of the path's length.

    Parameters
    ----------
    x : (n_points, n_kinds, n_instants, 6), kinds that move alike
    """
    n_points, n_kinds, n, _ = x.shape
    found = np.zeros((n_points, 2), dtype=np.int64)
    for point in range(n_points):
        first, far, most = x[point, 0, 0], 0, 0.0
        for t in range(n):
            size = ((x[point, 0, t] - first) ** 2).sum()
            far, most = (t, size) if size > most else (far, most)
        low, high, least, largest, straight = 0, 0, 0.0, 0.0, most > 0.0
        for t in range(n if straight else 0):
            along = ((x[point, 0, t] - first) * (x[point, 0, far] - first)).sum() / most
            low, least = (t, along) if along < least else (low, least)
            high, largest = (t, along) if along > largest else (high, largest)
            for k in range(n_kinds):
                way = x[point, k, far] - x[point, k, 0]
                apart = ((x[point, k, t] - x[point, k, 0] - along * way) ** 2).sum()
                straight = straight and apart <= share * share * (way**2).sum()
            if not straight:
                break
        if straight:
            found[point] = low, high
    return found


@njit(cache=True, inline="always")
def _turned(a: Array, u: float, b: Array, v: float, c: Array, out: Array) -> None:
    """Write the unit vector along a + u b + v c."""
    for j in range(3):
        out[j] = a[j] + u * b[j] + v * c[j]
    size = math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    for j in range(3):
        out[j] /= size


@njit(cache=True, inline="always")
def _tangents(a: Array, b: Array, c: Array) -> None:
    """Write two unit vectors in the plane of normal a."""
    k = 0 if abs(a[0]) <= abs(a[1]) else 1
    k = k if abs(a[k]) <= abs(a[2]) else 2
    b[:], c[:] = 0.0, 0.0
    b[k] = 1.0
    _turned(b, -a[k], a, 0.0, c, b)
    for j in range(3):
        c[j] = a[j - 2] * b[j - 1] - a[j - 1] * b[j - 2]


@njit(cache=True, fastmath=True)
def _projected(x: Array, a: Array, b: Array, c: Array, flat: Array) -> None:
    """Write the components along b, c (2, n) of a path on the plane a."""
    for t in range(x.shape[1]):
        tx = x[0, t] * a[0] + x[3, t] * a[1] + x[5, t] * a[2]
        ty = x[3, t] * a[0] + x[1, t] * a[1] + x[4, t] * a[2]
        tz = x[5, t] * a[0] + x[4, t] * a[1] + x[2, t] * a[2]
        flat[0, t] = tx * b[0] + ty * b[1] + tz * b[2]
        flat[1, t] = tx * c[0] + ty * c[1] + tz * c[2]


@njit(cache=True, fastmath=True)
def _across(x: Array, a: Array, out: Array) -> None:
    """Write the normal component (n,) of a path on the plane a."""
    xx, yy, zz = a[0] * a[0], a[1] * a[1], a[2] * a[2]
    xy, yz, zx = 2 * a[0] * a[1], 2 * a[1] * a[2], 2 * a[2] * a[0]
    for t in range(x.shape[1]):
        out[t] = (xx * x[0, t] + yy * x[1, t] + zz * x[2, t]
                  + xy * x[3, t] + yz * x[4, t] + zx * x[5, t])  # fmt: skip


@njit((float32[:, :, ::1], _TABLE, int64), cache=True, fastmath=True)
def scan(paths: Array, normals: Array, circle: int) -> tuple[Array, Array]:
    """Return what acts on the same planes at every point, in single precision.

    Loops over planes are innermost and short: a processor takes several planes at a time.

    Parameters
    ----------
    paths : (n_points, n_instants, 6)
    normals : (n_planes, 3)
    circle : whether the amplitude of shear is asked for

    Returns
    -------
    bounds of the amplitude of shear (2, n_points, n_planes): the largest of half its ranges along
    `_WAYS` directions of the plane, and the farthest corner of the polygon of these ranges; largest
    normal component, and half its range (2, n_points, n_planes)
    """
    n_points, n, n_planes = len(paths), paths.shape[1], len(normals)
    w: Any = np.zeros((3, 6, n_planes), dtype=np.float32)
    d = np.empty((3, 3))
    for m in range(n_planes):
        a = normals[m]
        d[2] = a
        _tangents(a, d[0], d[1])
        for j in range(3):
            for k in range(3):
                w[j, k, m] = a[k] * d[j, k]
                w[j, 3 + k, m] = a[k] * d[j, k - 2] + a[k - 2] * d[j, k]
    y: Any = np.zeros((_AT_ONCE, 3, n_planes), dtype=np.float32)
    room: Any = np.empty((2, _WAYS + 1, n_planes), dtype=np.float32)
    high, low = room
    far: Any = np.empty((2 * _WAYS, n_planes), dtype=np.float32)
    shear: Any = np.zeros((2, n_points, n_planes), dtype=np.float32)
    normal: Any = np.empty((2, n_points, n_planes), dtype=np.float32)
    twice, wide = 2 * np.float32(_ALONG[1][0]), np.float32(1 / _ALONG[1][1])
    first, half = 0 if circle else _WAYS, np.float32(0.5)
    for point in range(n_points):
        high[:], low[:] = -1e37, 1e37
        for t in range(0, n, _AT_ONCE):
            for i in range(_AT_ONCE):
                x = paths[point, min(t + i, n - 1)]
                xx, yy, zz, xy, yz, zx = x[0], x[1], x[2], x[3], x[4], x[5]
                for j in range(0 if circle else 2, 3):
                    for m in range(n_planes):
                        long = w[j, 0, m] * xx + w[j, 1, m] * yy + w[j, 2, m] * zz
                        y[i, j, m] = long + w[j, 3, m] * xy + w[j, 4, m] * yz + w[j, 5, m] * zx
            for j in range(first, _WAYS + 1):
                k, c, s = 2, np.float32(1.0), np.float32(0.0)
                if j < _WAYS:
                    k, c, s = 0, np.float32(_ALONG[j][0]), np.float32(_ALONG[j][1])
                for m in range(n_planes):
                    p, q = c * y[0, k, m] + s * y[0, 1, m], c * y[1, k, m] + s * y[1, 1, m]
                    u, v = c * y[2, k, m] + s * y[2, 1, m], c * y[3, k, m] + s * y[3, 1, m]
                    p, q = (p, q) if p > q else (q, p)
                    u, v = (u, v) if u > v else (v, u)
                    p, q = p if p > u else u, q if q < v else v
                    high[j, m] = p if p > high[j, m] else high[j, m]
                    low[j, m] = q if q < low[j, m] else low[j, m]
        for m in range(n_planes):
            normal[0, point, m] = high[_WAYS, m]
            normal[1, point, m] = half * (high[_WAYS, m] - low[_WAYS, m])
        if not circle:
            continue
        for j in range(_WAYS):
            # the middle of the ranges along the two tangents is the origin
            c, s, k = np.float32(_ALONG[j][0]), np.float32(_ALONG[j][1]), _WAYS // 2
            for m in range(n_planes):
                origin = half * (c * (high[0, m] + low[0, m]) + s * (high[k, m] + low[k, m]))
                far[j, m], far[j + _WAYS, m] = high[j, m] - origin, origin - low[j, m]
        for j in range(2 * _WAYS):
            for m in range(n_planes):
                p, q = far[j, m], far[(j + 1) % (2 * _WAYS), m]
                u, v = half * (p + far[(j + _WAYS) % (2 * _WAYS), m]), p * p + q * q - twice * p * q
                shear[0, point, m] = u if u > shear[0, point, m] else shear[0, point, m]
                shear[1, point, m] = v if v > shear[1, point, m] else shear[1, point, m]
        for m in range(n_planes):
            shear[1, point, m] = wide * math.sqrt(shear[1, point, m])
    return shear, normal


@njit(cache=True)
def _three(x: Array, i: int, j: int, k: int) -> tuple[float, float, float, int, int, int]:
    """Return the smallest circle around three points of x (2, n), and the points on it.

    Radius squared, centre, points: the last one is the first if two are on the circle.
    """
    d, e, u, v = x[0, j] - x[0, i], x[1, j] - x[1, i], x[0, k] - x[0, i], x[1, k] - x[1, i]
    a, b = d - u, e - v
    # not as differences of squares: those of two points close together are rounding
    p, q, far = d * d + e * e, u * u + v * v, a * a + b * b
    first, second, third, det = d * u + e * v, a * d + b * e, -a * u - b * v, d * v - e * u
    if first <= 0.0:  # the angle there is not acute
        j, i, p = k, j, far
    elif third <= 0.0:
        return p / 4, x[0, i] + d / 2, x[1, i] + e / 2, i, j, i
    elif second <= 0.0:
        j, p = k, q
    elif det != 0.0:
        f, h = q * second / (2 * det * det), p * third / (2 * det * det)
        radius = p * q * far / (4 * det * det)
        return radius, x[0, i] + f * d + h * u, x[1, i] + f * e + h * v, i, j, k
    return p / 4, (x[0, i] + x[0, j]) / 2, (x[1, i] + x[1, j]) / 2, i, j, i


@njit(cache=True)
def _circle(x: Array, on: Ints, centre: Array, size: Array) -> float:
    """Return the radius of the smallest circle around points x (2, n), and write who is `on` it.

    The point farthest from a smaller circle joins it: of four points the circle is the largest one
    of three. It begins with the three points `on` (3,).
    """
    radius, centre[0], centre[1], i, j, k = _three(x, on[0], on[1], on[2])
    scale = 0.0
    for _ in range(_MOST):
        far = _farthest(x, centre, size)
        scale = max(scale, size[far])
        if size[far] <= radius * (1 + _ROUNDING) + _ROUNDING**2 * scale:
            break
        most = _three(x, far, i, j)
        for m in (i, j):
            other = _three(x, far, m, k)
            most = other if other[0] > most[0] else most
        if most[0] <= radius:
            break
        radius, centre[0], centre[1], i, j, k = most
    on[0], on[2] = min(i, j, k), max(i, j, k)
    on[1] = on[2] if k == i else i + j + k - on[0] - on[2]
    on[2] = on[0] if k == i else on[2]
    return math.sqrt(radius)


@njit((_PATHS, int64[::1], _TABLE, int64[::1], int64[:, :, ::1]), cache=True)
def resolve(paths: Array, points: Ints, normals: Array, circles: Ints, active: Ints) -> Array:
    """Return what acts on planes, and write the instants that decide it.

    Parameters
    ----------
    paths : (n_points, n_kinds, 6, n_instants) of stress, and of strain
    points : (n,) the point of each plane
    normals : (n, 3)
    circles : (n_kinds,) whether the amplitude of shear counts: else it is 0
    active : (n, n_kinds, 5) instants of the largest and smallest normal component, and three on the
        smallest circle, the last one the first if there are two; overwritten: the search begins
        with those given

    Returns
    -------
    shear amplitude, largest normal component and half its range of each kind (3 n_kinds, n)
    """
    n_kinds, n = paths.shape[1], paths.shape[3]
    values = np.zeros((3 * n_kinds, len(points)))
    flat, across, size = np.empty((2, n)), np.empty(n), np.empty(n)
    b, c, centre = np.empty(3), np.empty(3), np.empty(2)
    for i in range(len(points)):
        _tangents(normals[i], b, c)
        for k in range(n_kinds):
            x = paths[points[i], k]
            if circles[k]:
                _projected(x, normals[i], b, c, flat)
            _across(x, normals[i], across)
            high = low = 0
            for t in range(n):
                high = t if across[t] > across[high] else high
                low = t if across[t] < across[low] else low
            active[i, k, 0], active[i, k, 1] = high, low
            if circles[k]:
                on = active[i, k, 2:]
                if on[0] == on[1]:
                    on[0], on[1], on[2] = high, low, high
                values[3 * k, i] = _circle(flat, on, centre, size)
            values[3 * k + 1, i] = across[high]
            values[3 * k + 2, i] = (across[high] - across[low]) / 2
    return values


@njit(cache=True, inline="always")
def _in_axes(x: Array, t: int, less: int, a: Array, b: Array, c: Array, out: Array) -> None:
    """Write the tensor at an instant, less that at another one if any, in axes a, b, c."""
    p, q, r, f, g, h = x[0, t], x[1, t], x[2, t], x[3, t], x[4, t], x[5, t]
    if less >= 0:
        p, q, r = p - x[0, less], q - x[1, less], r - x[2, less]
        f, g, h = f - x[3, less], g - x[4, less], h - x[5, less]
    for j in range(3):
        d = a if j == 0 else (b if j == 1 else c)
        e = a if j == 2 else (b if j == 0 else c)
        u, v = p * d[0] + f * d[1] + h * d[2], f * d[0] + q * d[1] + g * d[2]
        w = h * d[0] + g * d[1] + r * d[2]
        out[j] = u * d[0] + v * d[1] + w * d[2]
        out[3 + j] = u * e[0] + v * e[1] + w * e[2]


@njit(cache=True, inline="always")
def _on_plane(S: Array, i: int, u: float, v: float, size: float) -> tuple[float, ...]:
    """Return the normal component, and the shear, of a tensor on the plane (1, u, v)."""
    d, e = S[i, 0] + u * S[i, 3] + v * S[i, 5], S[i, 3] + u * S[i, 1] + v * S[i, 4]
    f = S[i, 5] + u * S[i, 4] + v * S[i, 2]
    normal = (d + u * e + v * f) * size
    return normal, d - normal, e - normal * u, f - normal * v


@njit((_PATHS, int64[::1], _TABLE, int64[:, :, ::1]), cache=True, error_model="numpy")
def beside(paths: Array, points: Ints, normals: Array, active: Ints) -> tuple[Array, Array, Array]:
    """Return what acts on planes beside others for the instants that decide it there.

    See `resolve`. Of three instants the radius is that of the circle through them.

    Returns
    -------
    values (3 n_kinds, n, 7) on the planes of `_STENCIL`, slopes (3 n_kinds, n, 2) of the first one
    along the tangents, tangents (n, 2, 3)
    """
    n_kinds, n, count = paths.shape[1], len(points), _STENCIL.shape[1]
    values, slopes = np.empty((3 * n_kinds, n, count)), np.zeros((3 * n_kinds, n, 2))
    tangents, S = np.empty((n, 2, 3)), np.empty((4, 6))
    for i in range(n):
        a, (b, c) = normals[i], tangents[i]
        _tangents(a, b, c)
        for k in range(n_kinds):
            x, own, shear = paths[points[i], k], active[i, k], 3 * k
            _in_axes(x, own[0], -1, a, b, c, S[0])
            _in_axes(x, own[1], -1, a, b, c, S[1])
            _in_axes(x, own[3], own[2], a, b, c, S[2])
            _in_axes(x, own[4], own[2], a, b, c, S[3])
            for s in range(count - 1, -1, -1):
                u, v = _STENCIL[0, s], _STENCIL[1, s]
                size = 1 / (1 + u * u + v * v)
                high, _, _, _ = _on_plane(S, 0, u, v, size)
                low, _, _, _ = _on_plane(S, 1, u, v, size)
                _, d, e, f = _on_plane(S, 2, u, v, size)
                _, g, h, r = _on_plane(S, 3, u, v, size)
                p, q, pq = d * d + e * e + f * f, g * g + h * h + r * r, d * g + e * h + f * r
                opposite, det = p + q - 2 * pq, p * q - pq * pq
                three = det > 1e-14 * p * q
                square = p * q * opposite / det if three else p
                values[shear, i, s] = math.sqrt(square * size) / 2
                values[shear + 1, i, s], values[shear + 2, i, s] = high, (high - low) / 2
            for s in range(2):  # on the first plane d and g are zero
                y, z = (1, 4) if s == 0 else (4, 2)
                du, dv = S[2, y] - (S[2, 0] if s == 0 else 0.0), S[2, z] - (S[2, 0] if s else 0.0)
                eu, ev = S[3, y] - (S[3, 0] if s == 0 else 0.0), S[3, z] - (S[3, 0] if s else 0.0)
                dp, dq = 2 * (e * du + f * dv), 2 * (h * eu + r * ev)
                rise = dp / p if p > 0.0 else 0.0
                if three:
                    dpq = h * du + r * dv + e * eu + f * ev
                    rise += dq / q + (dp + dq - 2 * dpq) / opposite
                    rise -= (q * dp + p * dq - 2 * pq * dpq) / det
                slopes[shear, i, s] = values[shear, i, 0] * rise / 2
                slopes[shear + 1, i, s] = 2 * S[0, 3 if s == 0 else 5]
                slopes[shear + 2, i, s] = S[0, 3 if s == 0 else 5] - S[1, 3 if s == 0 else 5]
    return values, slopes, tangents


@njit((_TABLE, _TABLE, _STEPS), cache=True)
def uphill(f: Array, slope: Array, tangents: Array) -> tuple[Array, Array, Array]:
    """Return steps (n, 3) of Newton's method to maxima, the gains (n,), and ways (n, 2, 3).

    Along its ways a function falls from its maximum by half the square of the distance: they are
    the directions of its curvatures over their roots. A curvature of the wrong sign is turned.

    Parameters
    ----------
    f : (n, 7) the function on the planes of `_STENCIL`
    slope : (n, 2) of the function along the tangents
    tangents : see `beside`
    """
    steps, gains, ways = np.zeros((len(f), 3)), np.zeros(len(f)), np.empty((len(f), 2, 3))
    for i in range(len(f)):
        p, q = f[i, 1] + f[i, 2] - 2 * f[i, 0], f[i, 3] + f[i, 4] - 2 * f[i, 0]
        off = (f[i, 5] + f[i, 6] - 2 * f[i, 0]) / 2 - (p + q) / 2
        angle, size = math.atan2(off, (p - q) / 2) / 2, math.hypot((p - q) / 2, off)
        least = _FLATTEST * (abs(p + q) / 2 + size)
        for k in range(2):
            c, s = math.cos(angle), math.sin(angle)
            curve = max(abs((p + q) / 2 + (size if k == 0 else -size)), least)
            root = _NEAR / math.sqrt(curve) if curve > 0.0 else 0.0  # all planes are the same
            along = (c * slope[i, 0] + s * slope[i, 1]) * root
            gains[i] += along * along / 2
            for j in range(3):
                ways[i, k, j] = (c * tangents[i, 0, j] + s * tangents[i, 1, j]) * root
                steps[i, j] += along * ways[i, k, j]
            angle += math.pi / 2
    return steps, gains, ways


@njit((_TABLE, _TABLE), cache=True)
def moved(normals: Array, steps: Array) -> Array:
    """Return the normals (n, 3) after steps, that are shortened to `_FARTHEST`."""
    out = np.empty(normals.shape)
    for i in range(len(normals)):
        size = math.sqrt(steps[i, 0] ** 2 + steps[i, 1] ** 2 + steps[i, 2] ** 2)
        _turned(normals[i], 1 / max(size / _FARTHEST, 1.0), steps[i], 0.0, steps[i], out[i])
    return out


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
