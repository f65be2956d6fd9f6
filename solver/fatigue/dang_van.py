"""Dang Van's criterion: mesoscopic shear and hydrostatic stress, at each instant of the cycle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.fatigue.criterion import CRITERIA, TwoLimits
from solver.fatigue.paths import Paths
from solver.tensors import principal, to_mandel
from solver.typing import Array


@CRITERIA.word("dang_van")
@dataclass(frozen=True, slots=True, kw_only=True)
class DangVan(TwoLimits):
    """max over t of tau(t) + a p(t) <= t, with a = 3 t / f - 3 / 2 of the limits t and f.

    tau is the largest shear stress of the deviator minus the centre of the smallest ball around its
    path: the stress in a grain that has shaken down. The plane is that of tau at the worst instant.

    References
    ----------
    K. Dang Van, B. Griveau, O. Message, EGF 3 (1989) 479-496.
    """

    @staticmethod
    def of_limits(ratio: float) -> float:
        """See `TwoLimits`."""
        return 3 * ratio - 1.5

    def path(self, paths: Paths) -> tuple[Array, Array]:
        """Return hydrostatic stress and mesoscopic shear (n, n_instants): its diagram."""
        centres, _ = paths.deviator_balls
        return paths.pressure, paths.largest_shear(centres)

    def found(self, paths: Paths) -> tuple[Array, Array]:
        """See `Criterion`."""
        centres, _ = paths.deviator_balls
        p = paths.pressure
        at = np.arange(len(p)), (paths.largest_shear(centres) + self.factor * p).argmax(axis=1)
        values, directions = principal(to_mandel((paths.stress[at] - centres).T))
        plane = (directions[:, 0] + directions[:, 2]).T / 2**0.5
        return (values[0] - values[2]) / 2 + self.factor * p[at], plane
