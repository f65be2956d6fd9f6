"""The law of rigid bodies."""

from __future__ import annotations

import numpy as np

from solver.materials.elasticity import Elasticity
from solver.materials.law import Law
from solver.materials.state import PlasticState, Response
from solver.typing import Array


class Rigid(Law):
    """A law without strain: infinitely stiff, it never yields."""

    @property
    def elasticity(self) -> Elasticity:
        """Elastic constants with an infinite modulus."""
        return Elasticity(youngs_modulus=np.inf, poisson_ratio=0.0)

    def flow_stress(self, state: PlasticState) -> Array:
        """Return inf: it never yields."""
        return np.full(state.accumulated.shape, np.inf)

    def respond(self, strain: Array, state: PlasticState) -> Response:
        """Return the empty response of zero points; a rigid body has no others."""
        if strain.shape[1]:
            raise ValueError("a rigid body has no points")
        count = len(strain)
        empty = np.zeros(0, dtype=bool)
        return Response(np.zeros((count, 0)), np.zeros((count, count, 0)), state, empty)
