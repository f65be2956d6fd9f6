"""Von Mises plasticity whose yield surface grows along a curve and moves by fading back stresses.

It is the law of fatigue and rail engineers: the back stresses of Armstrong and Frederick fade, so
that repeated loading about a mean stress ratchets; the curve lets the surface grow and saturate.
Other rules of back stresses are subclasses of `BackStress`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, ClassVar, cast

import numpy as np

from solver.materials.back_stress import ArmstrongFrederick, BackStress
from solver.materials.back_stress_return import fading_return, general_return
from solver.materials.curves import Curve
from solver.materials.elasticity import Elasticity
from solver.materials.law import Law
from solver.materials.state import PlasticState, Response
from solver.tensors import deviator
from solver.typing import Array


@dataclass(frozen=True, slots=True)
class ChabocheState(PlasticState):
    """Internal variables, with the back stresses (n_back, n_components, n_points) [MPa].

    Each is 2/3 C times a strain, the plastic strain less the faded part, and `stretched` scales it
    like a strain.
    """

    back: Array
    TENSORS: ClassVar[tuple[str, ...]] = ("plastic_strain", "back")


@dataclass(frozen=True, slots=True, kw_only=True)
class Chaboche(Law):
    """An isotropic elastic von Mises material with nonlinear mixed hardening.

    Attributes
    ----------
    elasticity : Hooke's law
    curve : size of the yield surface over the accumulated plastic strain
    back_stresses : rules of the parts of its centre

    References
    ----------
    J.L. Chaboche, Int. J. Plasticity 5 (1989) 247-302. Backward Euler and its tangent as in
    S. Hartmann, P. Haupt, Int. J. Numer. Meth. Engng 36 (1993) 3801-3814.
    """

    elasticity: Elasticity
    curve: Curve
    back_stresses: tuple[BackStress, ...] = field(default=())

    # -- the law, see `Law` --------------------------------------------------------------------

    @property
    def symmetric(self) -> bool:
        """Whether the tangent is symmetric: no back stress fades."""
        return all(rule.symmetric for rule in self.back_stresses)

    @property
    def hardens(self) -> bool:
        """Whether stress grows with plastic strain without bound."""
        return math.isinf(self._limit)

    @property
    def ultimate_shear_stress(self) -> float:
        """Shear stress that curve and back stresses together tend to [MPa]."""
        return self.surface.shear(self._limit)

    @property
    def _limit(self) -> float:
        return self.curve.limit + sum(rule.limit for rule in self.back_stresses)

    def initial(self, n_points: int, n_components: int) -> ChabocheState:
        """Return the state of a material that has never yielded."""
        virgin = PlasticState.virgin(n_points, n_components)
        back = np.zeros((len(self.back_stresses), n_components, n_points))
        return ChabocheState(virgin.plastic_strain, virgin.accumulated, back)

    def flow_stress(self, state: PlasticState) -> Array:
        """Return the stress of the curve (n_points,) [MPa]."""
        return self.curve.flow_stress(state.accumulated)

    def back_stress(self, state: PlasticState) -> Array:
        """Return the sum of the back stresses (n_components, n_points), Mandel [MPa]."""
        assert isinstance(state, ChabocheState)
        return np.asarray(state.back.sum(axis=0))

    def strength(self, state: PlasticState) -> Array:
        """Return the stress of a tension test at this plastic strain (n_points,) [MPa]."""
        p = state.accumulated
        parts = (rule.in_tension(p) for rule in self.back_stresses)
        return self.curve.flow_stress(p) + sum(parts)

    def dissipation(self, before: PlasticState, response: Response) -> Array:
        """Return the work (n_points,) that an increment turns into heat [N mm/mm3].

        Back stresses that fade release stored work.
        """
        heat = Law.dissipation(self, before, response)
        for rule, increment in self._increments(before, response.state):
            heat = heat + rule.heat(*increment)
        return np.asarray(heat)

    def misfit(
        self, strain: Array, stress: Array, before: PlasticState, after: PlasticState
    ) -> Array:
        """Return the error of an increment, including the back stresses (n_points,) [MPa]."""
        worst = Law.misfit(self, strain, stress, before, after)
        for rule, increment in self._increments(before, after):
            worst = np.maximum(worst, np.abs(rule.misfit(*increment)).max(axis=0))
        return worst

    def _increments(
        self, before: PlasticState, after: PlasticState
    ) -> Iterator[tuple[BackStress, tuple[Array, Array, Array, Array]]]:
        """Yield each rule with old and new back stress, growth dp and flow."""
        assert isinstance(before, ChabocheState) and isinstance(after, ChabocheState)
        flow = after.plastic_strain - before.plastic_strain
        dp = after.accumulated - before.accumulated
        for rule, old, new in zip(self.back_stresses, before.back, after.back, strict=True):
            yield rule, (old, new, dp, flow)

    def respond(self, strain: Array, state: PlasticState) -> Response:
        """Return stress, consistent tangent and new state.

        Fading back stresses make the tangent unsymmetric.

        Parameters
        ----------
        strain : (n_components, n_points) total Mandel strain
        state : internal variables of the last converged state, left unchanged
        """
        assert isinstance(state, ChabocheState)
        n_components, n_points = strain.shape
        G, C = self.elasticity.shear_modulus, self.elasticity.stiffness(n_components)
        stress = C @ (strain - state.plastic_strain)
        tangent = np.repeat(C[:, :, None], n_points, axis=2)
        yielding = self.yield_value(stress, state) > 0
        at = np.flatnonzero(yielding)
        if not len(at):
            return Response(stress, tangent, state, yielding)

        known = all(isinstance(rule, ArmstrongFrederick) for rule in self.back_stresses)
        some, rules = state.at(at), cast("Any", self.back_stresses)
        step = (fading_return if known else general_return)(
            deviator(stress[:, at]), some.back, some.accumulated, rules, self.curve, G
        )
        plastic_strain, accumulated = state.plastic_strain.copy(), state.accumulated.copy()
        plastic_strain[:, at] += step.flow
        accumulated[at] += step.growth
        stress[:, at] -= 2 * G * step.flow
        back = state.back.copy()
        back[:, :, at] = step.back
        tangent[:, :, at] -= step.softening
        after = ChabocheState(plastic_strain, accumulated, back)
        return Response(stress, tangent, after, yielding)
