"""The critical plane: where a function of what acts on planes is largest.

1. A scan of planes over the hemisphere, the same for all points.
2. Newton's method from the best of those that are better than their neighbours. Amplitude
   and maximum are the largest of functions that are smooth in the normal, so that a maximum over
   planes is one of a smooth function. Gradients are exact, the matrix is their difference.
3. The best of these planes; of planes with equal values the one with the largest second value.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from solver.fatigue.paths import Paths
from solver.late import late
from solver.typing import Array, Ints

_scan, _resolve = late("fatigue.kernels", "scan", "resolve")

_PLANES = 108
"""Number of planes in a scan; neighbours are 13 degrees apart."""
_NEIGHBOURS, _WORSE = 5, 0.12
"""Newton's method starts at planes that are better than so many neighbours, and by at most this
share worse than the best: the scan may be wrong by as much."""
_STEPS, _LONGEST, _CLOSE = 30, 0.2, 1e-9
"""Largest number of Newton steps, their largest angle, and the angle at which they end."""
_ROUNDING = 1e-14
"""Relative change of a value that is rounding."""
_NEAR = 1e-5
"""Angle for the differences of gradients."""
_DIFFERENCE = 1e-3
"""Relative change for the derivatives of a criterion by what acts on a plane: those of a product of
two are exact, and rounding matters little."""
_ROUNDS = 6
"""Largest number of times that the planes around a maximum are looked at."""
_PATTERN = [
    (size * np.cos(angle), size * np.sin(angle))
    for size in (0.003, 0.01, 0.03, 0.1)
    for angle in np.arange(6) * np.pi / 3 + 10 * size
]
"""Angles by which these are turned, about two axes."""
_SAME = 1e-9
"""Relative difference of values that are equal."""
_AT_ONCE = 1000
"""Number of points that are scanned together."""


class OnPlanes(NamedTuple):
    """What acts on planes in a cycle, or its derivatives.

    Attributes
    ----------
    shear : amplitude of shear stress: radius of the smallest circle around its path [MPa]
    normal : largest normal stress [MPa]
    normal_half : half the range of normal stress [MPa]
    shear_strain : amplitude of shear strain, as ``xy``: half of the engineering one
    normal_strain : largest normal strain
    strain_half : half the range of normal strain
    """

    shear: Array
    normal: Array
    normal_half: Array
    shear_strain: Array = np.zeros(0)
    normal_strain: Array = np.zeros(0)
    strain_half: Array = np.zeros(0)


Value = Callable[[OnPlanes], Array]
"""Returns a number for each of the planes (...)."""


class Critical(NamedTuple):
    """Critical planes: normals (n, 3), and what acts on them (n,)."""

    normal: Array
    on: OnPlanes


def _hemisphere(count: int) -> Array:
    """Return normals (count, 3) at equal distances, along a spiral."""
    z = (np.arange(count) + 0.5) / count
    angle = np.pi * (1 + 5**0.5) * np.arange(count)
    r = np.sqrt(1 - z**2)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)


_NORMALS = _hemisphere(_PLANES)
_AROUND = np.argsort(-np.abs(_NORMALS @ _NORMALS.T), axis=1)[:, :_NEIGHBOURS]


def critical_planes(paths: Paths, search: Value, value: Value | None = None) -> Critical:
    """Return the planes on which ``search`` is largest; of equal ones those of ``value``."""
    each = [
        _critical(paths.at(slice(k, k + _AT_ONCE)).turned, search, value or search)
        for k in range(0, len(paths), _AT_ONCE)
    ]
    normals, ons = zip(*each, strict=True)
    return Critical(np.concatenate(normals), OnPlanes(*map(np.concatenate, zip(*ons, strict=True))))


def _critical(paths: list[Array], search: Value, value: Value) -> Critical:
    found = search(OnPlanes(*(each for own in paths for each in _scan(own, _NORMALS))))
    least = found.max(axis=1, keepdims=True)
    least = least - _WORSE * np.abs(least)
    tried = (found >= found[:, _AROUND].max(axis=2)) & (found >= least)
    points, starts = map(np.ascontiguousarray, np.nonzero(tried))
    normal = _refined(paths, points, search, _NORMALS[starts])
    normal = _looked_around(paths, points, search, normal)
    on, _ = _on(paths, points, normal)
    best = search(on)
    top = np.full(len(found), -np.inf)
    np.maximum.at(top, points, best)
    equal = best >= (top - _SAME * np.abs(top))[points]
    order = np.lexsort((np.where(equal, value(on), -np.inf), points))
    chosen = order[np.flatnonzero(np.diff(points[order], append=len(found)))]
    normal = normal[chosen] * np.where(normal[chosen, 2] < 0, -1.0, 1.0)[:, None]
    return Critical(normal, OnPlanes(*(own[chosen] if own.size else own for own in on)))


def _on(paths: list[Array], points: Ints, normals: Array) -> tuple[OnPlanes, OnPlanes]:
    """Return what acts on planes (n, 3) at points (n,), and its derivatives by the normal."""
    each = [_resolve(own, points, normals) for own in paths]
    values, slopes = (np.concatenate([one[k] for one in each]) for k in (0, 1))
    return OnPlanes(*values), OnPlanes(*slopes)


def _refined(paths: list[Array], points: Ints, search: Value, start: Array) -> Array:
    """Return the planes (n, 3) of the maxima near some planes at points (n,).

    A step after which the value is less is taken back by three quarters.
    """
    best, active = start.copy(), np.arange(len(points))
    trial, most = start.copy(), np.full(len(points), -np.inf)
    for _ in range(_STEPS):
        own, a = points[active], trial[active]
        now, gradient = _gradient(paths, own, search, a)
        b, c = _tangents(a)
        turned = [
            _gradient(paths, own, search, _turned(a, _NEAR * d))[1] - gradient for d in (b, c)
        ]
        g = np.stack([(gradient * d).sum(axis=1) for d in (b, c)], axis=1)
        H = np.array([[(t * d).sum(axis=1) for d in (b, c)] for t in turned]).transpose(2, 0, 1)
        step = _ascent(g, (H + H.swapaxes(1, 2)) / (2 * _NEAR))
        longest = np.linalg.norm(step, axis=1, keepdims=True)
        step *= np.minimum(1.0, _LONGEST / np.maximum(longest, 1e-300))
        worse = now < most[active] - _ROUNDING * np.abs(most[active])
        back = (best[active] - a) * 0.75
        moved = np.where(worse[:, None], back, step[:, :1] * b + step[:, 1:] * c)
        accepted = active[~worse]
        best[accepted], most[accepted] = a[~worse], now[~worse]
        trial[active] = _turned(a, moved)
        active = active[np.linalg.norm(moved, axis=1) > _CLOSE]
        if not active.size:
            break
    return best


def _looked_around(paths: list[Array], points: Ints, search: Value, normal: Array) -> Array:
    """Return maxima (n, 3) that no plane of a pattern around them exceeds.

    A path of many instants may have several maxima close together, of almost the same value.
    """
    normal, active = normal.copy(), np.arange(len(points))
    for _ in range(_ROUNDS):
        own, a = points[active], normal[active]
        b, c = _tangents(a)
        best, most = a, search(_on(paths, own, a)[0])
        least = most + _SAME * np.abs(most)
        for u, v in _PATTERN:
            other = _turned(a, u * b + v * c)
            found = search(_on(paths, own, other)[0])
            best = np.where((found > most)[:, None], other, best)
            most = np.maximum(most, found)
        better = most > least
        active = active[better]
        if not active.size:
            break
        normal[active] = _refined(paths, points[active], search, best[better])
    return normal


def _ascent(g: Array, H: Array) -> Array:
    """Return Newton's steps (n, 2) upwards: along each eigenvector g over the absolute value."""
    values, vectors = np.linalg.eigh(H)
    along = np.einsum("nij,ni->nj", vectors, g)
    floor = 1e-6 * np.abs(values).max(axis=1, keepdims=True) + 1e-300
    along /= np.maximum(np.abs(values), floor)
    return np.einsum("nij,nj->ni", vectors, along)


