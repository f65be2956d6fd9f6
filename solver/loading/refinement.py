"""Halve the increments until the result of the first lap no longer changes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from solver.typing import Array

HALVINGS = 6
"""How often `StepRefinement` halves the increments at most."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepRefinement:
    """The criterion by which increments are halved: the change of the first lap's result.

    Backward Euler in the plastic strain is of first order in the increment, so the change by the
    last halving estimates the remaining error.

    Attributes
    ----------
    measure : (trace of a lap) -> numbers that must not change
    tolerance : largest change that is accepted
    """

    measure: Callable[[Any], Array]
    tolerance: float
