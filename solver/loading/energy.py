"""Energy balance: work of the loads, stored energy, plastic work, work of friction.

Each term is integrated by the trapezoidal rule over increments. Virtual work then makes

    external work = change of stored energy + plastic work + work of friction and against contact

exactly if contact normals are fixed (small sliding). If they rotate, the difference is the error of
this integration.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from solver.contact.state import Converged, Energy
from solver.contact.system import System
from solver.fem.discretisation import Discretisation
from solver.fem.part import Part
from solver.fem.rigid import RigidPart
from solver.materials.state import PlasticState, Response


def worked(system: System, before: Converged, now: Converged, least: float | None = None) -> Energy:
    """Return the work since the lap began, up to the end of the increment ``now``.

    ``least`` is the least scale, by default the rounding level of `System.least`.
    """
    parts = system.parts
    moves = zip(before.state.u, now.state.u, before.forces, now.forces, strict=True)
    work = sum(float((f0 + f1) @ (u1 - u0)) / 2 for u0, u1, f0, f1 in moves)
    work -= _heat(parts, before, now)
    work -= _spread(system, before, now)
    work += _turned(system, before, now) + _linked(system, before, now)
    so_far = before.energy
    terms = {
        "external": so_far.external + work,
        "plastic": so_far.plastic + _plastic_work(parts, before, now),
        "friction": so_far.friction + now.contact_work[0],
        "contact": so_far.contact + now.contact_work[1] + _released(system, before, now),
        "supplied": so_far.supplied + max(work, 0.0),
    }
    least = system.least(now.state.time)[1] if least is None else least
    scale = max(so_far.scale, least, *map(abs, terms.values()))
    return Energy(stored=so_far.stored, scale=scale, **terms)


def _released(system: System, before: Converged, now: Converged) -> float:
    """Return the work on contact forces that vanish because the bodies are separated [N mm].

    The forces of links do not vanish.
    """
    if not now.separated:
        return 0.0
    work, links, joins = 0.0, before.state.links, system.links.at(before.state.u)
    moves = zip(before.state.u, now.state.u, before.contact_forces, strict=True)
    for k, (u0, u1, force) in enumerate(moves):
        work -= float((force - joins.on_part(k, links, len(force))) @ (u1 - u0)) / 2
    return work


def _heat(parts: Sequence[Part], before: Converged, now: Converged) -> float:
    """Return the work of stress on the change of eigenstrain and of the elastic constants [N mm].

    With elastic strains e0, e1 and stresses s0, s1 at both ends, the energy grows by exactly
    (s0 + s1) (e1 - e0) / 2 + (s1 e0 - s0 e1) / 2. The second term is zero for constant stiffness.
    """
    times = before.state.time, now.state.time
    work = 0.0
    for part, old, new in zip(parts, before.responses, now.responses, strict=True):
        if not isinstance(part, Discretisation):
            continue
        grown = part.eigenstrain(times[1]) - part.eigenstrain(times[0])
        if grown.any():
            work += float(((old.stress + new.stress) * grown).sum(axis=0) @ part.volumes) / 2
        old_law, law = (part.law(time) for time in times)
        if old_law is not law:
            both, *each = (
                (found := law.elasticity.energy_density(stress)) / law.stiff - found / old_law.stiff
                for stress in (old.stress + new.stress, old.stress, new.stress)
            )
            work += float((both - each[0] - each[1]) @ part.volumes) / 2
    return work


def _spread(system: System, before: Converged, now: Converged) -> float:
    """Return the work of normal forces on changes of prescribed gaps [N mm]."""
    work = 0.0
    for k, interface in enumerate(system.interfaces):
        offset = interface.declared.offset
        force = before.state.contacts[k].normal.sum() + now.state.contacts[k].normal.sum()
        work += float(force) / 2 * (offset(now.state.time) - offset(before.state.time))
    return work


def _turned(system: System, before: Converged, now: Converged) -> float:
    """Return the work on rotating rigid bodies minus the work of the mean moments [N mm].

    Under small sliding contact forces keep their directions while a body rotates. Their work is the
    mean force times the motion of the surface, which mean moment times rotation does not equal.
    """
    work = 0.0
    for k, interface in enumerate(system.interfaces):
        for side, (number, part, surface) in enumerate(interface.sides):
            small = None if now.state.contacts[k].finite else interface.reference
            if small is None or not isinstance(part, RigidPart):
                continue
            u0, u1 = before.state.u[number], now.state.u[number]
            rows = small.normal[side], small.tangent[side]
            forces = [
                contacts.normal @ rows[0] + contacts.tangential @ rows[1]
                for contacts in (before.state.contacts[k], now.state.contacts[k])
            ]
            moved = (part.motion(surface, u1) - part.motion(surface, u0)).T.ravel()
            resultants = [
                force @ part.pull_back(surface, u, np.eye(len(force)), 0)[1]
                for force, u in zip(forces, (u0, u1), strict=True)
            ]
            work -= float(np.sum(forces, 0) @ moved - np.sum(resultants, 0) @ (u1 - u0)) / 2
    return work


def _linked(system: System, before: Converged, now: Converged) -> float:
    """Return the work of turning links that the trapezoidal rule makes out of nothing [N mm].

    Their forces on all parts work as the energy of their springs falls, but on a way that turns
    the mean forces times the displacements do not.
    """
    if not system.links.turn:
        return 0.0
    work = system.links.energy(now.state.links) - system.links.energy(before.state.links)
    both = [(system.links.at(of.state.u), of.state.links) for of in (before, now)]
    for k, (u0, u1) in enumerate(zip(before.state.u, now.state.u, strict=True)):
        force = sum(links.on_part(k, own, len(u0)) for links, own in both)
        work += float(force @ (u1 - u0)) / 2
    return work


def plastic_work(
    part: Part, before: PlasticState, response: Response, time: float
) -> tuple[float, float]:
    """Return plastic work [N mm] and least dissipation at a point [N mm/mm3] of an increment."""
    if not isinstance(part, Discretisation):
        return 0.0, 0.0
    flow = response.state.plastic_strain - before.plastic_strain
    work = (response.stress * flow).sum(axis=0) @ part.volumes
    return float(work), float(part.law(time).dissipation(before, response).min())


def _plastic_work(parts: Sequence[Part], before: Converged, now: Converged) -> float:
    each = zip(parts, now.start.plastic, before.responses, now.responses, strict=True)
    work = 0.0
    for part, plastic, old, new in each:
        flow = new.state.plastic_strain - plastic.plastic_strain
        if flow.any():
            work += float(((old.stress + new.stress) * flow).sum(axis=0) @ part.volumes) / 2
    return work
