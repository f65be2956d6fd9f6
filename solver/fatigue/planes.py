"""The critical plane: where a function of what acts on planes is largest.

1. A scan of planes over the hemisphere, the same for all points, gives bounds of what acts.
   Normal components and the amplitude of shear fall from a maximum no faster than cos(2 angle):
   along a great circle a normal component is such a wave, and the amplitude of shear R satisfies
   R'' >= -4 R. So the plane of a scan next to the largest maximum is smaller by a known share at
   most, and all others are dropped.
2. Newton's method from those that are better than their neighbours. What acts is the largest of
   functions that are smooth in the normal, each of a few instants: those of the largest and the
   smallest normal component and those on the smallest circle. So a maximum over planes is one of
   such a function. A step is taken for given instants, which are then decided anew.
3. A path of many instants has several maxima close together. Around the highest one planes on rings
   are decided, and where others decide, 2 goes on from the best of them.
4. The best of these planes; of planes with equal values the one with the largest second value.

A criterion that is zero on closed planes has no slope there. Where it is zero on planes that may be
the worst, 2 also starts from the planes of the largest principal stress at instants.

A criterion must be finite, and must not fall where a value of what acts on a plane rises.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, cast

import numpy as np

from solver.errors import ModelError
from solver.fatigue.paths import Paths
from solver.late import late
from solver.tensors import _PLACES
from solver.typing import Array, Bools, Ints

_ends, _scan, _resolve, _beside, _uphill, _moved = late(
    "fatigue.kernels", "ends", "scan", "resolve", "beside", "uphill", "moved"
)

_PLANES = 216
"""Number of planes in a scan; neighbours are 9 degrees apart."""
_NEIGHBOURS = 2
"""Newton's method starts at planes that are better than so many neighbours."""
_FALLS = 2 * np.sin(0.136) ** 2
"""Share by which a wave falls from its largest value within the largest angle from a plane of the
scan."""
_ROUNDED = 1e-6
"""Rounding of the scan in single precision, over the largest component."""
_CLIMBS, _AHEAD = 20, 2.0
"""Largest number of steps, and factor on the gain of one that all further ones may have."""
_GAIN, _LITTLE = 1e-13, 1e-13
"""Relative gain of a step after which the next one is rounding; relative difference that is."""
_TURNS, _TRIED = 6, 4
"""Number of times that planes around the highest maximum are decided, and of the best of these that
are climbed from."""
_RINGS = np.sqrt([[2 * 2e-2], [2 * 2e-3], [2 * 2e-4]]) * np.exp(np.pi / 6j * np.arange(1, 13, 2))
"""Places around a maximum, in the complex plane: by its curvature they are smaller by 2e-2 of it,
and by less."""
_CLOSE = 1e-5
"""Relative difference of maxima that are followed, as what is left out may decide between them."""
_STEP = 2e-4
"""Relative change of what acts on a plane for the slope of a criterion by it."""
_RISE = 1e-3
"""Relative rise of what acts on a plane, with which a criterion must not fall."""
_SAME = 1e-9
"""Relative difference of values that are equal."""
_STRAIGHT = 1e-14
"""Distance of instants from a line over the length of a path that is a part of it."""
_FULL = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])
"""Components of a tensor as a matrix."""
_TOGETHER = 600
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
_AROUND = np.argsort(-np.abs(_NORMALS @ _NORMALS.T), axis=1)[:, 1 : 1 + _NEIGHBOURS].T


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
    normal, values = np.empty((len(paths), 3)), np.zeros((used.size, len(paths)))
    for k in range(0, len(paths), _TOGETHER):
        given = np.stack([own[k : k + _TOGETHER] for own in paths.known[: len(used)]], axis=1)
        ends = _ends(given, _STRAIGHT)
        straight = ends[:, 0] != ends[:, 1]
        short = np.take_along_axis(given[straight], ends[straight, None, :, None], axis=2)
        for group, cycle in ((straight, short), (~straight, given[~straight])):
            if len(cycle):
                at, some = k + np.flatnonzero(group), cycle.swapaxes(2, 3)
                normal[at], values[:, at] = _critical(some, used, search, value)
    return Critical(normal, OnPlanes(*values))


