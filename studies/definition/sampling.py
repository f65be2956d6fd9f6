"""Samples: points that fill the ranges of parameters evenly, the same ones for the same seed.

A sample is the beginning of a sequence of points in the unit cube that never ends. A longer sample
of the same seed therefore keeps the points of a shorter one. For ``sobol`` and ``halton`` the
sequence depends on nothing else. A Latin hypercube has one point in each of ``num`` equal intervals
of every parameter, so that it can only be doubled: the sequence of ``lhs`` begins with the odd
factor of ``num`` and is doubled again and again. Samples of 50, 100 and 200 points have one
sequence, those of 64 and 128 another one.

References
----------
Owen, A. B. (1998), Scrambling Sobol' and Niederreiter-Xing points, J. Complexity 14: the scrambled
sequences of `scipy.stats.qmc`. Sallaberry, C. J., Helton, J. C. and Hora, S. C. (2008), Extension
of Latin hypercube samples with correlated variables, Reliab. Eng. Syst. Saf. 93: doubling.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from solver.parameters import is_number
from studies.definition.identity import canonical
from studies.definition.parameters import Parameter
from studies.definition.spaced import SPACINGS, between, rounded
from studies.errors import StudyError, check_entries, nearest, one_of

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Block = NDArray[np.float64]

METHOD = "method"
METHODS = ("sobol", "lhs", "halton")
_KEYS = (METHOD, "num", "ranges", "seed")
_MOST_SEED = 2**32 - 1
_BITS = 40
"""Number of times that an interval of a Latin hypercube can be halved."""
_TIRED = 64
"""Points of the sequence drawn for each one wanted, after which the rest are all repetitions."""


class _Range(NamedTuple):
    """Makes a value of a number from 0 to 1; ``different`` tells of how many, 0 if endless."""

    value: Callable[[float], Any]
    different: int = 0


def sampled(
    field: str, content: Any, known: Mapping[str, Parameter], most: int
) -> list[dict[str, Any]]:
    """Return the points of a sample ``{method, num, ranges, seed}``, no two of them equal.

    Parameters
    ----------
    field : of the sample, for errors
    content : ``ranges`` has, for each parameter, ``[lowest, highest]``, a table ``{start, stop,
        spacing}``, or a list of words; ``seed`` is 0 if it is left out
    known : the parameters of the scene
    most : largest number of points

    Raises
    ------
    StudyError
        naming the entry, its value and what is allowed
    """
    if not isinstance(content, Mapping):
        allowed = "must be a table {method, num, ranges, seed}; a list of points is `points`"
        raise StudyError(field, content, allowed)
    check_entries(field, content, _KEYS)
    method, seed = content.get(METHOD), content.get("seed", 0)
    if not isinstance(method, str) or method not in METHODS:
        raise StudyError(f"{field}.{METHOD}", method, one_of(method, METHODS))
    num = _whole(f"{field}.num", content.get("num"), 1, most)
    _whole(f"{field}.seed", seed, 0, _MOST_SEED)
    ranges = content.get("ranges")
    if not isinstance(ranges, Mapping) or not ranges:
        raise StudyError(f"{field}.ranges", ranges, "must be a table: a range for each parameter")
    for name in ranges:
        if name not in known:
            allowed = "the scene has no such parameter" + nearest(name, known)
            raise StudyError(f"{field}.ranges.{name}", ranges[name], allowed)
    # the order of the scene: that of a table does not count in JSON
    names = [name for name in known if name in ranges]
    scales = [_range(f"{field}.ranges.{name}", ranges[name], known[name]) for name in names]
    if all(scale.different for scale in scales):
        different = math.prod(scale.different for scale in scales)
        if num > different:
            allowed = f"at most {different}, which are all combinations: sweep them as axes"
            raise StudyError(f"{field}.num", num, allowed)
    found: dict[str, dict[str, Any]] = {}
    for row in itertools.islice(_sequence(method, len(names), num, seed), _TIRED * num):
        values = (scale.value(share) for scale, share in zip(scales, row, strict=True))
        point = dict(zip(names, values, strict=True))
        found.setdefault(canonical(point), point)
        if len(found) == num:
            return list(found.values())
    allowed = f"only {len(found)} different points were found: use fewer, or sweep them as axes"
    raise StudyError(f"{field}.num", num, allowed)


def _range(field: str, content: Any, parameter: Parameter) -> _Range:
    """Return the range of a parameter."""
    listed = isinstance(content, list | tuple)
    if listed:
        content = [parameter.in_own_unit(value, f"{field}[{k}]") for k, value in enumerate(content)]
    if listed and content and not any(map(is_number, content)):
        values = [parameter.normalise(value, f"{field}[{k}]") for k, value in enumerate(content)]
        for k, value in enumerate(values):
            if not parameter.in_range(value):
                raise parameter.refusal(f"{field}[{k}]", value)
            if value in values[:k]:
                raise StudyError(f"{field}[{k}]", value, "is there already: keep one")
        return _Range(lambda share: values[int(share * len(values))], len(values))
    spacing: Any = "linear"
    if listed and len(content) == 2:
        ends = dict(zip(("start", "stop"), content, strict=True))
    elif isinstance(content, Mapping) and {"start", "stop"} <= content.keys():
        ends = {key: value for key, value in content.items() if key != "spacing"}
        spacing = content.get("spacing", "linear")
    else:
        ends = {}
    if len(ends) != 2:
        allowed = "must be [lowest, highest], {start, stop, spacing = linear or log}, or words"
        raise StudyError(field, content, allowed)
    if spacing not in SPACINGS:
        raise StudyError(f"{field}.spacing", spacing, one_of(spacing, SPACINGS))
    for key, value in ends.items():
        own = f"{field}.{key}" if isinstance(content, Mapping) else field
        ends[key] = parameter.number(value, own)
        if spacing == "log" and not ends[key] > 0:
            raise StudyError(own, value, "must be > 0 for spacing = log")
    start, stop = ends["start"], ends["stop"]
    if not start < stop:
        raise StudyError(field, content, "must begin with its lowest value")
    if not parameter.whole:
        return _Range(_spread(start, stop, spacing))
    whole = _spread(start, stop + 1, spacing)  # all integers have the same share, or ratio
    return _Range(lambda share: min(int(whole(share)), stop), stop - start + 1)


def _spread(start: float, stop: float, spacing: str) -> Callable[[float], float]:
    """Return what makes a number between the ends of a share of the way."""

    def value(share: float) -> float:
        return min(max(rounded(between(start, stop, spacing, share)), start), stop)

    return value


def _whole(field: str, value: Any, least: int, most: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise StudyError(field, value, f"must be an integer >= {least} and <= {most}")
    return value


def _sequence(method: str, dimensions: int, num: int, seed: int) -> Iterator[list[float]]:
    """Yield the points of a sequence in the unit cube."""
    blocks = _hypercubes if method == "lhs" else _low_discrepancy
    for block in blocks(method, dimensions, num, seed):
        yield from block.tolist()


def _low_discrepancy(method: str, dimensions: int, num: int, seed: int) -> Iterator[Block]:
    """Yield blocks of a scrambled sequence."""
    from scipy.stats import qmc  # takes half a second to load

    make = {"sobol": qmc.Sobol, "halton": qmc.Halton}[method]
    engine = make(dimensions, scramble=True, rng=seed)
    size = 1 << (num - 1).bit_length()  # Sobol' points are balanced in powers of two
    yield engine.random(size)
    while True:
        yield engine.random(size)
        size *= 2


def _hypercubes(method: str, dimensions: int, num: int, seed: int) -> Iterator[Block]:
    """Yield a Latin hypercube, then the points that double it, again and again.

    A hypercube of n points has one in each of n intervals of each dimension, so that of 2 n
    intervals n are empty: in each dimension the new points take these in random order. Places are
    whole numbers, so that none is rounded into the next interval.
    """
    import numpy as np

    del method
    random = np.random.default_rng(seed)
    size = odd = num // (num & -num)
    points = np.empty((0, dimensions), dtype=np.int64)
    for fine in range(_BITS, 0, -1):  # an interval has 2**fine places
        new = np.empty((size - len(points), dimensions), dtype=np.int64)
        for column, old in zip(new.T, points.T, strict=True):
            free = np.setdiff1d(np.arange(size), old >> fine)
            within = random.integers(0, 1 << fine, len(free))
            column[:] = (random.permutation(free) << fine) + within
        yield (new + 0.5) / (odd << _BITS)
        points = np.concatenate([points, new])
        size *= 2
