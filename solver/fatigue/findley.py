"""Findley's criterion: shear amplitude and the largest normal stress on the worst plane."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, sqrt

from solver.fatigue.criterion import CRITERIA, PlaneCriterion, TwoLimits
from solver.fatigue.planes import OnPlanes
from solver.typing import Array


@CRITERIA.word("findley")
@dataclass(frozen=True, slots=True, kw_only=True)
class Findley(TwoLimits, PlaneCriterion):
    """max over planes of tau_a + k sigma_n,max <= t sqrt(1 + k^2).

    The limits t (torsion) and f (bending) give k from t / f = (k + sqrt(1 + k^2)) / (2 sqrt(1 +
    k^2)): both have the same value on their worst planes.

    References
    ----------
    W.N. Findley, J. Eng. Ind. 81 (1959) 301-306.
    """

    @staticmethod
    def of_limits(ratio: float) -> float:
        """See `TwoLimits`."""
        sine = 2 * ratio - 1  # k / sqrt(1 + k^2)
        return sine / sqrt(1 - sine**2) if abs(sine) < 1 else inf

    @property
    def limit(self) -> float:
        """The value in reversed torsion at its limit [MPa]."""
        return self.torsion * sqrt(1 + self.factor**2)

    def on_plane(self, on: OnPlanes) -> Array:
        """See `PlaneCriterion`."""
        return on.shear + self.factor * on.normal