def _axes(paths: Array) -> Array:
    """Return axes (n, 3, 3), in columns, that turn with the path of stress.

    They are the principal axes of the sum of its squares; signs follow from its mean in time.
    """
    x = paths[:, 0]
    products = x @ x.swapaxes(1, 2)
    _, axes = np.linalg.eigh(products[:, _FULL[:, :, None], _FULL].sum(axis=2))
    mean = (x @ np.arange(1.0, x.shape[2] + 1))[:, _FULL]
    mean = axes.swapaxes(1, 2) @ mean @ axes
    axes[:, :, 1:] *= np.where(mean[:, :1, 1:] < 0, -1.0, 1.0)
    return np.asarray(axes)


def _critical(given: Array, used: Bools, search: Value, value: Value) -> tuple[Array, Array]:
    """Return normals (n, 3), and what acts on the planes (m, n)."""
    axes = _axes(given)
    i, j = np.array(_PLACES).T
    first, second = axes[:, i].swapaxes(1, 2), axes[:, j].swapaxes(1, 2)  # (n, axis, component)
    turn = first[:, i] * second[:, j] + np.where(i == j, 0.0, 1.0) * second[:, i] * first[:, j]
    paths = np.ascontiguousarray(turn[:, None] @ given)
    cycle = _Ascent(paths, np.flatnonzero(used), search)
    points, normal, falls, most = _starts(cycle)
    found = cycle.climbed(points, normal, -np.inf, falls)
    found = found.with_(cycle.climbed(*cycle.crossed(found), cycle.highest(found)))
    top = cycle.highest(found)
    points, planes = np.nonzero(most > top[:, None])
    higher = cycle.resolved(points, _NORMALS[planes])[1] > top[points]
    more = cycle.climbed(points[higher], _NORMALS[planes[higher]], top)
    found = more = found.with_(more)
    for _ in range(_TURNS):
        more = cycle.around(more)
        if not more.points.size:
            break
        found = found.with_(more)
    top = cycle.highest(found)
    equal = found.best >= (top - _SAME * np.abs(top))[found.points]
    chosen = _last(found.points, np.where(equal, value(OnPlanes(*found.values.T)), -np.inf))
    normal = (axes @ found.normal[chosen, :, None])[:, :, 0]
    last = 2 - (np.abs(normal[:, ::-1]) > _SAME).argmax(axis=1)  # the last component not zero
    return normal * np.sign(normal[np.arange(len(normal)), last])[:, None], found.values[chosen].T


def _last(points: Ints, value: Array) -> Ints:
    """Return the place of the largest value of each point."""
    order = np.lexsort((value, points))
    return order[np.flatnonzero(np.diff(points[order], append=-1))]


class _Planes(NamedTuple):
    """Planes and what is known of them.

    Attributes
    ----------
    points : (n,), in any order
    normal : (n, 3)
    values : what acts on them (n, m)
    best : the criterion (n,)
    ways : (n, 2, 3); along each the criterion falls by half the square of the distance
    active : the instants that decide (n, n_kinds, 5)
    """

    points: Ints
    normal: Array
    values: Array
    best: Array
    ways: Array
    active: Ints

    def at(self, place: Any) -> _Planes:
        """Return some of them."""
        return _Planes(*(own[place] for own in cast("tuple[Any, ...]", self)))

    def with_(self, more: _Planes) -> _Planes:
        """Return these and others."""
        pairs = cast("Iterator[tuple[Any, Any]]", zip(self, more, strict=True))
        return _Planes(*(cast("Any", np.concatenate(pair)) for pair in pairs))


