"""One measured run: what it cost, what came out, how far that is from the truth."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np

T = TypeVar("T")

REPEATS = 3
SHORT = 6.0
"""Runs below this many CPU seconds are repeated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """A point of a work-precision plot.

    ``cpu`` is the median of ``repeats`` runs [s], ``spread`` their range over the median,
    ``values`` what came out and ``errors`` its distance from the reference, both by name; ``size``
    that of the element or increment that the series varies, where it has one.
    """

    problem: str
    series: str
    setting: str
    unknowns: int
    cpu: float
    spread: float
    repeats: int
    values: Mapping[str, float]
    errors: Mapping[str, float] = field(default_factory=dict)
    size: float = float("nan")


@dataclass(frozen=True, slots=True)
class Timed(Generic[T]):
    """A result and the CPU time it took."""

    result: T
    cpu: float
    spread: float
    repeats: int


def timed(function: Callable[[int], T], repeats: int = REPEATS) -> Timed[T]:
    """Return ``function(repeat)`` and its median CPU time; long runs are not repeated."""
    seconds = []
    for repeat in range(repeats):
        started = time.process_time()
        result = function(repeat)
        seconds.append(time.process_time() - started)
        if seconds[0] > SHORT:
            break
    middle = float(np.median(seconds))
    return Timed(result, middle, (max(seconds) - min(seconds)) / middle, len(seconds))
