"""Errors of an increment: of its stress, and of the state in which it begins.

Backward Euler gives plastic flow one direction. The strain of the increment is applied again in
`_PARTS` equal parts along the same straight path, in which the direction of flow changes. Their
error is smaller by this number, so the difference between the two stresses estimates the error. It
is of second order in the length of an increment; the sum over a path is of first order.

Of the first flow of a body this says nothing: from no stress along a straight path, stress and flow
keep one direction. There half of the increment is solved too, in which a growing contact or heat
may have led strain aside, and the stress is that of the whole strain after the state at half.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.contact.state import Converged
from solver.contact.system import System
from solver.fem.discretisation import Discretisation
from solver.typing import Array, Bools

_PARTS = 4
"""Number of parts of an increment; with two, flow that begins in the second half could not turn."""


def integrated(
    system: System, before: Converged, now: Converged, half: Converged | None = None
) -> Converged:
    """Return the increment ``now`` with its error, and the remaining sum of errors of the path.

    The error is the larger one of the estimates by parts and by ``half``, half of the increment, if
    it is given.
    """
    sums, added = list(before.missed or (None,) * len(system.parts)), 0.0
    for k, part in enumerate(system.parts):
        grown = now.responses[k].state.accumulated - now.start.plastic[k].accumulated
        flows = grown > 0
        if not (isinstance(part, Discretisation) and flows.any()):
            continue
        each = [_missed(part, now, k, flows, at) for at in ((None, half) if half else (None,))]
        own = max(each, key=lambda error: _mean(part, error, flows))
        added = float(np.maximum(added, _mean(part, own, flows)))
        had = sums[k]
        sums[k] = own if had is None else _carried(part, now, k, had) + own
    return replace(now, missed=tuple(sums), added=added)


def doubtful(system: System, now: Converged, most: float) -> bool:
    """Whether an increment has the first flow of a body, and its error may be above ``most``.

    Whatever the path of strain is, the stress differs by no more than twice what the plastic strain
    makes.
    """
    for part, response, start in zip(system.parts, now.responses, now.start.plastic, strict=True):
        grown = response.state.accumulated
        if isinstance(part, Discretisation) and grown.any() and not start.accumulated.any():
            stress = 6.0 * part.body.law.elasticity.shear_modulus * grown[None]
            if _mean(part, stress / np.sqrt(1.5), grown > 0) > most:
                return True
    return False


def missed(system: System, now: Converged) -> float:
    """Return the error of stress of all increments so far, over the yield stress: see `_mean`."""
    each = zip(system.parts, now.missed, now.state.plastic, strict=False)
    errors = [
        _mean(part, error, plastic.accumulated > 0)
        for part, error, plastic in each
        if error is not None and isinstance(part, Discretisation)
    ]
    return float(np.max(errors, initial=0.0))


def _missed(
    part: Discretisation, now: Converged, number: int, flows: Bools, half: Converged | None
) -> Array:
    """Return the exact stress minus that of the increment (n_components, n_points) [MPa].

    The exact stress is extrapolated to infinitely many parts.
    """
    within = np.asarray(flows.reshape(part.weights.shape).any(axis=1))
    points = np.flatnonzero(np.repeat(within, part.weights.shape[1]))
    start, end = (
        (part.strain(at.u[number]) - part.eigenstrain(at.time))[:, points]
        for at in (now.start, now.state)
    )
    state = half.responses[number].state if half else now.start.plastic[number]
    law, state, parts = part.law(now.state.time).at(points), state.at(points), 2 if half else _PARTS
    for share in np.arange(2 if half else 1, parts + 1) / parts:
        stress, _, state, _ = law.respond(start + share * (end - start), state)
    at_once = now.responses[number].stress
    found = np.zeros_like(at_once)
    found[:, points] = (stress - at_once[:, points]) * parts / (parts - 1)
    return found


def _carried(part: Discretisation, now: Converged, number: int, error: Array) -> Array:
    """Return the remainder, after an increment, of an error of stress at its beginning [MPa].

    For a given total strain the error acts as a change of strain. Flow reduces it, because it
    returns the stress to the yield surface.
    """
    response = now.responses[number]
    points = np.flatnonzero(response.yielding)
    law = part.law(now.state.time).at(points)
    strain = law.elasticity.strain(error[:, points]) / law.stiff
    carried = error.copy()
    carried[:, points] = np.einsum("ijp,jp->ip", response.tangent[:, :, points], strain)
    return carried


def _mean(part: Discretisation, error: Array, flows: Bools) -> float:
    """Return the root mean square of an error over the flowing volume, over the yield stress."""
    square = 1.5 * (error**2).sum(axis=0) @ part.volumes / part.volumes[flows].sum()
    return float(np.sqrt(square)) / part.body.law.yield_stress


_APART = 1e-4
"""Gap of a vertex without force over the edge length: the vertex is open above this ratio."""


def lost(system: System, before: Converged, now: Converged) -> float:
    """Return the difference between the beginning of ``now`` and the end of ``before``.

    It is the larger of

    - the yield value, over the yield stress, of the stress at the end of ``before`` with the
      internal variables at the beginning of ``now``: positive if plastic strain, hardening or back
      stress was lost
    - the gap, over the mean edge length, of an open vertex that is marked as touching, if above
      `_APART`
    """
    worst = 0.0
    both = zip(system.parts, before.responses, now.start.plastic, strict=True)
    for part, response, plastic in both:
        if isinstance(part, Discretisation) and not (law := part.law(before.state.time)).elastic:
            beyond = float(law.yield_value(response.stress, plastic).max(initial=0.0))
            worst = float(np.maximum(worst, beyond / law.yield_stress))
    for interface, contact in zip(system.interfaces, now.start.contacts, strict=True):
        kept = contact.touching & (contact.normal <= 0) & np.isfinite(contact.gap)
        if contact.normal.any() and kept.any():
            apart = float(contact.gap[kept].max() / interface.slave_surface.lengths.mean())
            worst = max(worst, apart) if apart > _APART else worst
    return worst
