"""The contract of a material law: what bodies, contact and audit may ask of it.

A law answers a strain with stress, tangent and new internal variables (`Law.respond`). It never
changes the state it is given; a state becomes history only when the increment that made it has
converged. Arrays have their components first and their points last, and the number of components
is that of the arrays: 4 in two dimensions, 6 in three (`solver.tensors`).

A law of one's own gives `elasticity`, `flow_stress` and `respond`. The rest follows from them for
associated flow on a surface of von Mises, and may be replaced piece by piece; what is written as an
attribute may be a property, or a field of a dataclass.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

import numpy as np

from solver.materials.attribute import attribute
from solver.materials.state import PlasticState
from solver.materials.yield_surface import VonMises

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.materials.elasticity import Elasticity
    from solver.materials.state import Response
    from solver.materials.yield_surface import YieldSurface

    Array = NDArray[np.float64]


class Law(ABC):
    """An elastic-plastic law with small strains and no dependence on time."""

    __slots__ = ()

    # -- its parts -----------------------------------------------------------------------------

    @attribute
    def elasticity(self) -> Elasticity:
        """How it answers below yield."""
        raise NotImplementedError(f"{type(self).__name__} must give its elasticity")

    @attribute
    def surface(self) -> YieldSurface:
        """The shape of its yield surface."""
        return VonMises()

    @abstractmethod
    def flow_stress(self, state: PlasticState) -> Array:
        """Return the size of the yield surface (n_points,), as a tension [MPa]; inf: elastic."""

    def back_stress(self, state: PlasticState) -> Array:
        """Return the centre of the yield surface (n_components, n_points), Mandel [MPa]."""
        return np.zeros_like(state.plastic_strain)

    # -- its answer ----------------------------------------------------------------------------

    def initial(self, n_points: int, n_components: int) -> PlasticState:
        """Return the internal variables before any load; laws that need more give their own."""
        return PlasticState.virgin(n_points, n_components)

    @abstractmethod
    def respond(self, strain: Array, state: PlasticState) -> Response:
        """Return stress, consistent tangent and new internal variables.

        Parameters
        ----------
        strain : (n_components, n_points) total Mandel strain at the end of the increment
        state : internal variables at its beginning, left unchanged
        """

    def stiffness(self, n_components: int) -> Array:
        """Return the elastic stiffness (n_components, n_components) on Mandel strain [MPa]."""
        return self.elasticity.stiffness(n_components)

    def in_plane_stress(self) -> Law | None:
        """Return a law of its own for plane stress; None where `PlaneStress` shall wrap it."""
        return None

    # -- its strength --------------------------------------------------------------------------

    @attribute
    def yield_stress(self) -> float:
        """Tension at first yield [MPa]; inf if it never yields."""
        return float(self.flow_stress(self.initial(1, 4))[0])

    @attribute
    def shear_yield_stress(self) -> float:
        """Shear stress at first yield [MPa]."""
        return self.surface.shear(self.yield_stress)

    @attribute
    def elastic(self) -> bool:
        """Whether it can never yield."""
        return math.isinf(self.yield_stress)

    @attribute
    def hardens(self) -> bool:
        """Whether stress grows with plastic strain without end, so that there is no limit load."""
        return False

    def strength(self, state: PlasticState) -> Array:
        """Return the tension (n_points,) that one loading to this plastic strain reaches [MPa]."""
        return self.flow_stress(state)

    def shear_strength(self, state: PlasticState) -> Array:
        """Return the shear stress (n_points,) that one loading in shear reaches [MPa]."""
        return self.surface.shear(self.strength(state))

    # -- what it demands -----------------------------------------------------------------------

    def yield_value(self, stress: Array, state: PlasticState) -> Array:
        """Return how far stress is beyond the yield surface (n_points,) [MPa]; below 0 inside."""
        relative = stress - self.back_stress(state)
        return self.surface.equivalent(relative) - self.flow_stress(state)

    def flow_direction(self, stress: Array, state: PlasticState) -> Array:
        """Return plastic strain over the plastic multiplier (n_components, n_points), Mandel."""
        return self.surface.normal(stress - self.back_stress(state))

    def dissipation(self, before: PlasticState, response: Response) -> Array:
        """Return the work (n_points,) an increment turns into heat [N mm/mm3]."""
        flow = response.state.plastic_strain - before.plastic_strain
        back = self.back_stress(response.state)
        return np.asarray(((response.stress - back) * flow).sum(axis=0))

    def misfit(
        self, strain: Array, stress: Array, before: PlasticState, after: PlasticState
    ) -> Array:
        """Return by how much an increment breaks this law (n_points,) [MPa].

        The law is stated here, not solved, so that `respond` is tested without being called.
        With dp the growth of the accumulated plastic strain, backward Euler asks that

        - stress = C : (strain - plastic strain)
        - the yield value is not above 0, and is 0 where dp > 0
        - plastic strain grew by dp times the flow direction at the end, dp >= 0

        The largest miss counts; a miss of strain is made a stress by 2 G.

        Parameters
        ----------
        strain, stress : (n_components, n_points) Mandel, at the end of the increment
        before, after : internal variables at its beginning and end
        """
        C, G = self.stiffness(len(stress)), self.elasticity.shear_modulus
        worst = np.abs(stress - C @ (strain - after.plastic_strain)).max(axis=0)
        beyond = self.yield_value(stress, after)
        dp = after.accumulated - before.accumulated
        worst = np.maximum(worst, np.where(dp > 0, np.abs(beyond), np.maximum(beyond, 0.0)))
        flow = after.plastic_strain - before.plastic_strain
        stray = np.abs(flow - dp * self.flow_direction(stress, after)).max(axis=0)
        return np.asarray(np.maximum(worst, 2 * G * np.maximum(stray, -dp)))
