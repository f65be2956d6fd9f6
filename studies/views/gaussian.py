"""A Gaussian process through the numbers of runs, with an error that runs left out have shown.

The covariance is Matern 5/2 with a length for each parameter, the mean a constant that is found
with the numbers (ordinary kriging). Its lengths are the most likely ones. With few runs these are
not known well, and the variance that the process states for itself is too small. Therefore a tenth
of the runs is left out in turn, the lengths are found again, and the others predict these runs:

1. Kriging gives the variance ``v`` of a prediction over ``s^2``. Here ``s^2`` is the mean of
   ``miss^2 / v`` of the runs left out, so that they have the variance that is stated for them.
2. It is widened by Student's t, as it follows from few runs.
3. The variance is added that a jackknife gives: by predictions from all runs, with the lengths that
   were found without each tenth.

References
----------
Rasmussen, C. E. and Williams, C. K. I. (2006), Gaussian Processes for Machine Learning, eqs. 4.17
(Matern), 5.8 and 5.9 (likelihood and its slopes). Bachoc, F. (2013), Cross validation and maximum
likelihood estimations of hyper-parameters of Gaussian processes with model misspecification,
Comput. Stat. Data Anal. 66, eq. 8: the variance by runs left out. Efron, B. and Tibshirani, R. J.
(1993), An Introduction to the Bootstrap, section 11.5: the jackknife with groups.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import linprog, minimize
from scipy.stats import t as student

from studies.views.fits import tenths

Array = NDArray[np.float64]

_SHORTEST, _LONGEST = 0.05, 20.0
"""Smallest and largest length, as a multiple of the range of a parameter."""
_ROUGHNESS = (1e-7, 1e-2)
"""Variance of what no smooth function explains, as a multiple of the whole: smallest, largest."""
_STARTS, _ROUGH = (0.3, 1.5), 1e-3
"""Lengths and roughness from which the most likely ones are searched. From a much smaller roughness
the likelihood has no slope along it, and a search ends at lengths that explain it instead.
"""
_NORMAL, _SURE = 1.96, 0.975
"""Deviations of a normal distribution with this probability below them."""
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
    misses : (n, m) number of each run less what fits that leave out its tenth predict
    """

    def __init__(self, places: Array, values: Array) -> None:
        count, dimensions = places.shape
        starts = [np.log([start] * dimensions + [_ROUGH]) for start in _STARTS]
        likely = _most_likely(places, values, starts)
        self._values, self._whole = values, Kriging(places, likely)
        self._others = list[Kriging]()
        self.misses, squares = np.empty_like(values), np.empty_like(values)
        for out in tenths(count):
            own = _most_likely(places[~out], values[~out], [likely])
            part = Kriging(places[~out], own)
            weights, variance = part.at(places[out])
            self.misses[out] = values[out] - weights @ values[~out]
            squares[out] = self.misses[out] ** 2 / variance[:, None]
            self._others.append(Kriging(places, own))
        free = max(count - dimensions - 2, 1)  # the mean and the lengths are found with s
        self._deviation = np.sqrt(squares.mean(axis=0)) * student.ppf(_SURE, free) / _NORMAL

    def at(self, place: Array) -> tuple[Array, Array]:
        """Return the weights (n,) of the runs at a place (d,), and standard deviations (m,)."""
        weights, variance = self._whole.at(place[None, :])
        each = [other.at(place[None, :])[0][0] - weights[0] for other in self._others]
        unsure = (len(each) - 1) * np.mean((np.array(each) @ self._values) ** 2, axis=0)
        return weights[0], np.sqrt(self._deviation**2 * variance[0] + unsure)


class Kriging:
    """Ordinary kriging with a known covariance.

    Parameters
    ----------
    places : (n, d) of the runs
    logs : (d + 1,) logarithms of the lengths, and of the roughness
    """

    def __init__(self, places: Array, logs: Array) -> None:
        self._places, self._logs = places, logs
        K = _covariance(places, places, logs).values
        K[np.diag_indices_from(K)] += np.exp(logs[-1])
        self._inverse = np.linalg.inv(K)
        self._ones = self._inverse.sum(axis=1)

    def at(self, places: Array) -> tuple[Array, Array]:
        """Return weights (k, n) of the runs at places (k, d), and the variance (k,) over s^2."""
        k = _covariance(places, self._places, self._logs).values
        solved = k @ self._inverse
        rest = 1.0 - k @ self._ones
        weights = solved + np.outer(rest, self._ones) / self._ones.sum()
        variance = 1.0 - np.sum(solved * k, axis=1) + rest**2 / self._ones.sum()
        return weights, np.maximum(variance, 0.0) + np.exp(self._logs[-1])


def in_hull(places: Array, place: Array) -> bool:
    """Whether a place (d,) is a mean of places (n, d), with weights that are not negative."""
    equal = np.vstack([places.T, np.ones(len(places))])
    none = np.zeros(len(places))
    found = linprog(none, A_eq=equal, b_eq=[*place, 1.0], bounds=(0.0, None), method="highs")
    return bool(found.status == 0)


class _Covariance(NamedTuple):
    """Covariance (n, m) of unit variance between places, and its slopes.

    Over the logarithm of a length the slope is ``slope`` times the square (d, n, m) of its part of
    the distance.
    """

    values: Array
    slope: Array
    squares: Array


def _covariance(a: Array, b: Array, logs: Array) -> _Covariance:
    """Return the Matern 5/2 covariance between places (n, d) and (m, d)."""
    squares = ((a.T[:, :, None] - b.T[:, None, :]) / np.exp(logs[:-1, None, None])) ** 2
    r = np.sqrt(5.0 * squares.sum(axis=0))
    decay = np.exp(-r)
    return _Covariance((1.0 + r + r**2 / 3.0) * decay, 5.0 / 3.0 * (1.0 + r) * decay, squares)


def _most_likely(places: Array, y: Array, starts: list[Array]) -> Array:
    """Return logarithms (d + 1,) of the most likely lengths and roughness, the best of searches."""
    some = np.unique(np.linspace(0, len(places) - 1, min(len(places), _FITTED)).astype(int))
    places, y = places[some], y[some]
    spread = y.std(axis=0)
    y = y / np.where(spread > 0.0, spread, 1.0)
    count, dimensions = places.shape
    bounds = [(np.log(_SHORTEST), np.log(_LONGEST))] * dimensions + [tuple(np.log(_ROUGHNESS))]

    def unlikely(logs: Array) -> tuple[float, Array]:
        K, slope, squares = _covariance(places, places, logs)
        K[np.diag_indices_from(K)] += np.exp(logs[-1])
        try:
            factor = cho_factor(K, lower=True)
        except np.linalg.LinAlgError:
            return 1e25, np.zeros_like(logs)
        inverse = cho_solve(factor, np.eye(count))
        ones = inverse.sum(axis=1)
        solved = inverse @ y - np.outer(ones, ones @ y / ones.sum())
        missed = np.maximum(np.sum(y * solved, axis=0), 1e-300)
        W = inverse - (solved * (count / missed / len(missed))) @ solved.T
        slopes = [0.5 * np.sum(W * slope * each) for each in squares]
        alike = 0.5 * count * np.log(missed / count).mean()
        return (
            float(alike + np.sum(np.log(np.diag(factor[0])))),
            np.array([*slopes, 0.5 * np.trace(W) * np.exp(logs[-1])]),
        )

    found: list[Any] = [minimize(unlikely, start, jac=True, bounds=bounds) for start in starts]
    return np.asarray(min(found, key=lambda each: each.fun).x)
