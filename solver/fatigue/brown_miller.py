"""Brown and Miller's criterion: normal strain across the plane of the largest shear strain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Interval, Unit

from solver.fatigue.criterion import CRITERIA, PlaneCriterion, Sensitivity
from solver.fatigue.planes import OnPlanes
from solver.parameters import described
from solver.typing import Array

_NEXT = 1e-6
"""Weight of normal strain in the search: of planes with equal shear it takes the worst one."""


@CRITERIA.word("brown_miller")
@dataclass(frozen=True, slots=True, kw_only=True)
class BrownMiller(PlaneCriterion):
    """gamma_a + S (range of eps_n) <= limit on the plane with the largest gamma_a = 2 eps_xy,a.

    References
    ----------
    F.A. Kandil, M.W. Brown, K.J. Miller, Metals Society 280 (1982) 203-210.
    """

    needs_strain = True
    yielding = True

    endured: Annotated[float, Interval(gt=0.0, le=1.0), Unit("1")] = described(
        2e-3, "value of the criterion that the material endures"
    )
    sensitivity: Sensitivity = described(0.3, "factor S of the range of normal strain")

    @property
    def limit(self) -> float:
        """The value that the material endures."""
        return self.endured

    def on_plane(self, on: OnPlanes) -> Array:
        """See `PlaneCriterion`."""
        return 2 * on.shear_strain + self.sensitivity * 2 * on.strain_half

    def searched(self, on: OnPlanes) -> Array:
        """See `PlaneCriterion`."""
        return on.shear_strain + _NEXT * on.strain_half
