"""Audit figures of single bodies: motion, balance, material law, loads and reactions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np

from solver.audit.plain import LEAST, PlainBody, load_factor
from solver.contact.state import Converged
from solver.contact.system import System
from solver.fem.discretisation import Discretisation
from solver.fem.dofs import vectors
from solver.fem.fields import elastic_energy
from solver.fem.rigid import RigidPart
from solver.materials.law import Law
from solver.model.rigid import Moved
from solver.typing import Array, Bools


class AuditedBody:
    """A body of a system in a converged increment.

    ``plain`` evaluates the body independently; all states of the body share it.
    """

    def __init__(self, system: System, plain: PlainBody, converged: Converged) -> None:
        self.plain = plain
        self.name = plain.body.name
        number = system.part(self.name)
        self.part = system.parts[number]
        self._system = system
        self._converged = converged
        self._u = converged.state.u[number]
        self._response = converged.responses[number]
        self._before = converged.start.plastic[number]

    @property
    def meshed(self) -> bool:
        """Whether the body is not condensed: the system solves for all of its nodes."""
        return isinstance(self.part, Discretisation)

    @property
    def _displacement(self) -> Array:
        """Displacements (n,) of the whole body [mm]."""
        return self._system.displacement(self.name, self._converged.state)

    @cached_property
    def _law(self) -> Law:
        return self.plain.law(self._converged.state.time)

    @cached_property
    def _reached(self) -> Array:
        """Mandel strain (n_components, n_points) from displacements, without eigenstrain."""
        state = self._converged.state
        strain = self.plain.strain(self._displacement)
        return strain.reshape(len(strain), -1) - self.plain.eigenstrain(state.time)

    @cached_property
    def stress(self) -> Array:
        """Mandel stress (n_components, n_points) [MPa], by Hooke's law if the body is condensed."""
        if self.meshed:
            return self._response.stress
        return self.plain.body.law.stiffness(len(self._reached)) @ self._reached

    @property
    def force_level(self) -> float:
        """The largest force level so far [N]."""
        return self._converged.state.force_scale

    @property
    def rounding(self) -> float:
        """The nodal force that rounding can cause [N]."""
        return self.plain.part.rounding(self._displacement)

    @cached_property
    def balancing(self) -> Array:
        """Nodal forces (n_nodes, dim) that balance the stress of the body [N]."""
        return self.plain.forces(self.stress, self._displacement)

    @property
    def force_of_removed(self) -> float:
        """Norm of the nodal forces that removed elements still transmit [N]."""
        kept = np.isfinite(self.plain.known(self.stress, self._converged.state.time))
        if kept.all():
            return 0.0
        removed = self.plain.forces(np.where(kept, 0.0, self.stress), self._displacement)
        return float(np.linalg.norm(removed))

    @cached_property
    def linked(self) -> Array:
        """Nodal forces (n_nodes, dim) of links on the whole body [N]."""
        number, state = self._system.part(self.name), self._converged.state
        force = self._system.links.on_part(number, state.links, self.part.n)
        return vectors(self.part.on_whole(force), self.plain.part.dim).T

    @cached_property
    def lacking(self) -> Array:
        """Nodal forces (n_nodes, dim) that contact and supports must exert for balance [N]."""
        whole = self.plain.part
        wheel = self.plain.body.axle is not None  # the load of a wheel acts on its hub
        external = np.zeros(whole.n) if wheel else self._external
        return self.balancing - vectors(external, whole.dim).T - self.linked

    @cached_property
    def _external(self) -> Array:
        """Nodal forces (n,) of the loads [N]."""
        return self.plain.part.external(self._converged.state.time, self._displacement)

    def applied(self) -> Array:
        """Return the resultant of the loads (dim,) [N]."""
        return np.asarray(self._declared[0])

    @cached_property
    def _declared(self) -> Array:
        return self.plain.applied(self._converged.state.time, self._displacement)

    def misapplied(self) -> Array:
        """Return the error (dim, dim) of first moments of nodal forces, over the body's size [N].

        First moments, force times position, also show loads without a resultant, such as
        centrifugal forces. Wheels are left out.
        """
        body, whole = self.plain.body, self.plain.part
        if body.axle:
            return np.zeros((2, 2))
        # forces at the places before loading; with large strain others follow
        fixed = np.zeros(whole.n) if body.large else self._external
        for load, field in zip(whole.loads.cases, whole.loads.fields.T, strict=True):
            if body.large and not load.follows:
                fixed += load_factor(load.amplitude, self._converged.state.time) * field
        follows = vectors(self._external - fixed, whole.dim)
        moments = self.plain.moments(vectors(fixed, whole.dim), whole.X) - self._declared
        if body.large:
            x = whole.X + vectors(self._displacement, whole.dim)
            moments += self.plain.moments(follows, x)
        return np.asarray(moments[1:] / body.box.max())

    @cached_property
    def held(self) -> Bools:
        """Whether supports hold, or loads prescribe, displacements (n_nodes, dim)."""
        return np.isfinite(self.plain.prescribed(self._converged.state.time))

    @property
    def free(self) -> Bools:
        """Whether unknowns (n_nodes, dim) are free."""
        return np.asarray(~self.held)

    def stored(self) -> float:
        """Return the elastic energy [N mm], from the kept unknowns if the body is condensed."""
        if self.meshed:
            return self.plain.elastic_energy(self.stress, self._converged.state.time)
        return elastic_energy(self.part, self._u, self._response, self._converged.state.time)

    @property
    def strength(self) -> float:
        """The yield stress, or the largest stress of an elastic body [MPa].

        The latter is at least the rounding of stress in a body that moves without strain.
        """
        law = self.plain.body.law
        if not law.elastic:
            return law.yield_stress
        u = self._displacement
        rounded = LEAST * law.elasticity.youngs_modulus * self.plain.steepest * np.abs(u).max()
        return float(max(np.abs(self.stress).max(), rounded))

    def law(self) -> tuple[float, float]:
        """Return the misfit of the increment to its law, and its stress beyond yield [MPa]."""
        if not self.meshed:
            return 0.0, 0.0
        law, after = self._law, self._response.state
        broken = law.misfit(self._reached, self.stress, self._before, after)
        beyond = law.yield_value(self.stress, after)
        return float(broken.max(initial=0.0)), float(beyond.max(initial=0.0))


def misplaced(system: System, bodies: Sequence[PlainBody], states: Iterable[Converged]) -> float:
    """Return the largest deviation from a prescribed displacement, over the largest displacement.

    Supports and loads prescribe displacements of bodies, and motions those of rigid bodies.
    """
    off, most = [0.0], [0.0]
    for state in (converged.state for converged in states):
        for body in bodies:
            u = vectors(system.displacement(body.body.name, state), body.part.dim).T
            given = body.prescribed(state.time)
            off += np.abs(u - given)[np.isfinite(given)].tolist()
            most.append(float(np.abs(u).max()))
        for rigid in system.model.rigid:
            number = system.part(rigid.name)
            part = system.parts[number]
            assert isinstance(part, RigidPart)
            sizes = 1.0, 1.0, part.frame.radius
            for motion, own, size in zip(rigid.every_load, state.u[number], sizes, strict=True):
                most.append(abs(float(own)))
                if isinstance(motion, Moved):
                    moved = size * load_factor(motion.amplitude, state.time) * motion.value
                    off.append(abs(float(own) - moved))
    return float(np.max(off)) / (float(np.max(most)) or 1.0)
