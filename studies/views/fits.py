"""What fits to runs share: they are kept by their content, and tell how well they predict runs."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from functools import wraps
from hashlib import sha256
from typing import ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from solver.memory import remembered
from studies.errors import StudyError

Given = ParamSpec("Given")
Made = TypeVar("Made")


def by_content(make: Callable[Given, Made]) -> Callable[Given, Made]:
    """Return a function that remembers its results, refusals (`StudyError`) among them.

    The process keeps the latest ones, up to a number of bytes (`solver.memory.remembered`).

    Parameters
    ----------
    make : a function of arrays of numbers and of what can be a key; nobody changes its results
    """

    def made(*given: Given.args, **named: Given.kwargs) -> tuple[Made | None, StudyError | None]:
        try:
            return make(*given, **named), None
        except StudyError as error:
            return None, error.with_traceback(None)

    @wraps(make)
    def kept(*given: Given.args, **named: Given.kwargs) -> Made:
        assert not named
        key = (make, *map(_key, given))
        found, refused = remembered(key, lambda: made(*given, **named))
        if refused is not None:
            raise copy(refused)  # an error that is raised holds what its callers have
        return found  # type: ignore[return-value]

    return kept


def _key(given: object) -> object:
    """Return what stands for an argument: for an array its shape, kind, and digest."""
    if not isinstance(given, np.ndarray):
        return given
    return given.shape, given.dtype.str, sha256(np.ascontiguousarray(given).data).digest()


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
