"""Polynomial chaos: a sum of few orthogonal polynomials, fitted to numbers of runs.

The polynomials are products of Legendre polynomials of the parameters, each orthonormal for
parameters that are independent and uniform in [-1, 1]. Variances are therefore sums of squares of
coefficients.

1. Candidates are all products whose degrees k fulfil sum k_i**q <= p**q: with q = 3/4 those of
   several parameters have lower degrees.
2. Orthogonal matching pursuit: the candidate that correlates most with what is left comes next.
3. The number of terms is that of the smallest leave-one-out error, in closed form and corrected for
   the number of terms.

References
----------
Blatman, G. and Sudret, B. (2011), Adaptive sparse polynomial chaos expansion based on least angle
regression, J. Comput. Phys. 230: the hyperbolic set, and the corrected error, here for columns
that are orthogonal.
Sudret, B. (2008), Global sensitivity analysis using polynomial chaos expansions, Reliab. Eng. Syst.
Saf. 93: indices from coefficients.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

Numbers = NDArray[np.float64]

DEGREES = (1, 2, 4, 8, 14)
"""Degrees to try: few runs bear low ones only."""
_CANDIDATES = 8
"""Largest number of candidates for each run."""
_PATIENCE = 12
"""Terms that are tried after the last one that made the error smaller."""


@dataclass(frozen=True, slots=True)
class Chaos:
    """A fitted sum of polynomials.

    Attributes
    ----------
    degrees : (n_terms, n_parameters), the first row is zero: the mean
    coefficients : (n_terms,), of orthonormal polynomials
    """

    degrees: NDArray[np.int64]
    coefficients: Numbers

    def __call__(self, places: Numbers) -> Numbers:
        """Return the values at places (n, n_parameters) in [-1, 1]."""
        return _products(places, self.degrees) @ self.coefficients

    @property
    def variance(self) -> float:
        """Variance for uniform parameters."""
        return float(np.sum(self.coefficients[1:] ** 2))

    def indices(self) -> tuple[Numbers, Numbers]:
        """Return the first-order and the total index of each parameter, each (n_parameters,).

        Of a constant all are 0.
        """
        used, squares = self.degrees > 0, self.coefficients**2
        alone = used.sum(axis=1) == 1
        total = squares @ used
        first = (squares * alone) @ used
        whole = self.variance or 1.0
        return first / whole, total / whole

    def alone(self, parameter: int, places: Numbers) -> Numbers:
        """Return the mean over all other parameters, at places (n,) of one parameter."""
        others = np.delete(self.degrees, parameter, axis=1)
        own = ~(others > 0).any(axis=1)
        values = _polynomials(places, int(self.degrees.max()))[self.degrees[own, parameter]]
        return self.coefficients[own] @ values


def fitted(places: Numbers, values: Numbers, degree: int) -> Chaos:
    """Return the sum of polynomials for values (n,) at places (n, n_parameters) in [-1, 1]."""
    degrees = candidates(places.shape[1], degree)
    columns = _products(places, degrees)
    chosen = _pursued(columns, values)
    coefficients = np.linalg.lstsq(columns[:, chosen], values, rcond=None)[0].astype(np.float64)
    return Chaos(degrees[chosen], coefficients)


def _pursued(columns: Numbers, values: Numbers) -> list[int]:
    """Return the columns to take: the first one, the mean, and those of the smallest error."""
    runs, norms = len(values), np.linalg.norm(columns, axis=0)
    left, pool = values - values.mean(), columns - columns.mean(axis=0)
    chosen, best, smallest, lever = [0], 1, np.inf, np.full(runs, 1.0 / runs)
    while (count := len(chosen)) < runs - 1:
        error = np.mean((left / (1.0 - lever)) ** 2) * (runs + count) / (runs - count)
        if error < smallest * (1.0 - 1e-9):
            smallest, best = error, count
        elif count >= best + _PATIENCE:
            break
        sizes = np.linalg.norm(pool, axis=0)
        free = sizes > 1e-8 * norms
        scores = np.where(free, np.abs(left @ pool) / np.where(free, sizes, 1.0), 0.0)
        take = int(np.argmax(scores))
        if not scores[take] > 1e-12 * np.linalg.norm(values):
            break
        one = pool[:, take] / sizes[take]
        chosen.append(take)
        left = left - one * (one @ left)
        pool = pool - np.outer(one, one @ pool)
        lever = np.minimum(lever + one**2, 1.0 - 1e-9)
    return chosen[:best]


def bears(runs: int, parameters: int, degree: int) -> bool:
    """Whether so many runs bear the search for polynomials of a degree."""
    most = _CANDIDATES * runs
    return len(candidates(parameters, degree, most)) <= most


def candidates(parameters: int, degree: int, most: int | None = None) -> NDArray[np.int64]:
    """Return all degrees k (n_candidates, n_parameters) with sum k_i**q <= p**q, the mean first.

    If there are more than ``most``, those of the first few parameters are returned: of many there
    are more than the memory holds.
    """
    q = 1.0 if degree <= 2 else 0.75
    largest, rows = degree**q * (1.0 + 1e-12), np.zeros((1, 0), dtype=np.int64)
    for _ in range(parameters):
        if most is not None and len(rows) > most:
            break
        tall = np.repeat(rows, degree + 1, axis=0)
        rows = np.column_stack([tall, np.tile(np.arange(degree + 1), len(rows))])
        rows = rows[(rows**q).sum(axis=1) <= largest]
    return rows[np.argsort((rows**q).sum(axis=1), kind="stable")]


def _products(places: Numbers, degrees: NDArray[np.int64]) -> Numbers:
    """Return products of polynomials (n, n_terms) at places (n, n_parameters)."""
    each = [_polynomials(column, int(degrees.max(initial=0))) for column in places.T]
    found = np.ones((len(places), len(degrees)))
    for own, powers in zip(each, degrees.T, strict=True):
        found *= own[powers].T
    return found


def _polynomials(places: Numbers, degree: int) -> Numbers:
    """Return orthonormal Legendre polynomials (degree + 1, n) at places (n,)."""
    sizes = np.sqrt(2.0 * np.arange(degree + 1) + 1.0)
    return sizes[:, None] * legendre.legvander(places, degree).T
