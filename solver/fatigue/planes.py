"""The critical plane: where a function of what acts on planes is largest.

1. A scan of planes over the hemisphere, the same for all points, on simplified paths.
2. Newton's method from the best of those that are better than their neighbours
   (`solver.fatigue.kernels.climb`). Amplitude and maximum are the largest of functions that are
   smooth in the normal, so that a maximum over planes is one of a smooth function. The criterion is
   taken as quadratic in what acts on a plane, and again at the plane found if it is not.
3. The best of these planes; of planes with equal values the one with the largest second value.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from solver.fatigue.paths import Paths
from solver.late import late
from solver.typing import Array, Ints

_simplified, _scan, _resolve, _climb = late(
    "fatigue.kernels", "simplified", "scan", "resolve", "climb"
)

_PLANES = 216
"""Number of planes in a scan; neighbours are 9 degrees apart."""
_NEIGHBOURS, _WORSE = 3, 0.2
"""Newton's method starts at planes that are better than so many neighbours, and by at most this
share worse than the best: the scan may be wrong by as much (`scan`, and `_SIMPLE`)."""
_MISSED = 0.02
"""Share by which a maximum may exceed the planes nearest to it."""
_SIMPLE = 0.02
"""Distance of instants that the scan leaves out, over the size of the path."""
_DIFFERENCE = 1e-3
"""Relative change for the derivatives of a criterion by what acts on a plane: those of a product of
two are exact, and rounding matters little."""
_ROUNDS, _EXACT = 5, 1e-11
"""Largest number of times that the criterion is taken as quadratic, and the relative difference
from it at which it is."""
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


def _critical(paths: Array, search: Value, value: Value) -> Critical:
    kinds = range(paths.shape[1])
    simple = (_simplified(np.ascontiguousarray(paths[:, k]), _SIMPLE) for k in kinds)
    found = search(OnPlanes(*(each for own in simple for each in _scan(*own, _NORMALS))))
    least = found.max(axis=1, keepdims=True)
    least = least - _WORSE * np.abs(least)
    tried = (found >= found[:, _AROUND].max(axis=2)) & (found >= least)
    points, starts = map(np.ascontiguousarray, np.nonzero(tried))
    top = np.full(len(found), -np.inf)
    values = _resolve(paths, points, _NORMALS[starts])
    exact = search(OnPlanes(*values))
    np.maximum.at(top, points, exact)
    near = np.flatnonzero(exact >= (top - _MISSED * np.abs(top))[points])
    near = near[np.lexsort((-exact[near], points[near]))]
    points = points[near]
    normal, on = _climbed(paths, points, search, _NORMALS[starts[near]], values[:, near])
    best = search(on)
    top = np.full(len(found), -np.inf)
    np.maximum.at(top, points, best)
    equal = best >= (top - _SAME * np.abs(top))[points]
    order = np.lexsort((np.where(equal, value(on), -np.inf), points))
    chosen = order[np.flatnonzero(np.diff(points[order], append=len(found)))]
    normal = normal[chosen] * np.where(normal[chosen, 2] < 0, -1.0, 1.0)[:, None]
    return Critical(normal, OnPlanes(*(own[chosen] if own.size else own for own in on)))


def _climbed(
    paths: Array, points: Ints, search: Value, normal: Array, values: Array
) -> tuple[Array, OnPlanes]:
    """Return the planes (n, 3) of the maxima near some planes at points (n,), and what acts.

    ``values`` (m, n) are what acts on those planes; the arrays given are overwritten.
    """
    active = np.arange(len(points))
    for _ in range(_ROUNDS):
        before = np.ascontiguousarray(values[:, active])
        was = search(OnPlanes(*before))
        weights, curves = _derivatives(search, before)
        normal[active], values[:, active] = _climb(
            paths, points[active], normal[active], was, weights, curves
        )
        change = (values[:, active] - before).T
        rise = ((weights + np.einsum("nkm,nm->nk", curves, change) / 2) * change).sum(axis=1)
        now = search(OnPlanes(*values[:, active]))
        active = active[np.abs(now - was - rise) > _EXACT * np.abs(now)]
        if not active.size:
            break
    return normal, OnPlanes(*values)


def _derivatives(search: Value, values: Array) -> tuple[Array, Array]:
    """Return first and second derivatives (n, m), (n, m, m) of a criterion by values (m, n)."""
    count = len(values)
    h = _DIFFERENCE * np.abs(values) + 1e-6 * np.abs(values).max(axis=0) + 1e-300
    each = np.zeros((count, count, 4, values.shape[1]))
    for k in range(count):
        for m in range(k + 1):
            for place, (a, b) in enumerate(_SIGNS):
                moved = values.copy()
                moved[k] += a * h[k]
                moved[m] += b * h[m]
                each[k, m, place] = each[m, k, place] = search(OnPlanes(*moved))
    own = each[np.arange(count), np.arange(count)]
    first = (own[:, 0] - own[:, 3]) / (4 * h)
    mixed = (each[:, :, 0] - each[:, :, 1] - each[:, :, 2] + each[:, :, 3]) / (4 * h[:, None] * h)
    return np.ascontiguousarray(first.T), np.ascontiguousarray(mixed.transpose(2, 0, 1))


_SIGNS = ((1, 1), (1, -1), (-1, 1), (-1, -1))
"""Of the changes of two values for a second derivative."""
