"""What each body must satisfy by itself: balance, its law, its loads and reactions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.audit.law import excess, hooke, increment_error, law_error, of_state
from solver.audit.plain import PlainBody
from solver.kinematics import to_tensor
from solver.substructure import Substructure

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.outcome import Converged
    from solver.state import State
    from solver.system import System

    Array = NDArray[np.float64]

_SAMPLE = 200
"""Flowing points at which an increment is followed in smaller steps."""


class AuditedBody:
    """A body of a system, evaluated plainly."""

    def __init__(self, system: System, name: str) -> None:
        self.system = system
        self.name = name
        self.plain = PlainBody(system.full(name))

    @property
    def _number(self) -> int:
        return self.system.part(self.name)

    @property
    def meshed(self) -> bool:
        """Whether the increments solved for all of its nodes, and kept its internal variables."""
        return not isinstance(self.system.parts[self._number], Substructure)

    def strain(self, state: State) -> Array:
        """Return strain (4, n_elements, n_points), from the displacements."""
        return self.plain.strain(self.system.displacement(self.name, state))

    def stress(self, converged: Converged) -> Array:
        """Return stress (4, n_elements, n_points): what the increment gave, or Hooke's."""
        if self.meshed:
            return self.plain.stress(converged.responses[self._number].stress)
        body = self.plain.body
        return hooke(self.strain(converged.state), body.material, body.state)

    def imbalance(self, converged: Converged, contact: Array) -> Array:
        """Return external plus contact less internal forces (n_nodes, 2) [N]."""
        whole = self.plain.part
        external = whole.external(converged.state.load) if self._loaded else np.zeros(whole.n)
        return external.reshape(-1, 2) + contact - self.plain.forces(self.stress(converged))

    def applied(self, load: float) -> Array:
        """Return the resultant of the loads (2,) at a load factor or time [N]."""
        travelling = self.plain.body.travelling
        if travelling is None:
            return self.plain.applied(load)
        share, _, ratio = travelling.now(load)
        whole = np.pi / 2 * travelling.half_width * travelling.peak * share
        return whole * self.plain.body.thickness * np.array([ratio, -1.0])

    @property
    def _loaded(self) -> bool:
        return self.plain.body.axle is None

    @property
    def held(self) -> NDArray[np.bool_]:
        """Which displacements (n_nodes, 2) supports hold."""
        held = np.zeros((self.plain.part.X.shape[1], 2), dtype=bool)
        for boundary, axes in self.plain.body.supports.items():
            nodes = self.plain.part.boundary_nodes(boundary)
            for axis in axes:
                held[nodes, "xy".index(axis)] = True
        return held

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which unknowns (n_nodes, 2) nothing holds, copies of a periodic body left out."""
        part = self.plain.part
        own = part.same == np.arange(len(part.same))
        return np.asarray(~self.held & own[:, None])

    def stored(self, converged: Converged) -> float:
        """Return the elastic energy [N mm]; of a condensed body that of its kept unknowns."""
        part, u = self.system.parts[self._number], converged.state.u[self._number]
        if self.meshed:
            return self.plain.elastic_energy(self.stress(converged))
        return part.stiffness_along(u, converged.responses[self._number])[1] / 2

    def law(self, states: Sequence[Converged]) -> tuple[float, float]:
        """Return how far increments are from their law, and stress beyond yield, relative.

        To the yield stress, or the largest stress of a body that cannot yield.
        """
        if not self.meshed:
            return 0.0, 0.0
        body, broken, beyond, largest = self.plain.body, 0.0, 0.0, 1e-300
        for converged in states:
            response = converged.responses[self._number]
            before = of_state(converged.start.plastic[self._number])
            after = of_state(response.state)
            stress = to_tensor(response.stress)
            strain = self.strain(converged.state).reshape(4, -1)
            here = law_error(strain, stress, before, after, body.material, body.state)
            broken = float(np.maximum(broken, here))
            largest = max(largest, float(np.abs(stress).max(initial=0.0)))
            if not body.material.elastic:
                f = excess(stress, *after, body.material).max(initial=0.0)
                beyond = float(np.maximum(beyond, f))
        strength = largest if body.material.elastic else body.material.yield_stress
        return broken / strength, beyond / strength

    def increment_error(self, converged: Converged) -> float:
        """Return the change of stress that smaller steps make where it flows, over yield stress."""
        body = self.plain.body
        if not self.meshed or body.material.elastic:
            return 0.0
        response = converged.responses[self._number]
        start = converged.start.plastic[self._number]
        flowing = np.flatnonzero(response.state.accumulated > start.accumulated)
        if not len(flowing):
            return 0.0
        some = flowing[:: max(1, len(flowing) // _SAMPLE)]
        strains = tuple(
            self.strain(state).reshape(4, -1)[:, some]
            for state in (converged.start, converged.state)
        )
        plastic, accumulated = of_state(start)
        before = (plastic[:, some], accumulated[some])
        stress = to_tensor(response.stress[:, some])
        return increment_error((strains[0], strains[1]), stress, before, body.material, body.state)
