"""A Gaussian process through the numbers of runs, with its leave-one-out error in closed form.

The covariance is Matern 5/2 with a length for each parameter, the mean a constant that is found
with the numbers (ordinary kriging). With ``Q = K^-1 - K^-1 1 1^T K^-1 / (1^T K^-1 1)`` the number
of run ``i`` misses what all other runs predict by ``(Q y)_i / Q_ii``, with the variance
``s^2 / Q_ii``. The lengths are the most likely ones; ``s^2`` is such that these misses have the
variance that they are said to have. Runs at corners of the hull of all do not count: there the
others extrapolate, which is no prediction that anybody is given.

References
----------
Rasmussen, C. E. and Williams, C. K. I. (2006), Gaussian Processes for Machine Learning, eqs. 4.17
(Matern), 5.8 (likelihood). Dubrule, O. (1983), Cross validation of kriging in a unique
neighborhood, Math. Geol. 15, 687: the misses in closed form, the mean found again each time.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import linprog, minimize
from scipy.spatial import ConvexHull, QhullError

Array = NDArray[np.float64]

_SHORTEST, _LONGEST = 0.05, 20.0
"""Smallest and largest length, as a multiple of the range of a parameter."""
_ROUGHNESS = (1e-7, 1e-2)
"""Variance of what no smooth function explains, as a multiple of the whole: smallest, largest."""
_STARTS = (0.3, 1.5)
_HULL = 6
"""Largest number of parameters of which corners are told: of more almost all runs are corners, and
the sides of their hull are more than the memory holds."""
_FITTED = 200
"""Largest number of runs by which lengths are chosen; of more, evenly spaced ones are taken."""


class Gaussian:
    """A Gaussian process through known values.

    Parameters
    ----------
    places : (n, d), each parameter scaled to a range of about 1
    values : (n, m), several numbers of each run, which share the lengths

    Attributes
    ----------
    lengths, roughness : of the covariance: (d,), and the variance of what no smooth function
        explains, as a multiple of ``s^2``
    misses : (k, m) by how much all others miss each run that is not at a corner of their hull
    """

    def __init__(self, places: Array, values: Array) -> None:
        some = np.unique(np.linspace(0, len(places) - 1, min(len(places), _FITTED)).astype(int))
        self.fit(places, values, *_most_likely(places[some], values[some]))

    def fit(self, places: Array, values: Array, lengths: Array, roughness: float) -> None:
        """Take values, with lengths (d,) and a roughness that are known."""
        self.lengths, self.roughness, self._places = lengths, roughness, places
        K = _covariance(places, places, lengths)
        K[np.diag_indices_from(K)] += roughness
        inverse = np.linalg.inv(K)
        ones = inverse.sum(axis=1)
        Q = inverse - np.outer(ones, ones) / ones.sum()
        self._inverse, self._ones = inverse, ones
        inside = ~_corners(places)
        diagonal = np.diag(Q)[inside, None]
        self.misses = (Q @ values)[inside] / diagonal
        self._deviation = np.sqrt(np.mean(self.misses**2 * diagonal, axis=0))

    def weights(self, place: Array) -> tuple[Array, float]:
        """Return the weights (n,) of the runs at a place (d,), and the variance over ``s^2``."""
        k = _covariance(place[None, :], self._places, self.lengths)[0]
        rest = 1.0 - self._ones @ k
        weights = self._inverse @ k + self._ones * rest / self._ones.sum()
        variance = 1.0 - k @ self._inverse @ k + rest**2 / self._ones.sum()
        return weights, max(float(variance), 0.0)

    def error(self, variance: float) -> Array:
        """Return the standard deviations (m,) of the prediction with this variance over ``s^2``."""
        return np.asarray(np.sqrt(variance) * self._deviation)


def in_hull(places: Array, place: Array) -> bool:
    """Whether a place (d,) is a mean of places (n, d), with weights that are not negative."""
    equal = np.vstack([places.T, np.ones(len(places))])
    none = np.zeros(len(places))
    found = linprog(none, A_eq=equal, b_eq=[*place, 1.0], bounds=(0.0, None), method="highs")
    return bool(found.status == 0)


def _corners(places: Array) -> NDArray[np.bool_]:
    """Return which places are corners of the hull of all.

    None of more than `_HULL` parameters, or if all others would be too few.
    """
    count, dimensions = places.shape
    corner = np.zeros(count, dtype=bool)
    if dimensions == 1:
        corner[[places[:, 0].argmin(), places[:, 0].argmax()]] = True
    elif dimensions <= _HULL:
        with suppress(QhullError):  # the places do not fill their space
            corner[ConvexHull(places).vertices] = True
    return corner if count - corner.sum() > dimensions else np.zeros(count, dtype=bool)


def _covariance(a: Array, b: Array, lengths: Array) -> Array:
    """Return the Matern 5/2 covariance (n, m) of unit variance between places."""
    apart = (a[:, None, :] - b[None, :, :]) / lengths
    r = np.sqrt(5.0 * np.sum(apart**2, axis=2))
    return np.asarray((1.0 + r + r**2 / 3.0) * np.exp(-r))


def _most_likely(places: Array, y: Array) -> tuple[Array, float]:
    """Return the most likely lengths (d,) and roughness, the best of a few searches."""
    count, dimensions = places.shape
    spread = y.std(axis=0)
    y = y / np.where(spread > 0.0, spread, 1.0)
    bounds = [(np.log(_SHORTEST), np.log(_LONGEST))] * dimensions + [tuple(np.log(_ROUGHNESS))]

    def unlikely(logs: Array) -> float:
        K = _covariance(places, places, np.exp(logs[:-1]))
        K[np.diag_indices_from(K)] += np.exp(logs[-1])
        try:
            factor = cho_factor(K, lower=True)
        except np.linalg.LinAlgError:
            return 1e25
        solved = cho_solve(factor, np.column_stack([y, np.ones(count)]))
        ones = solved[:, -1]
        off = y - (ones @ y) / ones.sum()
        squares = np.sum(off * (solved[:, :-1] - np.outer(ones, ones @ y / ones.sum())), axis=0)
        alike = np.log(np.maximum(squares / count, 1e-300)).mean()
        return float(0.5 * count * alike + np.sum(np.log(np.diag(factor[0]))))

    found: list[Any] = [
        minimize(unlikely, [*[np.log(start)] * dimensions, np.log(1e-6)], bounds=bounds)
        for start in _STARTS
    ]
    best = min(found, key=lambda each: each.fun).x
    return np.exp(best[:-1]), float(np.exp(best[-1]))
