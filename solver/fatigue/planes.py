"""The critical plane: where a function of what acts on planes is largest.

1. A scan of planes over the hemisphere, the same for all points, on simplified paths, gives bounds.
   Normal components and the amplitude of shear fall from a maximum no faster than cos(2 angle):
   along a great circle a normal component is such a wave, and the amplitude of shear R satisfies
   R'' >= -4 R. So the plane of a scan next to the largest maximum is smaller by a known share at
   most, and all others are dropped.
2. Newton's method from those that are better than their neighbours
   (`solver.fatigue.kernels.climb`). Amplitude and maximum are the largest of functions that are
   smooth in the normal, so that a maximum over planes is one of a smooth function. The criterion is
   taken as quadratic in what acts on a plane, and again at the plane found if it is not.
3. The best of these planes; of planes with equal values the one with the largest second value.

A criterion that is zero on closed planes has no slope there. Where it is zero on planes that may be
the worst, 2 also starts from the planes of the largest principal stress at instants.

A criterion must be finite, and must not fall where a value of what acts on a plane rises.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from solver.errors import ModelError
from solver.fatigue.paths import Paths
from solver.late import late
from solver.tensors import _PLACES
from solver.typing import Array, Bools, Ints

_simplified, _scan, _resolve, _climb = late(
    "fatigue.kernels", "simplified", "scan", "resolve", "climb"
)

_PLANES = 216
"""Number of planes in a scan; neighbours are 9 degrees apart."""
_NEIGHBOURS = 3
"""Newton's method starts at planes that are better than so many neighbours."""
_FALLS = 2 * np.sin(0.136) ** 2
"""Share by which a wave falls from its largest value within the largest angle from a plane of the
scan."""
_SIMPLE = 0.02
"""Distance of instants that the scan leaves out, over the size of the path."""
_ROUNDED = 1e-6
"""Rounding of the scan in single precision, over the largest stress."""
_DIFFERENCE = 1e-3
"""Relative change for the derivatives of a criterion by what acts on a plane: those of a product of
two are exact, and rounding matters little."""
_ROUNDS, _EXACT = 5, 1e-11
"""Largest number of times that the criterion is taken as quadratic, and the relative difference
from it at which it is."""
_FALLING = 1e-6
"""Largest fall of a criterion with a value, over its largest change, that is rounding."""
_SAME = 1e-9
"""Relative difference of values that are equal."""
_FULL = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])
"""Components of a tensor as a matrix."""
_AT_ONCE = 300
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
_AROUND = np.argsort(-np.abs(_NORMALS @ _NORMALS.T), axis=1)[:, 1:_NEIGHBOURS].T


def critical_planes(paths: Paths, search: Value, value: Value | None = None) -> Critical:
    """Return the planes on which ``search`` is largest; of equal ones those of ``value``.

    Amplitudes of shear that neither of the two reads are not computed: they are 0.

    Raises
    ------
    ModelError
        if ``search`` is not finite, or falls where a value of what acts on a plane rises
    """
    value = value or search
    used = _used(paths.known, search) | _used(paths.known, value)
    used = used[: 1 + used[1:].any()]
    each = []
    for k in range(0, len(paths), _AT_ONCE):
        kinds = [own[k : k + _AT_ONCE] for own in paths.known[: len(used)]]
        some = np.stack(kinds, axis=1).swapaxes(2, 3)
        each.append(_critical(np.ascontiguousarray(some), used, search, value))
    normals, ons = zip(*each, strict=True)
    return Critical(np.concatenate(normals), OnPlanes(*map(np.concatenate, zip(*ons, strict=True))))


def _axes(paths: Array) -> Array:
    """Return axes (n, 3, 3), in columns, that turn with the path of stress.

    They are the principal axes of the sum of its squares; signs follow from its mean in time.
    """
    x = paths[:, 0]
    products = x @ x.swapaxes(1, 2)
    _, axes = np.linalg.eigh(products[:, _FULL[:, :, None], _FULL].sum(axis=2))
    late = (x @ np.arange(1.0, x.shape[2] + 1))[:, _FULL]
    late = axes.swapaxes(1, 2) @ late @ axes
    axes[:, :, 1:] *= np.where(late[:, :1, 1:] < 0, -1.0, 1.0)
    return np.asarray(axes)