class _Ascent(NamedTuple):
    """Paths (n_points, n_kinds, 6, n_instants), the values that the criterion reads, and it."""

    paths: Array
    read: Ints
    search: Value

    @property
    def circles(self) -> Ints:
        """Whether the amplitude of shear of a kind is needed (n_kinds,)."""
        return np.isin(np.arange(self.paths.shape[1]) * 3, self.read).astype(np.int64)

    def resolved(
        self, points: Ints, normal: Array, near: Ints | int = 0
    ) -> tuple[Array, Array, Ints]:
        """Return what acts on planes (m, n), the criterion (n,), and the instants that decide."""
        active = np.zeros((len(points), self.paths.shape[1], 5), dtype=np.int64)
        active[:] = near
        values = _resolve(self.paths, np.ascontiguousarray(points), normal, self.circles, active)
        return values, self.search(OnPlanes(*values)), active

    def newton(self, points: Ints, normal: Array, active: Ints) -> tuple[Array, ...]:
        """Return the criterion (n,), step (n, 3), gain (n,) and ways (n, 2, 3) for instants."""
        values, slopes, tangents = _beside(self.paths, points, normal, active)
        f, slope = self.search(OnPlanes(*values)), np.zeros((len(points), 2))
        for k in self.read:
            low, high = values[:, :, 0].copy(), values[:, :, 0].copy()
            low[k], high[k] = low[k] - _STEP * np.abs(low[k]), high[k] + _STEP * np.abs(high[k])
            change = self.search(OnPlanes(*high)) - self.search(OnPlanes(*low))
            wide = high[k] - low[k]
            slope += slopes[k] * (change / np.where(wide > 0.0, wide, np.inf))[:, None]
        return f[:, 0], *_uphill(f, slope, tangents)

    def highest(self, found: _Planes) -> Array:
        """Return the largest value of each point."""
        top = np.full(len(self.paths), -np.inf)
        np.maximum.at(top, found.points, found.best)
        return top

    def climbed(
        self, points: Ints, normal: Array, top: Array | float, falls: Array | float = np.inf
    ) -> _Planes:
        """Return the maxima near planes that may be the highest of a point, others as they are.

        Parameters
        ----------
        top : highest values of the points (n_points,) that are known already
        falls : only planes are climbed from that are lower than the highest by at most so much
        """
        values, best, active = self.resolved(points, normal)
        ways = np.zeros((len(points), 2, 3))
        found = _Planes(points, normal.copy(), values.T.copy(), best, ways, active)
        at = np.flatnonzero(best >= (self.highest(found) - falls)[points])
        top, share = top + np.zeros(len(self.paths)), np.ones(len(points))
        for _ in range(_CLIMBS):
            own = points[at]
            _, step, gain, ways[at] = self.newton(own, found.normal[at], active[at])
            trial = _moved(found.normal[at], step * share[at, None])
            values, reached, instants = self.resolved(own, trial, active[at])
            up = reached >= best[at] - _LITTLE * np.abs(best[at])
            same = (instants == active[at]).all(axis=(1, 2))
            share[at] = np.where(up, 1.0, share[at] / 4)
            done = np.where(up, same & (gain <= _GAIN * np.abs(reached)), share[at] < 0.01)
            for whole, part in zip(found[1:4], (trial, values.T, reached), strict=True):
                whole[at[up]] = part[up]
            active[at[up]] = instants[up]
            np.maximum.at(top, own, reached)
            least = (top - _CLOSE * np.abs(top))[own]
            at = at[~(done | (up & (reached + _AHEAD * gain < least)))]
            if not at.size:
                break
        return found

    def crossed(self, found: _Planes) -> tuple[Ints, Array]:
        """Return the planes across the shear on the highest ones: two instants shear them alike."""
        points, normal, _, _, _, active = found.at(_last(found.points, found.best))
        x, k = self.paths, int(self.circles.argmax())
        shear = (x[points, k, :, active[:, k, 3]] - x[points, k, :, active[:, k, 2]])[:, _FULL]
        across = (shear @ normal[:, :, None])[:, :, 0]
        across -= (across * normal).sum(axis=1)[:, None] * normal
        size = np.sqrt((across**2).sum(axis=1))
        return points[size > 0.0], across[size > 0.0] / size[size > 0.0, None]

    def around(self, found: _Planes) -> _Planes:
        """Return higher maxima close to the highest ones."""
        found = found.at(np.lexsort((found.best, found.points)))
        apart = np.diff(found.best, append=0.0) > _SAME * np.abs(found.best)
        top = self.highest(found)[found.points]
        last = np.diff(found.points, append=-1) != 0
        found = found.at((apart | last) & (found.best >= top - _CLOSE * np.abs(top)))
        rings = np.stack([_RINGS.real, _RINGS.imag], axis=-1).reshape(-1, 2)
        far = np.sqrt(np.abs(found.best))[:, None, None] * (rings @ found.ways)
        points, normal, _, best, _, active = found.at(np.repeat(np.arange(len(far)), len(rings)))
        normal = _moved(normal, far.reshape(-1, 3))
        _, _, others = self.resolved(points, normal, active)
        at = np.flatnonzero((others != active).any(axis=(1, 2)))
        f, step, gain, _ = self.newton(points[at], normal[at], others[at])
        normal[at], expected = _moved(normal[at], step), np.full(len(points), -np.inf)
        expected[at] = f + gain
        k = np.argsort(-expected.reshape(-1, len(rings)), axis=1)[:, :_TRIED]
        k = (k + len(rings) * np.arange(len(k))[:, None]).ravel()
        least = best + 10 * _LITTLE * np.abs(best)
        k = k[expected[k] > least[k]]
        more = self.climbed(points[k], normal[k], self.highest(found))
        return more.at(more.best > least[k])


