"""Matake's criterion: the largest normal stress on the plane of the largest shear amplitude."""

from __future__ import annotations

from dataclasses import dataclass

from solver.fatigue.criterion import CRITERIA, PlaneCriterion, TwoLimits
from solver.fatigue.planes import OnPlanes
from solver.typing import Array

_NEXT = 1e-6
"""Weight of normal stress in the search: of planes with equal shear it takes the worst one."""


@CRITERIA.word("matake")
@dataclass(frozen=True, slots=True, kw_only=True)
class Matake(TwoLimits, PlaneCriterion):
    """tau_a + k sigma_n,max <= t, k = 2 t / f - 1, on the plane with the largest tau_a.

    References
    ----------
    T. Matake, Bull. JSME 20 (1977) 257-263.
    """

    @staticmethod
    def of_limits(ratio: float) -> float:
        """See `TwoLimits`."""
        return 2 * ratio - 1

    def on_plane(self, on: OnPlanes) -> Array:
        """See `PlaneCriterion`."""
        return on.shear + self.factor * on.normal

    def searched(self, on: OnPlanes) -> Array:
        """See `PlaneCriterion`."""
        return on.shear + _NEXT * on.normal
