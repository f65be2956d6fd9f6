"""Criterion of step refinement: increments are halved until the first lap's result converges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from solver.typing import Array

HALVINGS = 6
"""Most halvings of the increments by `StepRefinement`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepRefinement:
    """Increments are halved while this changes the result of the first lap.

    Backward Euler in the plastic strain is of first order in the increment, so the change by the
    last halving estimates the remaining error.

    Attributes
    ----------
    measure : (trace of a lap) -> numbers that must converge
    tolerance : largest change accepted
    """

    measure: Callable[[Any], Array]
    tolerance: float
