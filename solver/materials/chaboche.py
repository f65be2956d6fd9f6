"""Von Mises plasticity whose yield surface grows along a curve and moves by fading back stresses.

What fatigue and rail engineers use: the back stresses of Armstrong and Frederick forget, so that
repeated loading about a mean stress ratchets, and the curve lets the surface grow and saturate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.errors import ModelError
from solver.materials.elasticity import Elasticity
from solver.materials.law import Law
from solver.materials.radial_return import SQRT23
from solver.materials.scalar import multiplier
from solver.materials.state import PlasticState, Response
from solver.tensors import deviator, identity, von_mises

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.materials.curves import Curve

    Array = NDArray[np.float64]


class BackStress(NamedTuple):
    """Armstrong and Frederick's rule: dX = 2/3 C d(plastic strain) - gamma X dp.

    ``modulus`` C [MPa]: initial slope in tension. ``recall`` gamma: how fast it forgets; 0 is
    Prager's rule. In tension it tends to C / gamma.
    """

    modulus: float
    recall: float = 0.0


@dataclass(frozen=True, slots=True)
class ChabocheState(PlasticState):
    """Internal variables, with the back stresses (n_back, n_components, n_points) [MPa].

    Each is 2/3 C times a strain, that of the plastic flow which is not forgotten, and is stretched
    like it.
    """

    back: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Chaboche(Law):
    """An isotropic elastic von Mises material with nonlinear mixed hardening.

    Attributes
    ----------
    elasticity : Hooke's law
    curve : size of the yield surface over the accumulated plastic strain
    back_stresses : parts of its centre; ``(C, gamma)`` each

    References
    ----------
    J.L. Chaboche, Int. J. Plasticity 5 (1989) 247-302. Backward Euler and its tangent as in
    S. Hartmann, P. Haupt, Int. J. Numer. Meth. Engng 36 (1993) 3801-3814.
    """

    elasticity: Elasticity
    curve: Curve
    back_stresses: tuple[BackStress, ...] = field(default=())

    def __post_init__(self) -> None:
        for k, (modulus, recall) in enumerate(self.back_stresses, start=1):
            for name, value in (("modulus", modulus), ("recall", recall)):
                if not (math.isfinite(value) and value >= 0):
                    allowed = "must be finite and not negative"
                    raise ModelError(f"back_stresses.{k}.{name}", value, allowed)

    # -- the law, see `Law` --------------------------------------------------------------------

    @property
    def symmetric(self) -> bool:
        """Whether no back stress fades."""
        return not any(recall for _, recall in self.back_stresses)

    @property
    def hardens(self) -> bool:
        """Whether stress grows with plastic strain without bound."""
        return math.isinf(self._limit)

    @property
    def ultimate_shear_stress(self) -> float:
        """What curve and back stresses tend to together, in shear [MPa]."""
        return self.surface.shear(self._limit)

    @property
    def _limit(self) -> float:
        ends = (C / gamma if gamma else math.inf for C, gamma in self.back_stresses if C)
        return self.curve.limit + sum(ends)

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
        parts = (C * (-np.expm1(-g * p) / g if g else p) for C, g in self.back_stresses)
        return self.curve.flow_stress(p) + sum(parts)

    def dissipation(self, before: PlasticState, response: Response) -> Array:
        """Return the work (n_points,) that an increment turns into heat [N mm/mm3].

        Back stresses that fade give what they had stored: 3 gamma / (2 C) X:X dp each.
        """
        after = response.state
        assert isinstance(after, ChabocheState)
        heat = Law.dissipation(self, before, response)
        dp = after.accumulated - before.accumulated
        for (C, gamma), X in zip(self.back_stresses, after.back, strict=True):
            if C:
                heat = heat + 1.5 * gamma / C * (X**2).sum(axis=0) * dp
        return np.asarray(heat)

    def misfit(
        self, strain: Array, stress: Array, before: PlasticState, after: PlasticState
    ) -> Array:
        """Return the error of an increment, that of the back stresses included [MPa]."""
        assert isinstance(before, ChabocheState) and isinstance(after, ChabocheState)
        worst = Law.misfit(self, strain, stress, before, after)
        flow = after.plastic_strain - before.plastic_strain
        dp = after.accumulated - before.accumulated
        for (C, gamma), old, new in zip(self.back_stresses, before.back, after.back, strict=True):
            off = new - old - 2 / 3 * C * flow + gamma * dp * new
            worst = np.maximum(worst, np.abs(off).max(axis=0))
        return worst

    def respond(self, strain: Array, state: PlasticState) -> Response:
        """Return stress, tangent and new state by the radial return.

        With the back stresses X at the beginning, the direction of flow is that of

            xi(dp) = deviator of the trial stress - sum of X / (1 + gamma dp)

        and ``sqrt(3/2) |xi| = R(p + dp) + (3 G + sum of C / (1 + gamma dp)) dp`` gives dp. Fading
        back stresses make the tangent unsymmetric.

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

        some = state.at(at)
        step = self._step(deviator(stress[:, at]), some, G)
        plastic_strain, accumulated = state.plastic_strain.copy(), state.accumulated.copy()
        plastic_strain[:, at] += step.flow
        accumulated[at] += step.growth
        stress[:, at] -= 2 * G * step.flow
        back = state.back.copy()
        C_back, gamma = self._constants
        grown = some.back + 2 / 3 * C_back[..., None] * step.flow
        back[:, :, at] = grown / (1 + gamma * step.growth)[:, None]

        one = identity(n_components)
        projection = np.eye(n_components) - np.outer(one, one) / 3.0
        u = step.direction
        aside = step.turn - (u * step.turn).sum(axis=0) * u
        along = u[:, None] * u[None]
        mixed = aside[:, None] * u[None]
        shrunk = 2 * G * step.growth / (SQRT23 * step.size)
        tangent[:, :, at] -= (
            2
            * G
            * (
                shrunk * (projection[:, :, None] - along + mixed / (SQRT23 * step.slope))
                + 3 * G / step.slope * along
            )
        )
        after = ChabocheState(plastic_strain, accumulated, back)
        return Response(stress, tangent, after, yielding)

    @property
    def _constants(self) -> Array:
        """C and gamma of the back stresses (2, n_back, 1)."""
        return np.reshape(self.back_stresses, (-1, 2)).T[:, :, None]

    def _step(self, s: Array, state: ChabocheState, G: float) -> _FlowStep:
        """Return the plastic flow of points from their trial deviator (n_components, n)."""
        C, gamma = self._constants

        def relative(growth: Array) -> tuple[Array, Array, Array]:
            fade = 1 + gamma * growth
            xi = s - (state.back / fade[:, None]).sum(axis=0)
            turn = (state.back * (gamma / fade**2)[:, None]).sum(axis=0)
            return fade, xi, turn

        def excess(growth: Array) -> tuple[Array, Array]:
            fade, xi, turn = relative(growth)
            q, p = von_mises(xi), state.accumulated + growth
            stiff = 3 * G + (C / fade).sum(axis=0)
            slope = 3 * G + (C / fade**2).sum(axis=0) + self.curve.slope(p)
            slope -= 1.5 * (xi * turn).sum(axis=0) / q
            return q - self.curve.flow_stress(p) - stiff * growth, -slope

        first, _ = excess(np.zeros(s.shape[1]))
        # what heat has left of a back stress beyond C / gamma fades in favour of the excess
        for X, (modulus, recall) in zip(state.back, self.back_stresses, strict=True):
            if recall:
                first = first + np.maximum(von_mises(X) - modulus / recall, 0.0)
        growth = multiplier(excess, first / (3 * G) * (1 + 1e-9), von_mises(s))
        _, xi, turn = relative(growth)
        size = np.sqrt((xi**2).sum(axis=0))
        u = xi / size
        return _FlowStep(growth, growth * u / SQRT23, u, size, turn, -excess(growth)[1])


class _FlowStep(NamedTuple):
    """An increment of flow at points.

    ``growth`` dp (n,); ``flow`` plastic strain (n_components, n); ``direction`` and ``size`` of
    xi; ``turn`` its derivative by dp; ``slope`` minus that of the yield function (n,).
    """

    growth: Array
    flow: Array
    direction: Array
    size: Array
    turn: Array
    slope: Array
