"""The error of stress that an increment adds because plastic flow turns within it.

Flow has one direction in an increment. Parts of the increment, along the same straight path of
strain, let it turn, and have as much less of the error as they are shorter: the difference of their
stress estimates it. It is of second order in the length of an increment; what all increments of a
path leave is of first order.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.contact.state import Converged
from solver.contact.system import System
from solver.fem.discretisation import Discretisation
from solver.typing import Array, Bools

_PARTS = 4
"""Number of parts; two would not see the turn of a flow that begins in the second half."""


def integrated(system: System, before: Converged, now: Converged) -> Converged:
    """Return an increment with the error that it adds, and what those of the path so far leave."""
    sums, added = list(before.missed or (None,) * len(system.parts)), 0.0
    for k, part in enumerate(system.parts):
        grown = now.responses[k].state.accumulated - now.start.plastic[k].accumulated
        flows = grown > 0
        if not (isinstance(part, Discretisation) and flows.any()):
            continue
        own = _missed(part, now, k, flows)
        added = float(np.maximum(added, _mean(part, own, flows)))
        had = sums[k]
        sums[k] = own if had is None else _carried(part, now, k, had) + own
    return replace(now, missed=tuple(sums), added=added)


def missed(system: System, now: Converged) -> float:
    """Return the error of stress of all increments so far, over the yield stress: see `_mean`."""
    each = zip(system.parts, now.missed, now.state.plastic, strict=False)
    errors = [
        _mean(part, error, plastic.accumulated > 0)
        for part, error, plastic in each
        if error is not None and isinstance(part, Discretisation)
    ]
    return float(np.max(errors, initial=0.0))


def _missed(part: Discretisation, now: Converged, number: int, flows: Bools) -> Array:
    """Return what ever shorter parts would add to stress (n_components, n_points) [MPa]."""
    within = np.asarray(flows.reshape(part.weights.shape).any(axis=1))
    points = np.flatnonzero(np.repeat(within, part.weights.shape[1]))
    ends = (now.start.time, now.start.u[number]), (now.state.time, now.state.u[number])
    start, end = ((part.strain(u) - part.eigenstrain(time))[:, points] for time, u in ends)
    law, state = part.law(now.state.time).at(points), now.start.plastic[number].at(points)
    for share in np.arange(1, _PARTS + 1) / _PARTS:
        stress, _, state, _ = law.respond(start + share * (end - start), state)
    at_once = now.responses[number].stress
    found = np.zeros_like(at_once)
    found[:, points] = (stress - at_once[:, points]) * _PARTS / (_PARTS - 1)
    return found


def _carried(part: Discretisation, now: Converged, number: int, error: Array) -> Array:
    """Return what an increment leaves of an error of stress at its beginning [MPa].

    Along a given strain it acts as a change of strain: flow, which brings stress to the yield
    surface, lessens it.
    """
    response = now.responses[number]
    points = np.flatnonzero(response.yielding)
    strain = part.law(now.state.time).at(points).elastic_strain(error[:, points])
    left = error.copy()
    left[:, points] = np.einsum("ijp,jp->ip", response.tangent[:, :, points], strain)
    return left


def _mean(part: Discretisation, error: Array, flows: Bools) -> float:
    """Return the root mean square over the volume that flows, over the yield stress."""
    square = 1.5 * (error**2).sum(axis=0) @ part.volumes / part.volumes[flows].sum()
    return float(np.sqrt(square)) / part.body.law.yield_stress
