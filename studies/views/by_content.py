"""What follows from arrays alone, such as a fit: made once, kept by the content of the arrays."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from functools import wraps
from hashlib import sha256
from typing import ParamSpec, TypeVar

import numpy as np

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
