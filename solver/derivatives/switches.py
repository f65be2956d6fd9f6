"""How near a neighbouring run is to a switch: a change of what yields, touches, sticks or slides.

Of each pair of quantities that exclude each other, such as gap a and normal force b, with a >= 0,
b >= 0 and a b = 0, the number a - b keeps its sign up to the switch. Its distance from zero over
its change by a parameter tells how far the parameter may change.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from solver.contact.candidates import Candidates
from solver.contact.problem import OPEN, STICK
from solver.contact.state import Converged
from solver.contact.system import System
from solver.fem.discretisation import Discretisation
from solver.tensors import principal
from solver.typing import Array

_NOISE = 1e-10
"""Change of a number in a neighbouring run, over its scale: a smaller one may be rounding."""


def distances(system: System, now: Converged, candidates: Candidates) -> Array:
    """Return the distances (n,) of an increment from all switches, over their scales.

    They are NaN where there is no switch. The scales are the yield stress, the largest displacement
    before and after the increment, and the level of forces.
    """
    found = [*_of_flow(system, now), *_of_contact(now, candidates)]
    return np.concatenate([np.zeros(0), *(each.ravel() for each in found)])


def nearest(own: Array, other: Array) -> float:
    """Return the distance of the nearest switch, in differences of the parameter of a neighbour.

    Parameters
    ----------
    own, other : distances (n,) of the run and of the neighbour
    """
    with np.errstate(invalid="ignore"):
        change = np.abs(other - own)
    moves = change > _NOISE
    return float((np.abs(own[moves]) / change[moves]).min(initial=np.inf))


def _of_flow(system: System, now: Converged) -> Iterator[Array]:
    """Yield for each body: stress below yield, or flow; of flow with corners, also from these."""
    each = zip(system.parts, now.start.plastic, now.responses, strict=True)
    for part, before, response in each:
        if not isinstance(part, Discretisation) or part.body.law.elastic:
            continue
        law, after = part.law(now.state.time), response.state
        strength, stiffness = law.yield_stress, 2 * law.elasticity.shear_modulus
        flow = stiffness * (after.accumulated - before.accumulated)
        yield (-law.yield_value(response.stress, after) - flow) / strength
        if law.surface.has_corners:
            high, middle, low = principal(response.stress - law.back_stress(after))[0]
            aside = stiffness * principal(after.plastic_strain - before.plastic_strain)[0][1]
            edges = np.stack([high - middle - aside.clip(0), middle - low + aside.clip(None, 0)])
            yield np.where(response.yielding, edges / strength, np.nan)


def _of_contact(now: Converged, candidates: Candidates) -> Iterator[Array]:
    """Yield for each pair: gap or normal force; shear below its bound, or slip; lines of bounds."""
    every = (*now.start.u, *now.state.u)
    length = max((float(np.abs(u).max(initial=0.0)) for u in every), default=0.0) or 1.0
    force, n = now.state.force_scale or 1.0, candidates.n
    normal, status = candidates.forces[:n], candidates.status
    found = [candidates.motion[:n] / length - normal / force]
    if candidates.frictional:
        lines = candidates.lines.slope * normal + candidates.lines.level
        below = candidates.lines.least(normal) - np.abs(candidates.forces[candidates.along])
        slip, slides = np.abs(candidates.motion[candidates.along]), status > STICK
        found.append(np.where(slides, -slip / length, below / force))
        found[-1][status == OPEN] = np.nan
        found += [np.where(slides, each / force, np.nan) for each in np.diff(lines, axis=0)]
    for vertices, here, gap in zip(
        candidates.vertices, candidates.places, candidates.gaps, strict=True
    ):
        whole = np.full((len(found), len(gap)), np.nan)
        whole[:, vertices] = [each[here] for each in found]
        yield whole
