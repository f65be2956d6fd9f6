"""How long an increment takes: as long as those of the runs that the catalogue knows.

seconds = c unknowns^p increments is fitted to past runs of the same scene. ``cpu_seconds`` and
``increments`` of a run both include what it shares with other runs of its path, so that their ratio
is that of the run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from studies.definition.vocabulary import OK
from studies.storage.store import Store

_FIGURES = ("degrees_of_freedom", "increments", "cpu_seconds")
_PAST = 1000
"""Most past runs that count, the latest ones."""
_ENOUGH = 8
"""Fewest past runs that a fit is made of."""
_RATE, _AT, _EXPONENT = 15e-6, 14_000, 1.15
"""Measured: seconds an unknown and increment at so many unknowns, and p."""
_DOUBT = 0.2
"""Doubt of p, which matters as far as a study has other unknowns than the runs known."""
_WIDE = 3.0
"""Factor either way where no runs are known; 45 runs of one mesh differ by 1.5 either way."""


@dataclass(frozen=True, slots=True)
class Pace:
    """Seconds of an increment: ``rate * unknowns ** exponent``.

    Attributes
    ----------
    low, high : factors of what one of six runs takes less than, and one of six more than
    known_at : unknowns of the runs that it comes from
    basis : where it comes from, in words
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
    """Return the pace of the past runs of a scene; a measured one where they are too few."""
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
    """Return the pace by least squares of logarithms, without what is far off.

    Runs of one mesh tell nothing of the exponent: it is drawn to the usual one, as much as by one
    doubt of it beside the usual scatter of runs (0.4).
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
