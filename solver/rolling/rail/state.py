"""The state of a prism that is constant along x, as steady passes leave it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.materials.state import PlasticState
from solver.typing import Array


@dataclass(frozen=True, slots=True)
class PrismState:
    """Internal variables and strain at the n points of the zone; never changed, only replaced.

    Attributes
    ----------
    state : internal variables of the law at the points
    strain : (n, 6) strain without load, with the elastic strain of the initial stress, Mandel
    displacement : (m, 3) displacement of the surface without load, means under the hats [mm]
    """

    state: PlasticState
    strain: Array
    displacement: Array

    @property
    def plastic_strain(self) -> Array:
        """Plastic strain (n, 6), Mandel."""
        return np.ascontiguousarray(self.state.plastic_strain.T)

    @property
    def accumulated(self) -> Array:
        """Accumulated plastic strain (n,)."""
        return self.state.accumulated

    @property
    def mirrored(self) -> PrismState:
        """The same state, seen along -x."""
        return replace(
            self,
            state=self.state.mirrored,
            strain=self.strain * [1.0, 1.0, 1.0, -1.0, 1.0, -1.0],
            displacement=self.displacement * [-1.0, 1.0, 1.0],
        )
