"""Any law at points where heat has lowered Young's modulus and the yield stress.

With Young's modulus e E and yield stress r Re the response follows from that of the cold law::

    stress(strain) = r stress0(strain e / r),   tangent = e tangent0

So every slope of the curve falls with Young's modulus, and its stresses fall with the yield stress.
A change of temperature leaves plastic strain unchanged, and also the strains of back stresses:
Prager's back stress is 2/3 e H times the plastic strain at any temperature, and the back stresses
of `Chaboche` fall with Young's modulus too.
"""

from __future__ import annotations

from dataclasses import dataclass

from solver.materials.law import Law, Wrapped
from solver.materials.state import PlasticState, Response
from solver.typing import Array, Ints


@dataclass(frozen=True, slots=True, kw_only=True)
class Heated(Wrapped):
    """A law with less stiffness and strength at each point.

    Attributes
    ----------
    law : the law at the temperature for which its constants are given; the constants of this law,
        such as ``yield_stress``, are the same
    stiff, strong : (n_points,) factors of Young's modulus and of the yield stress
    """

    law: Law
    stiff: Array
    strong: Array

    @property
    def ultimate_shear_stress(self) -> float:
        """Ultimate shear stress of the strongest point [MPa]."""
        return self.law.ultimate_shear_stress * float(self.strong.max())

    @property
    def _stretch(self) -> Array:
        return self.stiff / self.strong

    def at(self, points: Ints) -> Heated:
        """Return the law of some points."""
        law = self.law.at(points)
        return Heated(law=law, stiff=self.stiff[points], strong=self.strong[points])

    def flow_stress(self, state: PlasticState) -> Array:
        """Return the size of the yield surface (n_points,) [MPa]."""
        return self.strong * self.law.flow_stress(state.stretched(self._stretch))

    def back_stress(self, state: PlasticState) -> Array:
        """Return the centre of the yield surface (n_components, n_points), Mandel [MPa]."""
        return self.strong * self.law.back_stress(state.stretched(self._stretch))

    def strength(self, state: PlasticState) -> Array:
        """Return the stress of the tension curve (n_points,) [MPa]."""
        return self.strong * self.law.strength(state.stretched(self._stretch))

    def yield_value(self, stress: Array, state: PlasticState) -> Array:
        """Return the yield function (n_points,) [MPa]."""
        own = self.law.yield_value(stress / self.strong, state.stretched(self._stretch))
        return self.strong * own

    def dissipation(self, before: PlasticState, response: Response) -> Array:
        """Return the work (n_points,) that an increment turns into heat [N mm/mm3]."""
        k = self._stretch
        own = response._replace(
            stress=response.stress / self.strong, state=response.state.stretched(k)
        )
        return self.law.dissipation(before.stretched(k), own) * self.strong / k

    def misfit(
        self, strain: Array, stress: Array, before: PlasticState, after: PlasticState
    ) -> Array:
        """Return the error of an increment by this law (n_points,) [MPa]."""
        k = self._stretch
        own = strain * k, stress / self.strong, before.stretched(k), after.stretched(k)
        return self.strong * self.law.misfit(*own)

    def respond(self, strain: Array, state: PlasticState) -> Response:
        """Return stress, tangent and new state; points with lowered stiffness count as yielding."""
        k = self._stretch
        before = state.stretched(k)
        own = self.law.respond(strain * k, before)
        return Response(
            stress=self.strong * own.stress,
            tangent=self.stiff * own.tangent,
            state=state.stepped(before, own.state, k, own.yielding),
            yielding=own.yielding | (self.stiff != 1.0),
        )