def _critical(given: Array, used: Bools, search: Value, value: Value) -> Critical:
    axes, circles = _axes(given), used[:, 0].astype(np.int64)
    i, j = np.array(_PLACES).T
    first, second = axes[:, i].swapaxes(1, 2), axes[:, j].swapaxes(1, 2)  # (n, axis, component)
    turn = first[:, i] * second[:, j] + np.where(i == j, 0.0, 1.0) * second[:, i] * first[:, j]
    paths = np.ascontiguousarray(turn[:, None] @ given)
    every = np.arange(len(paths))
    low, high, sizes = _bounds(paths, circles)
    found, most = search(OnPlanes(*low)), search(OnPlanes(*high))
    top = found.argmax(axis=1)
    values = _resolve(paths, every, _NORMALS[top], circles)
    weights, curves = _derivatives(search, values, used)
    _check(search, values, weights)
    falls = (weights + np.einsum("nkm,mn->nk", np.abs(curves), sizes) / 2).T * sizes
    falls = _FALLS * falls.sum(axis=0)
    least = search(OnPlanes(*values)) - falls
    most[every, top] = np.inf  # single precision may round by more than the maximum falls
    points, starts = map(np.ascontiguousarray, np.nonzero(most > least[:, None]))
    values = _resolve(paths, points, _NORMALS[starts], circles)
    exact = search(OnPlanes(*values))
    found[:] = -np.inf
    found[points, starts] = exact
    least, top = found.max(axis=1) - falls, found.argmax(axis=1)
    near = (exact >= least[points]) & ((exact != 0.0) | (starts == top[points]))
    for beside in _AROUND:
        near &= exact >= found[points, beside[starts]]
    normal = _NORMALS[starts]
    flat = np.unique(points[exact == 0.0])
    flat = flat[search(OnPlanes(*(np.stack(high).max(axis=2) + _FALLS * sizes)[:, flat])) > 0.0]
    if flat.size:
        more, opened = _opened(paths, flat)
        acting = _resolve(paths, more, opened, circles)
        also = search(OnPlanes(*acting))
        course = also.reshape(len(flat), -1)
        before, after = np.roll(course, 1, axis=1), np.roll(course, -1, axis=1)
        near = np.append(near, (course > 0) & (course >= np.maximum(before, after)))
        points, exact = np.append(points, more), np.append(exact, also)
        normal, values = np.append(normal, opened, axis=0), np.append(values, acting, axis=1)
    near = np.flatnonzero(near)
    near = near[np.lexsort((-exact[near], points[near]))]
    points = points[near]
    values = np.ascontiguousarray(values[:, near])
    normal, values = _climbed(paths, points, search, used, normal[near], values, falls[points])
    on, top = OnPlanes(*values), np.full(len(found), -np.inf)
    best = search(on)
    np.maximum.at(top, points, best)
    equal = best >= (top - _SAME * np.abs(top))[points]
    order = np.lexsort((np.where(equal, value(on), -np.inf), points))
    chosen = order[np.flatnonzero(np.diff(points[order], append=len(found)))]
    normal = (axes @ normal[chosen, :, None])[:, :, 0]
    last = 2 - (np.abs(normal[:, ::-1]) > _SAME).argmax(axis=1)  # the last component not zero
    normal *= np.sign(normal[np.arange(len(normal)), last])[:, None]
    return Critical(normal, OnPlanes(*(own[chosen] if own.size else own for own in on)))


def _opened(paths: Array, points: Ints) -> tuple[Ints, Array]:
    """Return the planes (n, 3) of the largest principal stress at all instants of some points."""
    full = paths[points, 0][:, _FULL].transpose(0, 3, 1, 2)
    normals = np.linalg.eigh(full)[1][..., 2]
    return np.repeat(points, normals.shape[1]), np.ascontiguousarray(normals.reshape(-1, 3))


def _check(search: Value, values: Array, weights: Array) -> None:
    """Refuse a criterion that is not finite, or that falls where a value rises.

    ``weights`` (n, m) are its derivatives by what acts on planes, ``values`` (m, n).
    """
    name = getattr(search, "__qualname__", type(search).__name__)
    found = search(OnPlanes(*values))
    if not (np.isfinite(found).all() and np.isfinite(weights).all()):
        allowed = "must be finite for all amplitudes from zero and all normal stresses"
        raise ModelError("criterion", name, allowed)
    changes = weights.T * np.abs(values)
    falling = (changes < -_FALLING * np.abs(changes).max(axis=0)).any(axis=1)
    if falling.any():
        rising = OnPlanes._fields[int(falling.argmax())]
        raise ModelError("criterion", name, f"must not fall where `{rising}` rises")


