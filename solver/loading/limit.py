"""Proof of a limit load: a motion on which the load does more work than can be dissipated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import linalg

from solver.contact.candidates import Candidates
from solver.contact.state import State
from solver.contact.system import System
from solver.fem.deformation import PartResponse
from solver.fem.discretisation import Discretisation
from solver.fem.part import Part
from solver.loading.outcome import Mechanism
from solver.loading.step import moving
from solver.tensors import deviator
from solver.typing import Array

Vectors = Sequence[Array]


_ELSE = 0.01
"""Work of a motion on change of volume, overlap and violation of links, over its dissipation, at
most. The forces that resist them are unknown; the motion is a proof only if they hardly matter."""
_SINGULAR = 1e-7
"""Tangent over elastic stiffness along a step: the tangent is singular below this ratio."""
_MECHANISM = 1e-2
"""The same ratio for bodies without load."""
_MOVES = 1e-3
"""Elastic energy of a part in a step over that of all parts: the part moves above this ratio."""
_SPENT = 0.95
"""Tangential force of a pair over its friction bound: a message gives a hint above this ratio."""
_ALONG = 0.05
"""Normal motion over all motion of the contact points in a slide, at most: deformed surfaces are
not quite straight."""


def mechanism(
    system: System,
    time: float,
    step: Vectors,
    responses: Sequence[PartResponse],
    residuals: Vectors,
    candidates: Candidates,
    level: float,
) -> Mechanism:
    """Return a motion of all parts as a mechanism, with its ratio of powers.

    By the kinematic theorem of limit analysis no equilibrium exists if the load does more work on a
    motion than any stress inside the yield surfaces. This also holds at corners of the surface.
    With s the present deviator of stress and r the out-of-balance forces without contact:

    1. A part with unbounded stress moves as a rigid body only: the rest of its motion is left out,
       and appears as a gap or overlap in step 4.
    2. Power of the load on each part: r v + the integral of s e, with e the strain of the motion v.
       This is the power of the external forces; the mean stress does no work if the volume is
       constant.
    3. Power of plastic flow: the integral of the largest work of a stress on e. The mean stress may
       differ from the present one by up to the tensile strength.
    4. Power of contact and links: no pressure acts where surfaces part. An overlap and the
       violation of a link are resisted by the whole force level at each vertex, slip by the
       friction bound under the present normal forces.

    Parameters
    ----------
    step : displacements of each part, zero where motions are prescribed [mm]
    residuals : external minus internal forces of each part, without contact forces [N]
    candidates : contact, with the normal forces that bound friction
    level : force level [N]
    """
    load, swelling, v, flow = 0.0, 0.0, [], []
    place: list[tuple[float, ...]] = []
    each = zip(system.parts, step, responses, residuals, candidates.pushes, strict=True)
    for part, u, response, residual, push in each:
        law = part.law(time) if isinstance(part, Discretisation) else None
        flows = law is not None and np.isfinite(law.ultimate_shear_stress)
        v.append(u if flows else moving(part, u))
        load += float((residual + push) @ v[-1])
        flow.append(0.0)
        place.append((np.nan, np.nan))
        if not flows:
            continue
        assert isinstance(part, Discretisation) and law is not None
        strain, surface = response.deformation.change(u), law.surface
        if part.body.kinematics == "plane_stress":
            strain[2] = -strain[0] - strain[1]
        tension = law.ultimate_shear_stress / surface.shear(1.0)
        flow[-1] = float(tension * surface.power(strain) @ part.volumes)
        place[-1] = tuple(part.positions[:, (strain**2).sum(axis=0).argmax()].tolist())
        swelling += float(tension * np.abs(strain[:3].sum(axis=0)) @ part.volumes)
        load += float((response.law.stress * deviator(strain)).sum(axis=0) @ part.volumes)
    rates = np.sum([candidates.of_part(k, u) for k, u in enumerate(v)], axis=0)
    apart, normal = rates[: candidates.n], candidates.forces[: candidates.n]
    held = np.abs(np.minimum(apart, 0.0)).sum() + np.abs(rates[candidates.linked]).sum()
    bound = candidates.lines.least(normal)[: rates[candidates.along].size]
    friction = float(bound @ np.abs(rates[candidates.along]))
    besides = swelling + level * float(held)
    if not load > 0 or besides >= _ELSE * (sum(flow) + friction):
        return Mechanism()
    weakest = int(np.argmax(flow))
    return Mechanism(
        ratio=load / (sum(flow) + friction + besides),
        body=system.parts[weakest].body.name,
        place=place[weakest],
    )


def slide(system: System, residuals: Sequence[Array], candidates: Candidates) -> Mechanism | None:
    """Return the slide of a floating body under the normal forces of the candidates, if any.

    Motions go along all closed contacts, so that they do not change normal forces. Deformed
    surfaces are not quite straight, so the power of normal forces counts too.

    Parameters
    ----------
    residuals : external minus internal forces of each part, without contact forces [N]
    """
    n = candidates.n
    N = candidates.forces[:n]
    closed = N > 0
    if not closed.any():
        return None
    bound = candidates.lines.least(N)
    for i, part in enumerate(system.parts):
        motion = candidates.of_part(i, part.rigid)
        if not candidates.frictional or not motion.size or motion[candidates.linked].any():
            continue
        _, apart, ways = linalg.svd(motion[:n][closed])
        apart = np.append(apart, np.zeros(len(ways) - len(apart)))
        along = ways[apart <= _ALONG * np.linalg.norm(motion, 2)].T
        load = along.T @ (part.rigid.T @ (residuals[i] + candidates.pushes[i]))
        for way in (*np.eye(len(load)), load):
            power = abs(float(load @ way))
            moved = motion @ along @ way
            most = float(bound @ np.abs(moved[candidates.along])) + abs(float(N @ moved[:n]))
            if power > most > 0:
                return Mechanism(ratio=power / most, body=part.body.name, slides=True)
    return None


def is_singular(
    parts: Sequence[Part], time: float, step: Vectors, responses: Sequence[PartResponse]
) -> bool:
    """Whether a part has so little stiffness along a step that rounding determines the step.

    Bodies without load get a coarser limit: overlapping bodies push each other apart by a given
    distance, and without stiffness the plastic strain that achieves this is not unique.
    """
    loaded = any(part.external(time).any() for part in parts)
    each = zip(parts, step, responses, strict=True)
    tangent, elastic = np.array([part.stiffness_along(du, found) for part, du, found in each]).T
    moves = elastic > _MOVES * elastic.sum()
    least = _SINGULAR if loaded else _MECHANISM
    return bool((tangent < least * elastic)[moves].any())


def spent(system: System, state: State) -> str:
    """Return a hint on pairs that are close to their friction bound in a state; else empty."""
    found = []
    for k, (interface, contact) in enumerate(zip(system.interfaces, state.contacts, strict=True)):
        pairing = system.pairing(state, k)
        lines = system.bound(k, pairing, state, state.time).over(pairing.area)
        most = float(lines.least(contact.normal)[contact.normal > 0].sum())
        share = abs(float(contact.tangential.sum())) / most if most > 0 else 0.0
        if share > _SPENT:
            names = [system.all_names[k] for k in (interface.slave, interface.master)]
            found.append(f"{' and '.join(names)} was at {share:.0%} of its bound")
    return f"; just before, friction between {', '.join(found)}" if found else ""
