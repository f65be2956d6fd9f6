"""Balance of forces: at every node, between bodies in contact, and of each body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from solver.audit.bodies import AuditedBody
from solver.audit.pairs import AuditedPair
from solver.audit.surfaces import deformed
from solver.contact.candidates import find_candidates
from solver.contact.state import Converged
from solver.contact.system import System
from solver.fem.dofs import vectors
from solver.fem.wheel import Wheel
from solver.typing import Array, Bools

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
