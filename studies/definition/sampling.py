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
from collections.abc import Callable, Iterator
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from annotated_types import Interval
from pydantic import PlainValidator, ValidationInfo

from solver.parameters import is_number
from solver.typing import Array
from studies.definition.identity import canonical
from studies.definition.parameters import Parameter
from studies.definition.schema import MAXIMUM_RUNS, Context, Range, StudyTable, Whole, known_name
from studies.errors import Mistakes, StudyError

METHOD = "method"
_BITS = 40
"""Number of times that an interval of a Latin hypercube can be halved."""
_TIRED = 64
"""Points of the sequence drawn for each one wanted, after which the rest are all repetitions."""


class _Values(NamedTuple):
    """Makes a value of a number from 0 to 1; ``different`` is how many, 0 if endless."""

    value: Callable[[float], Any]
    different: int = 0


def _scales(content: Any, info: ValidationInfo) -> dict[str, _Values]:
    """Return the range, or the words, of each parameter in the order of the scene."""
    if not isinstance(content, dict) or not content:
        raise StudyError("", content, "must be a table: a range for each parameter")
    known, found, wrong = Context.of(info).known, {}, Mistakes()
    for name, given in content.items():
        with wrong.at(str(name)):
            known_name(name, known, given)
            found[name] = _scale(given, known[name])
    wrong.report()
    return {name: found[name] for name in known if name in found}  # that of JSON does not count


def _scale(content: Any, parameter: Parameter) -> _Values:
    if isinstance(content, list | tuple):
        content = [parameter.in_own_unit(each, f"[{k}]") for k, each in enumerate(content)]
        if content and not any(map(is_number, content)):
            return _words(content, parameter)
    ends = Range.read(content, parameter)
    if not parameter.whole:
        return _Values(ends.inside)
    # all integers have the same share, or ratio
    start, stop, longer = ends.start, ends.stop, ends.model_copy(update={"stop": ends.stop + 1})
    return _Values(lambda share: min(int(longer.inside(share)), stop), int(stop - start) + 1)


def _words(content: list[Any], parameter: Parameter) -> _Values:
    values: list[Any] = []
    for k, given in enumerate(content):
        value = parameter.normalise(given, own := f"[{k}]")
        if not parameter.in_range(value):
            raise parameter.refusal(own, value)
        if value in values:
            raise StudyError(own, value, "is there already: keep one")
        values.append(value)
    return _Values(lambda share: values[int(share * len(values))], len(values))


class Sample(StudyTable):
    """Points that fill ranges of parameters evenly.

    Attributes
    ----------
    method : kind of sequence
    num : number of points
    ranges : of each parameter ``[lowest, highest]``, a table ``{start, stop, spacing}``, or words
    seed : another one gives other points
    """

    method: Literal["sobol", "lhs", "halton"]
    num: Annotated[Whole, Interval(ge=1, le=MAXIMUM_RUNS)]
    ranges: Annotated[
        dict[str, Any],
        PlainValidator(_scales, json_schema_input_type=dict[str, Range | list[Any]]),
    ]
    seed: Annotated[Whole, Interval(ge=0, le=2**32 - 1)] = 0

    @property
    def points(self) -> list[dict[str, Any]]:
        """The points, no two of them equal."""
        scales, num = self.ranges.values(), self.num
        different = math.prod(scale.different for scale in scales)
        if all(scale.different for scale in scales) and num > different:
            allowed = f"at most {different}, which are all combinations: sweep them as axes"
            raise StudyError("num", num, allowed)
        found: dict[str, dict[str, Any]] = {}
        sequence = _sequence(self.method, len(scales), num, self.seed)
        for row in itertools.islice(sequence, _TIRED * num):
            values = (scale.value(share) for scale, share in zip(scales, row, strict=True))
            point = dict(zip(self.ranges, values, strict=True))
            found.setdefault(canonical(point), point)
            if len(found) == num:
                return list(found.values())
        allowed = f"only {len(found)} different points were found: use fewer, or sweep them as axes"
        raise StudyError("num", num, allowed)


def _sequence(method: str, dimensions: int, num: int, seed: int) -> Iterator[list[float]]:
    """Yield the points of a sequence in the unit cube."""
    blocks = _hypercubes if method == "lhs" else _low_discrepancy
    for block in blocks(method, dimensions, num, seed):
        yield from block.tolist()


def _low_discrepancy(method: str, dimensions: int, num: int, seed: int) -> Iterator[Array]:
    """Yield blocks of a scrambled sequence."""
    from scipy.stats import qmc  # takes half a second to load

    make = {"sobol": qmc.Sobol, "halton": qmc.Halton}[method]
    engine = make(dimensions, scramble=True, rng=seed)
    size = 1 << (num - 1).bit_length()  # Sobol' points are balanced in powers of two
    yield engine.random(size)
    while True:
        yield engine.random(size)
        size *= 2


def _hypercubes(method: str, dimensions: int, num: int, seed: int) -> Iterator[Array]:
    """Yield a Latin hypercube, then the points that double it, again and again.

    A hypercube of n points has one in each of n intervals of each dimension, so that of 2 n
    intervals n are empty: in each dimension the new points take these in random order. Places are
    whole numbers, so that none is rounded into the next interval.
    """
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
