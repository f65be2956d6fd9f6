"""The critical plane: where a function of what acts on planes is largest.

1. A scan of planes over the hemisphere, the same for all points, on simplified paths, gives bounds.
   Normal components and the amplitude of shear fall from a maximum no faster than cos(2 angle):
   along a great circle a normal component is such a wave, and the amplitude of shear R satisfies
   R'' >= -4 R. So the plane of a scan next to the largest maximum is smaller by a known share at
   most, and all others are dropped.
2. Newton's method from those that are better than their neighbours (`solver.fatigue.climb`). The
   criterion is taken as quadratic in what acts on a plane, and again at the plane found if it is
   not.
3. The best of these planes; of planes with equal values the one with the largest second value.

A criterion must not fall where a value of what acts on a plane rises.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from solver.fatigue.paths import Paths
from solver.late import late
from solver.tensors import _PLACES
from solver.typing import Array, Bools, Ints

_simplified, _scan = late("fatigue.scan", "simplified", "scan")
(_climb,) = late("fatigue.climb", "climb")

_PLANES = 216
"""Number of planes in a scan; neighbours are 9 degrees apart."""
_NEIGHBOURS = 2
"""Newton's method starts at planes that are better than so many neighbours."""
_MOST = 20
"""Newton's method starts at so many planes at most."""
_FALLS = 2 * np.sin(0.132) ** 2
"""Share by which a wave falls from its largest value within the largest angle from a plane of the
scan."""
_SIMPLE = 0.01
"""Distance of instants that the scan leaves out, over the size of the path."""
_DIFFERENCE = 1e-3
"""Relative change for the derivatives of a criterion by what acts on a plane: those of a product of
two are exact, and rounding matters little."""
_ROUNDS, _EXACT = 5, 1e-11
"""Largest number of times that the criterion is taken as quadratic, and the relative difference
from it at which it is."""
_SAME = 1e-9
"""Relative difference of values that are equal."""
_FULL = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])
"""Components of a tensor as a matrix."""
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
    """Return the planes on which ``search`` is largest; of equal ones those of ``value``.

    What neither of the two reads is not computed: it is 0.
    """
    value = value or search
    kinds = [own for own in (paths.stress, paths.strain) if own is not None]
    used = _used(kinds, search) | _used(kinds, value)
    kinds = kinds[: 1 + used[1:].any()]
    reads = used[: len(kinds)].astype(np.int64)
    each = []
    for k in range(0, len(paths), _AT_ONCE):
        some = np.stack([own[k : k + _AT_ONCE] for own in kinds], axis=1).swapaxes(2, 3)
        each.append(_critical(np.ascontiguousarray(some), reads, search, value))
    normals, ons = zip(*each, strict=True)
    return Critical(np.concatenate(normals), OnPlanes(*map(np.concatenate, zip(*ons, strict=True))))


def _axes(paths: Array) -> Array:
    """Return axes (n, 3, 3), in columns, that turn with the path of stress.

    They are the principal axes of the sum of its squares; signs follow from its mean in time.
    """
    full = paths[:, 0][:, _FULL]
    flat = full.reshape(len(full), 3, -1)
    _, axes = np.linalg.eigh(flat @ flat.swapaxes(1, 2))
    late = axes.swapaxes(1, 2) @ (full @ np.arange(1.0, full.shape[3] + 1)) @ axes
    axes[:, :, 1:] *= np.where(late[:, :1, 1:] < 0, -1.0, 1.0)
    return np.asarray(axes)


def _critical(given: Array, used: Ints, search: Value, value: Value) -> Critical:
    axes = _axes(given)
    i, j = np.array(_PLACES).T
    first, second = axes[:, i].swapaxes(1, 2), axes[:, j].swapaxes(1, 2)  # (n, axis, component)
    turn = first[:, i] * second[:, j] + np.where(i == j, 0.0, 1.0) * second[:, i] * first[:, j]
    points, normal, values = _maxima(np.ascontiguousarray(turn[:, None] @ given), used, search)
    on, top = OnPlanes(*values), np.full(len(given), -np.inf)
    best = search(on)
    np.maximum.at(top, points, best)
    equal = best >= (top - _SAME * np.abs(top))[points]
    order = np.lexsort((np.where(equal, value(on), -np.inf), points))
    chosen = order[np.flatnonzero(np.diff(points[order], append=len(given)))]
    normal = (axes @ normal[chosen, :, None])[:, :, 0]
    last = 2 - (np.abs(normal[:, ::-1]) > _SAME).argmax(axis=1)  # the last component not zero
    normal *= np.sign(normal[np.arange(len(normal)), last])[:, None]
    return Critical(normal, OnPlanes(*(own[chosen] if own.size else own for own in on)))


