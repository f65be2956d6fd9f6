"""Smith, Watson and Topper's parameter on the worst plane: normal stress times normal strain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.fatigue.criterion import CRITERIA, PlaneCriterion
from solver.fatigue.planes import OnPlanes
from solver.parameters import Stress, described
from solver.typing import Array


@CRITERIA.word("smith_watson_topper")
@dataclass(frozen=True, slots=True, kw_only=True)
class SmithWatsonTopper(PlaneCriterion):
    """max over planes of sigma_n,max eps_n,a <= limit; no damage where the plane stays closed.

    References
    ----------
    K.N. Smith, P. Watson, T.H. Topper, J. Mater. 5 (1970) 767-778; on planes: D.F. Socie, J. Eng.
    Mater. Technol. 109 (1987) 293-298.
    """

    needs_strain = True
    yielding = True

    endured: Stress = described(0.5, "value of the parameter that the material endures")

    @property
    def limit(self) -> float:
        """The value that the material endures [MPa]."""
        return self.endured

    def on_plane(self, on: OnPlanes) -> Array:
        """See `PlaneCriterion`."""
        return np.maximum(on.normal, 0.0) * on.strain_half