def _used(kinds: list[Array], search: Value) -> Bools:
    """Return which values on planes (n_kinds, 3) a criterion reads."""
    size = np.repeat([max(own.max(), -own.min(), 1e-100) for own in kinds], 3)
    read: set[str] = set()

    class Read(OnPlanes):
        def __getattribute__(self, name: str) -> Any:
            read.add(name)
            return super().__getattribute__(name)

        def __iter__(self) -> Iterator[Array]:
            read.update(OnPlanes._fields)
            return super().__iter__()

        def __getitem__(self, place: Any) -> Any:
            read.update(OnPlanes._fields)
            return super().__getitem__(place)

    search(Read(*size[:, None]))
    return np.reshape([name in read for name in OnPlanes._fields[: len(size)]], (-1, 3))


def _bounds(paths: Array, circles: Ints) -> tuple[list[Array], list[Array], Array]:
    """Return bounds (m, n, n_planes) of what acts on the planes of the scan; and sizes (m, n).

    A size is the largest difference of a value from its mean over a great circle of planes.
    """
    low: list[Array] = []
    high: list[Array] = []
    sizes: list[Array] = []
    for k, circle in enumerate(circles):
        made, counts, far, largest = _simplified(np.ascontiguousarray(paths[:, k]), _SIMPLE)
        shear, normal, half = _scan(made, counts, _NORMALS, circle)
        # instants that were left out, and single precision
        apart = (_SIMPLE * far + _ROUNDED * largest)[:, None]
        low += [shear[0], normal, half]
        high += [shear[1] + circle * apart, normal + apart, half + apart]
        most, widest = normal.max(axis=1), half.max(axis=1)
        sizes += [shear[0].max(axis=1), most / 2 - (normal / 2 - half).min(axis=1), widest]
    return low, high, np.stack(sizes)


def _climbed(
    paths: Array,
    points: Ints,
    search: Value,
    used: Bools,
    normal: Array,
    values: Array,
    falls: Array,
) -> tuple[Array, Array]:
    """Return the planes (n, 3) of the maxima near some planes at points (n,), and what acts.

    ``values`` (m, n) are what acts on those planes; the arrays given are overwritten.
    """
    active, circles = np.arange(len(points)), used[:, 0].astype(np.int64)
    for _ in range(_ROUNDS):
        before = np.ascontiguousarray(values[:, active])
        was = search(OnPlanes(*before))
        weights, curves = _derivatives(search, before, used)
        reached, after = _climb(
            paths, points[active], normal[active], circles, was, falls[active], weights, curves
        )
        change = (after - before).T
        rise = ((weights + np.einsum("nkm,nm->nk", curves, change) / 2) * change).sum(axis=1)
        now = search(OnPlanes(*after))
        higher = now >= was - _EXACT * np.abs(was)
        normal[active[higher]], values[:, active[higher]] = reached[higher], after[:, higher]
        active = active[higher & (np.abs(now - was - rise) > _EXACT * np.abs(now))]
        if not active.size:
            break
    return normal, values


def _derivatives(search: Value, values: Array, used: Bools) -> tuple[Array, Array]:
    """Return first and second derivatives (n, m), (n, m, m) of a criterion by values (m, n).

    They are zero by values that it does not use. A step is a share of a value and of the largest of
    its kind; no amplitude becomes negative.
    """
    count = len(values)
    h = np.abs(values)
    h = _DIFFERENCE * h + 1e-6 * np.repeat(h.reshape(-1, 3, h.shape[1]).max(axis=1), 3, axis=0)
    h += 1e-100
    values = values.copy()
    for k in (0, 2):
        values[k::3] = np.maximum(values[k::3], 2 * h[k::3])
    each = np.zeros((count, count, 4, values.shape[1]))
    read = np.flatnonzero(used).tolist()
    for i, k in enumerate(read):
        for m in read[: i + 1]:
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