def _maxima(paths: Array, used: Ints, search: Value) -> tuple[Ints, Array, Array]:
    """Return points (n,) and planes (n, 3) of maxima that may be the largest; what acts (m, n)."""
    path = _simplified(paths, _SIMPLE)
    below, above = _scan(paths, *path, _NORMALS, used, _SIMPLE)
    found, most = search(OnPlanes(*below)), search(OnPlanes(*above))
    top = found.argmax(axis=1)[:, None]
    at_top = np.take_along_axis(below, top[None], axis=2)[:, :, 0].astype(float)
    level, (weights, curves) = search(OnPlanes(*at_top)), _derivatives(search, at_top)
    falls = _FALLS * _risen(weights, curves, _sizes(below))
    apart = np.repeat((above - below)[1::3, :, 0], 3, axis=0)  # of simplified paths
    slack = _risen(weights, curves, apart * used.reshape(-1, 1))
    least = np.take_along_axis(found, top, axis=1) - falls[:, None]
    peak = (found >= found[:, _AROUND].max(axis=2)) & (most >= least)
    peak &= found > found.min(axis=1, keepdims=True)  # all are equal where nothing does damage
    np.put_along_axis(peak, top, True, axis=1)
    points, starts = np.nonzero(peak)
    order = np.lexsort((-found[points, starts], points))
    points, starts = points[order], starts[order]
    first = np.arange(len(points)) - np.searchsorted(points, points) < _MOST
    points, normal = points[first], _NORMALS[starts[first]]
    known = (own[points] for own in (level, falls, slack, at_top.T, weights, curves))
    normal, values, own = _climb(paths, *path, points, normal, used, *known)
    points, normal, values = points[own], normal[own], values[:, own]
    start, was, active = at_top[:, points], level[points], np.arange(len(points))
    weights, curves = weights[points], curves[points]
    for _ in range(_ROUNDS):
        now, reached = search(OnPlanes(*values[:, active])), values[:, active]
        far = np.abs(now - was - _risen(weights, curves, reached - start)) > _EXACT * np.abs(now)
        active, start, was = active[far], reached[:, far], now[far]
        if not active.size:
            break
        weights, curves = _derivatives(search, start)
        wide = np.full((2, len(active)), np.inf)
        normal[active], values[:, active], _own = _climb(
            paths, *path, points[active], normal[active], used, was, *wide, start.T.copy(),
            weights, curves,
        )  # fmt: skip
    return points, normal, values


def _risen(weights: Array, curves: Array, change: Array) -> Array:
    """Return the rise (n,) of a criterion from its derivatives and a change (m, n) of values."""
    slopes = weights + np.einsum("nkm,mn->nk", curves, change) / 2
    return np.asarray((slopes.T * change).sum(axis=0))


def _sizes(below: Array) -> Array:
    """Return the largest differences (m, n) of values from their means over circles of planes."""
    most = below.max(axis=2)
    most[1::3] = most[1::3] / 2 - (below[1::3] / 2 - below[2::3]).min(axis=2)
    return most.astype(float)


def _used(kinds: list[Array], search: Value) -> Bools:
    """Return which values on planes (n_kinds, 3) a criterion reads."""
    size = np.repeat([max(own.max(), -own.min(), 1e-100) for own in kinds], 3)
    values = np.array([1.0, -1.0, 0.1, 10.0]) * size[:, None]
    before, used = search(OnPlanes(*values)), np.empty(len(size), dtype=bool)
    for k in range(len(size)):
        moved = values.copy()
        moved[k] += size[k]
        used[k] = (search(OnPlanes(*moved)) != before).any()
    return used.reshape(-1, 3)


def _derivatives(search: Value, values: Array) -> tuple[Array, Array]:
    """Return first and second derivatives (n, m), (n, m, m) of a criterion by values (m, n)."""
    count = len(values)
    h = _DIFFERENCE * np.abs(values) + 1e-6 * np.abs(values).max(axis=0) + 1e-100
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
