"""Fatemi and Socie's criterion: shear strain, made worse by normal stress across its plane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval, Unit

from solver.fatigue.criterion import CRITERIA, PlaneCriterion, Sensitivity
from solver.fatigue.planes import OnPlanes
from solver.parameters import Stress, described
from solver.typing import Array


@CRITERIA.word("fatemi_socie")
@dataclass(frozen=True, slots=True, kw_only=True)
class FatemiSocie(PlaneCriterion):
    """max over planes of gamma_a (1 + k sigma_n,max / sigma_y) <= limit, gamma = 2 eps_xy.

    Compression closes the crack: a negative normal stress counts, down to a factor of zero.

    References
    ----------
    A. Fatemi, D.F. Socie, Fatigue Fract. Eng. Mater. Struct. 11 (1988) 149-165.
    """

    needs_strain = True
    yielding = True

    endured: Annotated[float, Interval(gt=0.0, le=1.0), Unit("1")] = described(
        2e-3, "value of the criterion that the material endures"
    )
    sensitivity: Sensitivity = described(0.3, "factor k of normal stress over yield stress")
    yield_stress: Stress = described(400.0, "cyclic yield stress")

    @property
    def limit(self) -> float:
        """The value that the material endures."""
        return self.endured

    def on_plane(self, on: OnPlanes) -> Array:
        """See `PlaneCriterion`."""
        open_ = np.maximum(1 + self.sensitivity * on.normal / self.yield_stress, 0.0)
        return 2 * on.shear_strain * open_
