"""How well a fit to the runs predicts runs: those of a tenth that is left out in turn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from studies.errors import StudyError

TENTHS = 10
_PREDICTED = 0.8
"""Least share of the variance that the fits must predict."""


def tenths(count: int) -> list[NDArray[np.bool_]]:
    """Return which of the runs are left out, for each tenth: of less than ten runs each alone."""
    number = np.random.default_rng(0).permutation(count) % TENTHS
    return [number == k for k in range(min(count, TENTHS))]


def share_predicted(values: NDArray[np.float64], misses: NDArray[np.float64]) -> float:
    """Return Q²: the share of the variance of the runs that the fits without them predict."""
    squares = float(np.sum((values - values.mean(axis=0)) ** 2))
    return 1.0 - float(np.sum(misses**2)) / squares if squares > 0.0 else 1.0


def check_predicted(of: str, q2: float, runs: int) -> None:
    """Raise `StudyError` if fits predict too little of a number."""
    if q2 < _PREDICTED:
        allowed = (
            f"is the share of the variance of {of} that a fit to {runs} runs predicts, and at "
            f"least {_PREDICTED} is needed: double the sample, or make ranges smaller"
        )
        raise StudyError("Q2", f"{q2:.2f}", allowed)
