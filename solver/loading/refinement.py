"""Increments halved until what they leave no longer changes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

HALVINGS = 6
"""Most times that `StepRefinement` halves the increments."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepRefinement:
    """How small increments must be: halved until the result of the first lap no longer changes.

    Backward Euler in the plastic strain is of first order in the increment, so the change by
    halving estimates the error that is left.

    Attributes
    ----------
    measure : (trace of a lap) -> numbers that must not change
    tolerance : largest change that is accepted
    """

    measure: Callable[[Any], NDArray[np.float64]]
    tolerance: float
