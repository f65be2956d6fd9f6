"""How well the parameters of a fit are known, and which cannot be told apart.

References
----------
Belsley, D. A., Kuh, E. and Welsch, R. E. (1980), Regression Diagnostics, section 3.2: condition
indices, and the shares of variances by which parameters are found that cannot be told apart.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from solver.typing import Array
from studies.kinds.fit.fitting import Fit, Fitted

_CONDITION = 30.0
"""Condition index from which parameters cannot be told apart (reference, section 3.2)."""
_SHARE = 0.5
"""Share of the variance of a parameter that a direction makes if the parameter is in it."""
_WEAK = 1e-6
"""Least length of a column of the Jacobian matrix over that of the longest."""


class Certainty(NamedTuple):
    """How well parameters are known.

    Attributes
    ----------
    covariance : (n, n) of the values; NaN where the lines say nothing
    correlation : (n, n)
    condition : of the Jacobian matrix with columns of length 1
    warning : which parameters cannot be told apart, or change nothing; empty if there are none
    """

    covariance: Array
    correlation: Array
    condition: float
    warning: str


def certainty(fit: Fit, answer: Fitted) -> Certainty:
    """Return how well the parameters of an answer with a Jacobian matrix are known.

    Where not all standard deviations were given, they are scaled so that the differences have them.
    """
    assert answer.jacobian is not None
    names, slopes = list(fit.ranges), [
        each.slope(value) for each, value in zip(fit.ranges.values(), answer.values, strict=True)
    ]  # fmt: skip
    lengths = np.linalg.norm(answer.jacobian, axis=0)
    idle = lengths <= _WEAK * max(lengths.max(initial=0.0), 1e-300)
    count = len(names)
    inverse = np.full((count, count), np.nan)
    warnings = [f"{names[k]} changes nothing in what was measured" for k in np.flatnonzero(idle)]
    condition = math.inf
    if (used := np.flatnonzero(~idle)).size:
        unit = answer.jacobian[:, used] / lengths[used]
        _, sizes, rows = np.linalg.svd(unit, full_matrices=False)
        sizes = np.maximum(sizes, 1e-15 * sizes[0])
        own = (rows.T / sizes**2) @ rows / np.outer(lengths[used], lengths[used])
        inverse[np.ix_(used, used)] = own
        condition = math.inf if idle.any() else float(sizes[0] / sizes[-1])
        shares = rows**2 / sizes[:, None] ** 2
        shares /= shares.sum(axis=0)
        for size, share in zip(sizes, shares, strict=True):
            if sizes[0] / size >= _CONDITION:
                apart = [names[used[k]] for k in np.flatnonzero(share > _SHARE)]
                if len(apart) > 1:
                    warnings.append(f"{_listed(apart)} cannot be told apart by what was measured")
    covariance = fit.spread(answer.seen) * inverse * np.outer(slopes, slopes)
    sigma = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(sigma, sigma)
    text = "; ".join(dict.fromkeys(warnings))
    if text and math.isfinite(condition):
        text += f": the condition of the Jacobian matrix is {condition:.3g}"
    return Certainty(covariance, correlation, condition, text)


def _listed(names: list[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}"
