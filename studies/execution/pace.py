"""The time of an increment, from past runs in the catalogue.

seconds = c unknowns^p increments is fitted to past runs of the same scene. ``cpu_seconds`` and
``increments`` of a run both include the increments that it shares with other runs of its path, so
that their ratio is correct.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from studies.definition.vocabulary import OK
from studies.storage.store import Store

_FIGURES = ("degrees_of_freedom", "increments", "cpu_seconds")
_PAST = 1000
"""Largest number of past runs in the fit, the latest ones."""
_ENOUGH = 8
"""Smallest number of past runs for a fit."""
_RATE, _AT, _EXPONENT = 15e-6, 14_000, 1.15
"""Measured: seconds per unknown and increment, the number of unknowns at which, and p."""
_DOUBT = 0.2
"""Uncertainty of p; it matters for other numbers of unknowns than those of past runs."""
_WIDE = 3.0
"""Factor of the low and high estimates without past runs; 45 runs of one mesh differ by 1.5."""


@dataclass(frozen=True, slots=True)
class Pace:
    """Seconds of an increment: ``rate * unknowns ** exponent``.

    Attributes
    ----------
    low, high : factors for the 16 % and 84 % quantiles of past runs
    known_at : number of unknowns of the past runs
    basis : on which data it is based, as text
    """

    rate: float
    exponent: float
    low: float
    high: float
    known_at: float
    basis: str

    def seconds(self, unknowns: int, least: float, most: float) -> tuple[float, float, float]:
        """Return low, likely and high seconds of a path of `least` to `most` increments."""
        one = self.rate * unknowns**self.exponent
        doubt = math.exp(_DOUBT * abs(math.log(unknowns / self.known_at)))
        likely = one * math.sqrt(least * most)
        return one * least * self.low / doubt, likely, one * most * self.high * doubt


def pace_of(store: Store, scene: str) -> Pace:
    """Return the pace of past runs of a scene; if they are too few, one measured elsewhere."""
    found = store.catalogue.figures(scene, OK, _FIGURES, _PAST)
    past = np.array([row for row in found if None not in row and min(row) > 0], dtype=float)
    if len(past) < _ENOUGH:
        rate = _RATE * _AT ** (1 - _EXPONENT)
        basis = f"a pace measured elsewhere: fewer than {_ENOUGH} runs of {scene} are stored here"
        return Pace(rate, _EXPONENT, 1 / _WIDE, _WIDE, _AT, basis)
    basis = f"the pace of the last {len(past)} runs of {scene} stored here"
    unknowns, increments, seconds = past.T
    return _fitted(unknowns, increments, seconds, basis)


def _fitted(unknowns: np.ndarray, increments: np.ndarray, seconds: np.ndarray, basis: str) -> Pace:
    """Return the pace by least squares of logarithms, without outliers.

    Runs of one mesh do not determine the exponent. It is regularised towards the usual one, with
    the weight of its uncertainty relative to the usual scatter of runs (0.4).
    """
    x, y = np.log(unknowns), np.log(seconds / increments)
    kept = np.full(len(x), True)
    weight = (0.4 / _DOUBT) ** 2
    for _ in range(2):
        from_mean = x - x[kept].mean()
        product = (from_mean * (y - y[kept].mean()))[kept].sum()
        exponent = (product + weight * _EXPONENT) / ((from_mean[kept] ** 2).sum() + weight)
        off = y - exponent * x
        middle = np.median(off[kept])
        kept = np.abs(off - middle) <= 5 * np.median(np.abs(off - middle)) + 1e-12
    # the ratio of sums, not the mean of logarithms: a study is a sum of runs
    size = unknowns**exponent * increments
    rate = seconds[kept].sum() / size[kept].sum()
    low, high = np.quantile(seconds / size / rate, [0.16, 0.84])
    known_at = float(np.exp(x[kept].mean()))
    return Pace(float(rate), float(exponent), min(low, 1.0), max(high, 1.0), known_at, basis)
