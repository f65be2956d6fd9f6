"""Crossland's criterion: amplitude of sqrt(J2), and the largest hydrostatic stress."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.fatigue.criterion import CRITERIA, TwoLimits
from solver.fatigue.paths import Paths
from solver.typing import Array


@CRITERIA.word("crossland")
@dataclass(frozen=True, slots=True, kw_only=True)
class Crossland(TwoLimits):
    """sqrt(J2a) + a p_max <= t, with a = 3 t / f - sqrt(3) of the limits t (torsion), f (bending).

    sqrt(J2a) is the radius of the smallest ball around the path of the deviator over sqrt(2), and
    p the hydrostatic stress.

    References
    ----------
    B. Crossland, Proc. Int. Conf. on Fatigue of Metals, London (1956), 138-149; the ball: I.V.
    Papadopoulos, Int. J. Fatigue 16 (1994) 377-384.
    """

    @staticmethod
    def of_limits(ratio: float) -> float:
        """See `TwoLimits`."""
        return 3 * ratio - 3**0.5

    def found(self, paths: Paths) -> tuple[Array, Array]:
        """See `Criterion`."""
        _, radii = paths.deviator_balls
        value = radii / 2**0.5 + self.factor * paths.pressure.max(axis=1)
        return value, np.full((len(paths), 3), np.nan)