def _starts(cycle: _Ascent) -> tuple[Ints, Array, Array, Array]:
    """Return the planes from which maxima are climbed: points (n,) and normals (n, 3).

    And by how much these may be lower than the highest of a point (n_points,), and the most that
    planes of the scan have (n_points, n_planes).
    """
    search, paths = cycle.search, cycle.paths
    low, high, sizes = _bounds(paths, cycle.circles)
    least, most = search(OnPlanes(*low)), search(OnPlanes(*high))
    every, top = np.arange(len(least)), least.argmax(axis=1)
    values = low[:, every, top]
    _check(cycle, values, least, most)
    values -= _FALLS * sizes
    for k in (0, 2):
        values[k::3] = np.maximum(values[k::3], 0.0)
    floor, middle = search(OnPlanes(*values)), least + most
    near = (most >= floor[:, None]) & (middle != 0.0)
    for beside in _AROUND:
        near &= middle >= middle[:, beside]
    near[every, top] = True
    points, planes = np.nonzero(near)
    normal = _NORMALS[planes]
    flat = np.flatnonzero((floor <= 0.0) & (least == 0.0).any(axis=1))
    flat = flat[search(OnPlanes(*(high.max(axis=2) + _FALLS * sizes)[:, flat])) > 0.0]
    if flat.size:  # the planes of the largest principal stress at all instants
        full = paths[flat, 0][:, _FULL].transpose(0, 3, 1, 2)
        opened = np.ascontiguousarray(np.linalg.eigh(full)[1][..., 2].reshape(-1, 3))
        more = np.repeat(flat, paths.shape[3])
        course = cycle.resolved(more, opened)[1].reshape(len(flat), -1)
        around = np.maximum(np.roll(course, 1, axis=1), np.roll(course, -1, axis=1))
        keep = ((course > 0.0) & (course >= around)).ravel()
        points, normal = np.append(points, more[keep]), np.append(normal, opened[keep], axis=0)
    return np.ascontiguousarray(points), normal, least.max(axis=1) - floor, most


def _check(cycle: _Ascent, values: Array, *found: Array) -> None:
    """Refuse a criterion that is not finite, or falls where what acts on planes rises."""
    search = cycle.search
    owner = getattr(search, "__self__", search)
    name = getattr(owner, "__qualname__", type(owner).__name__)
    if not all(np.isfinite(own).all() for own in found):
        allowed = "must be finite for all amplitudes from zero and all normal stresses"
        raise ModelError("criterion", name, allowed)
    before = search(OnPlanes(*values))
    for k in cycle.read:
        more = values.copy()
        more[k] += _RISE * np.abs(more[k])
        if (search(OnPlanes(*more)) < before - _SAME * np.abs(before)).any():
            allowed = f"must not fall where `{OnPlanes._fields[k]}` rises"
            raise ModelError("criterion", name, allowed)


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


def _bounds(paths: Array, circles: Ints) -> tuple[Array, Array, Array]:
    """Return bounds (m, n, n_planes) of what acts on the planes of the scan; and sizes (m, n).

    A size is the largest difference of a value from its mean over a great circle of planes.
    """
    bounds, sizes = np.empty((2, 3 * len(circles), len(paths), len(_NORMALS))), []
    for k, circle in enumerate(circles):
        size = np.maximum(np.abs(paths[:, k]).max(axis=(1, 2)), 1e-300)[:, None]
        x = (paths[:, k] / size[:, :, None]).swapaxes(1, 2).astype(np.float32, order="C")
        shear, (normal, half) = (size * each for each in _scan(x, _NORMALS, circle))
        apart = _ROUNDED * size
        bounds[0, 3 * k : 3 * k + 3] = shear[0], normal, half
        bounds[1, 3 * k : 3 * k + 3] = shear[1] + circle * apart, normal + apart, half + apart
        most, widest = normal.max(axis=1), half.max(axis=1)
        sizes += [shear[0].max(axis=1), most / 2 - (normal / 2 - half).min(axis=1), widest]
    return *bounds, np.stack(sizes)
