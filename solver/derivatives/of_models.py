"""Derivatives of results of a model by numbers from which it is made."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from typing import Any

from solver.derivatives.asked import STEP, at_switches
from solver.errors import ModelError, NotConverged
from solver.model.model import Model
from solver.parameters import is_number
from solver.results.solution import Solution, solve
from solver.typing import Array

_LOG = logging.getLogger(__name__)


def derive(
    make: Callable[..., Model],
    at: Mapping[str, float],
    of: Callable[[Solution], float | Array],
    **how: Any,
) -> dict[str, Any]:
    """Return the derivatives of a result of a model by the numbers from which it is made.

    The model is solved once. Its derivatives follow increment by increment, through plastic flow,
    contact and friction. A warning is logged if they may be one-sided. See
    `solver.derivatives.neighbours`.

    Parameters
    ----------
    make : (numbers by name) -> the model; its elements must not depend on them, their size may
    at : the numbers, none of them zero
    of : (solution) -> the result, a number or an array, for example the stress at nodes
    how : arguments of `solver.solve`

    Returns
    -------
    By name, the derivative of the result, an array of its shape

    Raises
    ------
    ModelError
        if a number is zero, or changes the elements
    NotConverged
        as `solver.solve`; or if the derivatives have no solution
    """
    for name, value in at.items():
        if not is_number(value) or value == 0:
            raise ModelError(name, value, "must be a number other than 0: it is derived by")
    beside = {name: make(**{**at, name: value * (1 + STEP)}) for name, value in at.items()}
    found = solve(make(**at), beside=beside, **how).beside
    if not found:
        raise NotConverged("an increment of the derivatives has no solution")
    ends = [list(each.stages.values())[-1] for each in found[1:]]
    ranges = {name: abs(STEP) * end.near for name, end in zip(at, ends, strict=True)}
    for note in at_switches(ranges):
        _LOG.warning("%s", note)
    result, *others = map(of, found)
    return {
        name: (other - result) / (STEP * value)
        for (name, value), other in zip(at.items(), others, strict=True)
    }
