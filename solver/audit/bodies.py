"""Audit figures of single bodies: motion, balance, material law, loads and reactions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np

from solver.audit.pairs import AuditedPair
from solver.audit.plain import LEAST, PlainBody, load_factor
from solver.audit.surfaces import deformed
from solver.contact.candidates import find_candidates
from solver.contact.state import Converged
from solver.contact.system import System
from solver.fem.discretisation import Discretisation
from solver.fem.fields import elastic_energy
from solver.fem.nodes import vectors
from solver.fem.rigid import RigidPart
from solver.fem.wheel import Wheel
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
        force = self._system.links.at(state.u).on_part(number, state.links, self.part.n)
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
            if body.large and not body.turns(load):
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
        strain = LEAST * self.plain.steepest * np.abs(u).max()
        if self.plain.body.large:
            strain = max(strain, _STRAINED)
        rounded = law.elasticity.youngs_modulus * strain
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


_STRAINED = 1e-9
"""Logarithmic strain of an elastic body at rest: below it its rounding would count as a misfit."""
_ROUNDED = 1e-5
"""Rounding that is subtracted from nodal forces, over the force level, at most."""
_LITTLE = 1e-4
"""Least force to which errors refer, over the force level."""


def _on_bodies(system: System, converged: Converged) -> dict[str, Array]:
    """Return the nodal forces (n_nodes, 2) of contact on each whole body, in its own frame [N]."""
    state = converged.state
    unlinked = np.zeros_like(state.links)
    candidates = find_candidates(system, state, state.u, state.contacts, unlinked)
    out = {}
    for body in system.model.bodies:
        i = system.part(body.name)
        part = system.parts[i]
        force = candidates.on_part(i, candidates.forces, part.n)
        out[body.name] = vectors(part.on_whole(force), system.full(body.name).dim).T
    return out


def imbalance(system: System, bodies: Sequence[AuditedBody], converged: Converged) -> float:
    """Return the out-of-balance force, minus rounding, over the force level.

    It is the sum of external, internal and contact forces at nodes.
    """
    contact = _on_bodies(system, converged)
    each = [_beyond_rounding(body, contact[body.name] - body.lacking) for body in bodies]
    return float(np.linalg.norm(each)) / (converged.state.force_scale or 1.0)


def _beyond_rounding(body: AuditedBody, force: Array) -> float:
    """Return the norm of forces (n_nodes, 2) on free unknowns, minus rounding [N].

    At most the share `_ROUNDED` of the force level is subtracted, because the rounding of a body
    that has flowed far may be large.
    """
    rounding = min(body.rounding, _ROUNDED * body.force_level)
    return max(float(np.linalg.norm(force[body.free])) - rounding, 0.0)


def imbalance_released(bodies: Sequence[AuditedBody]) -> float:
    """Return the out-of-balance force of released bodies at free nodes [N].

    Neither loads nor contact act on them: their stress must balance itself and links.
    """
    each = [_beyond_rounding(body, body.balancing - body.linked) for body in bodies]
    return float(np.linalg.norm(each))


def _of_pairs(body: AuditedBody, pairs: Sequence[AuditedPair]) -> tuple[Array, Bools]:
    """Return the nodal forces (n_nodes, dim) of the pairs on a body in the fixed frame [N].

    The second array (n_nodes,) is whether they act on a node.
    """
    whole = body.plain.part
    force = np.zeros(whole.X.T.shape)
    for pair in pairs:
        surfaces, measured = pair.surfaces, pair.measured
        for (name, _), chain, nodal in (
            (surfaces.pair.slave, surfaces.slave, measured.on_slave),
            (surfaces.pair.master, surfaces.master, measured.on_master),
        ):
            if name == body.name:
                np.add.at(force, chain.nodes, nodal)
    return force, (force != 0).any(axis=1)


def action_reaction(
    system: System,
    bodies: Sequence[AuditedBody],
    pairs: Sequence[AuditedPair],
    converged: Converged,
) -> float:
    """Return the relative difference between contact forces and the forces that balance stress.

    For both bodies of every pair, resultant and moment of the contact forces are compared with
    those of the nodal forces that balance the stress at the contact surfaces. Differences are
    divided by the normal force of the body's least loaded pair (the moment also by the length of
    the contact).
    """
    scale = _LITTLE * converged.state.force_scale
    turning = any(pair.surfaces.finite for pair in pairs)
    worst = 0.0
    for body in bodies:
        own = [pair for pair in pairs if body.name in pair.bodies]
        expected, nodes = _of_pairs(body, own)
        level = max(scale, min((pair.force for pair in own if pair.force), default=0.0))
        if not nodes.any() or level == 0.0:
            continue
        x, Q = deformed(system, body.name, converged.state)
        felt = body.lacking @ Q.T
        miss = np.where(body.held, 0.0, felt - expected)[nodes]
        x = x if turning else body.plain.part.X
        arm = x[:, nodes].T - x[:, nodes].mean(axis=1)
        size = float(np.abs(arm).max()) or 1.0
        moment = float((arm[:, 0] * miss[:, 1] - arm[:, 1] * miss[:, 0]).sum()) / size
        worst = max(worst, float(np.abs(miss.sum(axis=0)).max()) / level, abs(moment) / level)
    return worst


def reactions(
    bodies: Sequence[AuditedBody], pairs: Sequence[AuditedPair], converged: Converged
) -> float:
    """Return the sum of loads, forces of contact and links, and reactions, over the force level.

    The resultant of pressures follows from the shape of their boundary, that of forces per volume
    from other integration points, that of a wheel from the amplitude of its axle; reactions follow
    from the stress at supports. First moments of nodal forces are compared with those of the loads.
    """
    worst = 0.0
    for body in bodies:
        contact, _ = _of_pairs(body, pairs)
        total = contact.sum(axis=0)
        if isinstance(body.part, Wheel):
            # the advance is prescribed: its force along x is unknown
            force = body.part.axle.force.at(converged.state.time)
            total = np.array([0.0, total[1] - force])
        else:
            held = np.where(body.held, contact - body.lacking, 0.0)
            total = total + body.applied() + body.linked.sum(axis=0) - held.sum(axis=0)
            if body.plain.body.kinematics == "axisymmetric":
                total[0] = 0.0  # radial forces balance around the axis
        worst = max(worst, float(np.abs(total).max()), float(np.abs(body.misapplied()).max()))
    return worst / (converged.state.force_scale or 1.0)