def _gradient(
    paths: list[Array], points: Ints, search: Value, normal: Array
) -> tuple[Array, Array]:
    """Return values (n,) and gradients (n, 3) by the normal, by the chain rule."""
    on, slopes = _on(paths, points, normal)
    now = search(on)
    gradient = np.zeros_like(normal)
    for k, (own, slope) in enumerate(zip(on, slopes, strict=True)):
        if not own.size:
            continue
        h = _DIFFERENCE * (np.abs(own) + np.abs(slope).max(axis=1)) + 1e-300
        up, down = (search(on._replace(**{OnPlanes._fields[k]: own + s * h})) for s in (1, -1))
        gradient += ((up - down) / (2 * h))[:, None] * slope
    return now, gradient


def _tangents(a: Array) -> tuple[Array, Array]:
    """Return two unit vectors (n, 3) in the planes of normals (n, 3)."""
    b = np.zeros_like(a)
    b[np.arange(len(a)), np.abs(a).argmin(axis=1)] = 1.0
    b -= (a * b).sum(axis=1, keepdims=True) * a
    b /= np.linalg.norm(b, axis=1, keepdims=True)
    return b, np.cross(a, b)


def _turned(a: Array, step: Array) -> Array:
    """Return normals (n, 3) turned by tangent vectors (n, 3), whose length is about the angle."""
    moved = a + step
    return np.asarray(moved / np.linalg.norm(moved, axis=1, keepdims=True))
