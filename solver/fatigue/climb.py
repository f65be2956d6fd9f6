"""From planes to the nearest maxima of a function of what acts on them; compiled by numba.

Few instants decide what acts on a plane: those of the largest and the smallest normal component,
and two or three on the smallest circle around the path of shear. The function is the largest of
those of all choices of deciding instants, and each of these is smooth in the normal. So its maximum
is one of a smooth function.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import float64, int64, njit
from numpy.typing import NDArray

from solver.fatigue.balls import ball
from solver.typing import Array, Bools, Ints

AnyArray = NDArray[Any]  # of real or complex numbers
Model = tuple[Ints, Array, Array, Array]
"""Which values on planes a function reads (n_kinds, 3), the values at its start, and its first and
second derivatives there."""
Room = tuple[Array, Array, Array]
"""Values on a plane (3 n_kinds,), and room for instants (3 n + 56,) and for steps (10, 3)."""
_TABLE, _STEPS, _PATHS = float64[:, ::1], float64[:, :, ::1], float64[:, :, :, ::1]
_NEAR, _FARTHEST, _CLOSE, _ROUGH = 1e-4, 0.2, 1e-6, 1e-2
"""Angle for differences; largest of a Newton step, and those at which they end, on whole and on
simplified paths."""
_CLIMBS = 15
"""Largest number of changes of the deciding instants on the way to a maximum."""
_LOSSES, _WIDEST, _WAYS = (1e-3, 2e-2), 0.25, 6
"""Other deciding instants are sought on so many planes around a maximum, where the function has
lost these shares of the sizes of its parts, but no farther than an angle."""
_GAINED = 5e-3
"""Share of the sizes of its parts by which other instants may raise a maximum."""
_BESIDE, _REACHED = math.cos(0.02), math.cos(0.1)
"""Cosines of the angles between planes that lead to one maximum of a simplified path, and of a
whole one."""
_AROUND = 0.15
"""Angle within which the instants that may decide are kept."""


@njit(cache=True, inline="always")
def _turned(a: Array, u: complex, b: Array, v: complex, c: Array, out: AnyArray) -> None:
    """Write the unit vector along a + u b + v c."""
    for j in range(3):
        out[j] = a[j] + u * b[j] + v * c[j]
    size = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
    for j in range(3):
        out[j] /= size


@njit(cache=True, inline="always")
def _tangents(a: Array, b: Array, c: Array) -> None:
    """Write two unit vectors in the plane of normal a."""
    k = 0 if abs(a[0]) <= abs(a[1]) else 1
    k = k if abs(a[k]) <= abs(a[2]) else 2
    size = math.sqrt(1 - a[k] * a[k])
    for j in range(3):
        b[j] = ((1.0 if j == k else 0.0) - a[k] * a[j]) / size
    c[0] = a[1] * b[2] - a[2] * b[1]
    c[1] = a[2] * b[0] - a[0] * b[2]
    c[2] = a[0] * b[1] - a[1] * b[0]


@njit(cache=True, fastmath=True)
def _projected(x: Array, a: Array, b: Array, c: Array, flat: Array, across: Array) -> None:
    """Write the components of a path (6, n) along b, c (2, n) and along the normal a (n,)."""
    for t in range(x.shape[1]):
        tx = x[0, t] * a[0] + x[3, t] * a[1] + x[5, t] * a[2]
        ty = x[3, t] * a[0] + x[1, t] * a[1] + x[4, t] * a[2]
        tz = x[5, t] * a[0] + x[4, t] * a[1] + x[2, t] * a[2]
        flat[0, t] = tx * b[0] + ty * b[1] + tz * b[2]
        flat[1, t] = tx * c[0] + ty * c[1] + tz * c[2]
        across[t] = tx * a[0] + ty * a[1] + tz * a[2]


@njit(cache=True)
def _decided(
    x: Array, a: Array, used: Ints, value: Array, active: Ints, room: Array, margin: float,
    maybe: Bools,
) -> None:  # fmt: skip
    """Write what acts on the plane a, and the instants that decide it, of each kind.

    `active` (n_kinds, 6) receives the instants of the largest and the smallest normal component,
    the number of instants on the smallest circle, and up to three of these. Values that are not
    `used` (n_kinds, 3) are 0. With a margin above 0, `maybe` (n,) becomes True of instants that may
    decide where components change by that share of the size of the path.
    """
    n = x.shape[2]
    work = room[3 * n : 3 * n + 56].reshape(7, 8)
    flat, across = room[: 2 * n].reshape(2, n), room[2 * n : 3 * n]
    centre, support, share = work[4, 6:], work[4, :4], work[5, :4]
    b, c = work[6, :3], work[6, 3:6]
    active[:], value[:] = 0, 0.0
    for k in range(len(x)):
        if not used[k].any():
            continue
        _tangents(a, b, c)
        _projected(x[k], a, b, c, flat, across)
        high = low = 0
        for t in range(n if used[k, 1] or used[k, 2] else 0):
            high = t if across[t] > across[high] else high
            low = t if across[t] < across[low] else low
        low = low if used[k, 2] else high
        radius, count = 0.0, 0
        if used[k, 0]:
            radius, count = ball(flat, centre, support, share, work[:4])
        value[3 * k], value[3 * k + 1] = radius, across[high] * used[k, 1]
        value[3 * k + 2] = (across[high] - across[low]) / 2
        active[k, 0], active[k, 1], active[k, 2] = high, low, min(count, 3)
        for i in range(active[k, 2]):
            active[k, 3 + i] = int(support[i])
        if margin > 0.0:
            apart = margin * (radius + (across.max() - across.min()) / 2)
            for t in range(n):
                near = used[k, 2] and across[t] < across[low] + apart
                near = near or (used[k, 1:].any() and across[t] > across[high] - apart)
                if used[k, 0]:
                    away = math.hypot(flat[0, t] - centre[0], flat[1, t] - centre[1])
                    near = near or away > radius - apart
                maybe[t] = maybe[t] or near


@njit(cache=True, inline="always")
def _given(x: Array, a: AnyArray, active: Ints, used: Ints, value: AnyArray, T: AnyArray) -> None:
    """Write what acts on the plane a, real or complex, for given instants of each kind.

    `T` (4, 3) is overwritten.
    """
    for k in range(len(x)):
        n = active[k, 2]
        high = low = 0.0 * a[0]
        for i in range(0 if used[k, 1] or used[k, 2] else 2, 2 + n):
            if i == 1 and not used[k, 2]:
                low = high
                continue
            t, out = active[k, i if i < 2 else i + 1], T[max(i - 2, -1)]
            out[0] = x[k, 0, t] * a[0] + x[k, 3, t] * a[1] + x[k, 5, t] * a[2]
            out[1] = x[k, 3, t] * a[0] + x[k, 1, t] * a[1] + x[k, 4, t] * a[2]
            out[2] = x[k, 5, t] * a[0] + x[k, 4, t] * a[1] + x[k, 2, t] * a[2]
            along = out[0] * a[0] + out[1] * a[1] + out[2] * a[2]
            high, low = along if i == 0 else high, along if i == 1 else low
            for j in range(3):
                out[j] -= along * a[j]
        value[3 * k], value[3 * k + 1] = 0.0, high * used[k, 1]
        value[3 * k + 2] = (high - low) / 2
        p = q = g = 0.0 * high  # squares of two sides from the first point, and their product
        for j in range(3 if n > 1 else 0):
            d, e = T[1, j] - T[0, j], T[2, j] - T[0, j]
            p, q, g = p + d * d, q + e * e, g + d * e
        if n == 2:
            value[3 * k] = np.sqrt(p) / 2
        elif n == 3:
            third = p + q - 2 * g
            if g.real <= 0.0:  # no acute triangle: its longest side
                square = third
            elif p.real <= g.real:
                square = q
            elif q.real <= g.real:
                square = p
            else:
                square = p * q * third / (p * q - g * g)
            value[3 * k] = np.sqrt(square) / 2


@njit(cache=True, inline="always")
def _risen(value: AnyArray, model: Model) -> Any:
    """Return the rise of the function from its value at the start."""
    _used, start, weight, curve = model
    rise = 0.0
    for k in range(len(value)):
        change = weight[k]
        for m in range(len(value)):
            change += curve[k, m] * (value[m] - start[m]) / 2
        rise += change * (value[k] - start[k])
    return rise


@njit(cache=True)
def _stepped(x: Array, a: Array, active: Ints, model: Model, value: Array, work: Array) -> float:
    """Move the plane a by a step of Newton's method for given instants; return its length.

    `work` (10, 3) receives the directions of the principal curvatures in its first two rows, and
    the curvatures and the rise that is expected in the third; `value` what acts on the plane
    before.
    """
    b, c, sizes, trial, f, T = work[0], work[1], work[2], work[3], work[4:6].ravel(), work[6:]
    _tangents(a, b, c)
    for i in range(6):
        u = _NEAR if i in (0, 4) else (-_NEAR if i == 1 else 0.0)
        v = _NEAR if i in (2, 4) else (-_NEAR if i == 3 else 0.0)
        _turned(a, u, b, v, c, trial)
        _given(x, trial, active, model[0], value, T)
        f[i] = _risen(value, model)
    u, v = (f[0] - f[1]) / (2 * _NEAR), (f[2] - f[3]) / (2 * _NEAR)
    p, q = (f[0] + f[1] - 2 * f[5]) / _NEAR**2, (f[2] + f[3] - 2 * f[5]) / _NEAR**2
    off = (f[4] - f[0] - f[2] + f[5]) / _NEAR**2
    angle, size = math.atan2(off, (p - q) / 2) / 2, math.hypot((p - q) / 2, off)
    sizes[0], sizes[1] = abs((p + q) / 2 + size), abs((p + q) / 2 - size)
    floor = 1e-6 * max(sizes[0], sizes[1]) + 1e-300
    cosine, sine = math.cos(angle), math.sin(angle)
    for j in range(3):
        b[j], c[j] = cosine * b[j] + sine * c[j], cosine * c[j] - sine * b[j]
    for j in range(2):
        sizes[j] = max(sizes[j], floor)
    sizes[2] = f[5]
    # up along each direction of a curvature, whatever its sign
    along, beside = (cosine * u + sine * v) / sizes[0], (cosine * v - sine * u) / sizes[1]
    step = math.hypot(along, beside)
    sizes[2] += (along * along * sizes[0] + beside * beside * sizes[1]) / 2
    short = min(_FARTHEST / max(step, 1e-300), 1.0)
    _turned(a, short * along, b, short * beside, c, trial)
    a[:] = trial
    return step


@njit(cache=True)
def _polished(x: Array, a: Array, active: Ints, model: Model, room: Room) -> None:
    """Move the plane a onto the maximum for given instants, from close to it.

    Values that the function does not read may be steep there: the slopes are without truncation
    and rounding, by a complex step.
    """
    real, _scratch, work = room
    before = a.copy()
    if _stepped(x, a, active, model, real, work) > _ROUGH:
        a[:] = before
        return
    slopes, at = np.empty(2), np.empty(3, dtype=np.complex128)
    value, T = np.empty(3 * len(x), dtype=np.complex128), np.empty((4, 3), dtype=np.complex128)
    for _step in range(2):
        for j in range(2):
            _turned(a, 1e-30j, work[j], 0.0, work[j], at)
            _given(x, at, active, model[0], value, T)
            slopes[j] = _risen(value, model).imag / 1e-30
        along, beside = slopes[0] / work[2, 0], slopes[1] / work[2, 1]
        if math.hypot(along, beside) < _ROUGH:
            _turned(a, along, work[0], beside, work[1], a)


@njit(cache=True, inline="always")
def _same(one: Ints, other: Ints) -> bool:
    """Return whether deciding instants are the same."""
    for k in range(len(one)):
        for m in range(3 + one[k, 2]):
            if one[k, m] != other[k, m]:
                return False
    return True


@njit(cache=True)
def _near(a: Array, others: Array, cosine: float) -> bool:
    """Return whether a plane is near one of others (n, 3)."""
    for other in others:
        if abs(a[0] * other[0] + a[1] * other[1] + a[2] * other[2]) > cosine:
            return True
    return False


@njit(cache=True)
def _climbed(
    x: Array, a: Array, active: Ints, best: float, model: Model, room: Room, little: float,
    close: float, known: Array,
) -> float:  # fmt: skip
    """Move the plane a up to a maximum, with its instants; return the rise of the function there.

    It is -inf where the way leads near a known plane.

    1. Two steps of Newton's method for the deciding instants.
    2. These are decided anew. If the function is smaller there, the way is shortened.
    """
    new, before, maybe = np.empty_like(active), np.empty(3), np.empty(0, dtype=np.bool_)
    value, scratch, work = room
    for _ in range(_CLIMBS):
        before[:] = a
        step, found = math.inf, -math.inf
        for _step in range(2):
            if step > close:
                step = _stepped(x, a, active, model, value, work)
        for _half in range(4):
            _decided(x, a, model[0], value, new, scratch, 0.0, maybe)
            found = _risen(value, model)
            if found > best - little:
                break
            _turned(a, 3.0, before, 0.0, before, a)
        if found <= best - little:
            a[:] = before
            break
        done = step <= close and _same(new, active)
        active[:], best = new, found
        if _near(a, known, _BESIDE):
            return -math.inf
        if done:
            break
    return best


@njit(cache=True)
def _exchanged(
    x: Array, a: Array, active: Ints, best: float, model: Model, room: Room, little: float,
    whole: float,
) -> float:  # fmt: skip
    """Move the plane a from a maximum to higher ones of other deciding instants near it.

    They are those of planes on an ellipse around the maximum, where the function for given instants
    has lost an equal share. Two steps of Newton's method for each tell whether it is higher: the
    function is not less than that for given instants.
    """
    tried = np.empty((len(_LOSSES) * _WAYS + 1, *active.shape), dtype=np.int64)
    at, axes, new, maybe = np.empty(3), np.empty((2, 3)), active, np.empty(0, dtype=np.bool_)
    value, scratch, work = room
    risen = True
    while risen:
        risen, count = False, 1
        tried[0], new, at[:] = active, active.copy(), a
        _stepped(x, at, active, model, value, work)
        axes[:] = work[:2]
        wide, long = math.sqrt(whole / work[2, 0]), math.sqrt(whole / work[2, 1])
        for way in range(len(_LOSSES) * _WAYS):
            ring = way // _WAYS
            angle, far = math.pi * (2 * way + ring) / _WAYS, math.sqrt(_LOSSES[ring])
            u, v = min(far * wide, _WIDEST), min(far * long, _WIDEST)
            _turned(a, u * math.cos(angle), axes[0], v * math.sin(angle), axes[1], at)
            _decided(x, at, model[0], value, new, scratch, 0.0, maybe)
            known = False
            for k in range(count):
                known = known or _same(new, tried[k])
            if known:
                continue
            tried[count] = new
            count += 1
            _stepped(x, at, new, model, value, work)
            if 2 * work[2, 2] - _risen(value, model) < best:
                continue
            _stepped(x, at, new, model, value, work)
            _given(x, at, new, model[0], value, work[6:])
            found = _risen(value, model)
            if found > best + little:
                best = _climbed(x, at, new, found, model, room, little, _CLOSE, a[:0].reshape(0, 3))
                a[:], active[:], risen = at, new, True
                break
    return best


@njit(cache=True)
def _picked(x: Array, listed: Ints) -> Array:
    """Return a path (n_kinds, 6, n) at some instants."""
    n_kinds, _, _n = x.shape
    picked = np.empty((n_kinds, 6, len(listed)))
    for k in range(n_kinds):
        for a in range(6):
            for i in range(len(listed)):
                picked[k, a, i] = x[k, a, listed[i]]
    return picked


@njit(cache=True)
def _refined(x: Array, a: Array, model: Model, room: Room, most: float) -> float:
    """Move the plane a to the highest maximum near it, of the whole path; return the rise there."""
    active, maybe = np.empty((len(x), 6), dtype=np.int64), np.zeros(x.shape[2], dtype=np.bool_)
    value, scratch, _work = room
    _decided(x, a, model[0], value, active, scratch, _AROUND, maybe)
    near = _picked(x, np.flatnonzero(maybe))
    _decided(near, a, model[0], value, active, scratch, 0.0, maybe)
    best, whole = _risen(value, model), 0.0
    for k in range(len(value)):
        whole += abs(model[2][k] * value[k])
    little = 1e-13 * whole
    best = _climbed(near, a, active, best, model, room, little, _CLOSE, a[:0].reshape(0, 3))
    if best < most - _GAINED * whole:
        return best
    best = _exchanged(near, a, active, best, model, room, little, whole)
    _polished(near, a, active, model, room)
    _decided(x, a, model[0], value, active, scratch, 0.0, maybe)
    found = _risen(value, model)
    if found > best + 1e4 * little:  # another instant decides
        found = _climbed(x, a, active, found, model, room, little, _CLOSE, a[:0].reshape(0, 3))
        _polished(x, a, active, model, room)
        _decided(x, a, model[0], value, active, scratch, 0.0, maybe)
    return found


@njit(
    (_PATHS, int64[:, ::1], int64[::1], int64[::1], _TABLE, int64[:, ::1], float64[::1],
     float64[::1], float64[::1], _TABLE, _TABLE, _STEPS),
    cache=True,
)  # fmt: skip
def climb(
    paths: Array, kept: Ints, counts: Ints, points: Ints, starts: Array, used: Ints,
    levels: Array, falls: Array, slack: Array, origins: Array, weights: Array, curves: Array,
) -> tuple[Array, Array, Bools]:  # fmt: skip
    """Return planes (n, 3) on which a function is largest, near starts, and what acts on them.

    1. From each start, on the simplified path, up to a maximum (`_climbed`).
    2. From those that may be the largest, on the whole path; then to higher ones near it
       (`_exchanged`). Only instants that may decide nearby are taken; the result is decided by all.

    Parameters
    ----------
    paths, kept, counts : see `solver.fatigue.scan.simplified`
    points : (n,) the point of each start; those of a point follow one another
    used : (n_kinds, 3) which values on planes count
    levels : (n,) the function at `origins`
    falls : (n,) by how much a start may be below the maximum near it
    slack : (n,) by how much the function of the simplified path may be below that of the whole
    origins : (n, 3 n_kinds) what acts where the function is known, and its derivatives there:
    weights, curves : (n, 3 n_kinds) and (n, 3 n_kinds, 3 n_kinds); the function is quadratic

    Returns
    -------
    normals; shear amplitude, largest normal component and half its range of each kind
    (3 n_kinds, n); whether the start led to a maximum of its own that may be the largest (n,)
    """
    n_kinds, n = paths.shape[1], paths.shape[3]
    active, maybe = np.empty((n_kinds, 6), dtype=np.int64), np.empty(0, dtype=np.bool_)
    value, scratch = np.empty(3 * n_kinds), np.empty(3 * n + 56)
    room = value, scratch, np.empty((10, 3))
    normals, values = starts.copy(), origins.T.copy()
    peaks, reached = np.empty((len(points) + 1, 3)), np.full(len(points), -math.inf)
    first = 0
    while first < len(points):
        point, last, most, found = points[first], first, -math.inf, 0
        simple = _picked(paths[point], kept[point, : counts[point]])
        while last < len(points) and points[last] == point:
            i, a = last, normals[last]
            last += 1
            model = used, origins[i], weights[i], curves[i]
            _decided(simple, a, used, value, active, scratch, 0.0, maybe)
            rise = _risen(value, model)
            if levels[i] + rise + falls[i] < most:
                continue
            little = 1e-13 * np.abs(weights[i] * value).sum()
            rise = _climbed(simple, a, active, rise, model, room, little, _ROUGH, peaks[:found])
            reached[i] = levels[i] + rise
            if rise > -math.inf:
                peaks[found], found, most = a, found + 1, max(most, reached[i])
        found = 0
        for turn in np.argsort(-reached[first:last]):
            i, a = first + turn, normals[first + turn]
            peaks[found] = a
            if reached[i] < max(most - slack[i], -1e300) or _near(a, peaks[:found], _REACHED):
                reached[i] = -math.inf
                continue
            model, found = (used, origins[i], weights[i], curves[i]), found + 1
            rise = _refined(paths[point], a, model, room, most - levels[i])
            values[:, i], most = value, max(most, levels[i] + rise)
        first = last
    return normals, values, reached > -math.inf
