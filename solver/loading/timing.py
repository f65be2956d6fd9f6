"""How well one increment resolves contact in time.

Friction depends on the slip since a vertex touched. If the rates of gap and slip are known, the
time of touch is that at which the gap closes. In the first increment of a contact it is not known,
and slip counts from the beginning of the increment. Also, a contact that moves by more than its
width has passed over vertices that never carried force. Smaller increments reduce both errors.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

from solver.contact.candidates import Candidates
from solver.contact.interface import Interface
from solver.contact.problem import STICK
from solver.contact.state import ContactState, State, Timing
from solver.contact.system import System
from solver.typing import Array, Ints

_SHARE = 0.25
"""Error of the slip before touch, over its change by the last term of its series (measured)."""


def timing(system: System, start: State, candidates: Candidates, compliance: Array) -> Timing:
    """Return the timing of an increment from ``start``.

    ``compliance`` (n or 2n, and links, square) is that of the contact points, elastic [mm/N]. It
    bounds the uncertain friction of vertices. If the time of touch is not known, that is the
    elastic stiffness times the slip without friction; a vertex that sticks from the beginning of
    the increment has no slip, and its tangential force is added instead. If it is known, it is the
    change of friction by the possible error of the slip before, at vertices that stick, or might
    without that error.
    """
    n = candidates.n
    N = np.maximum(candidates.forces[:n], 0.0)
    bound, unknown = np.zeros(n), np.zeros(n)
    if candidates.frictional:
        bound, along = candidates.lines.least(N), candidates.along
        slips = zip(candidates.slips, candidates.vertices, strict=True)
        slipped = np.abs(np.concatenate([slip[at] for slip, at in slips]))
        strained = np.abs(candidates.forces[along]) + slipped / np.diag(compliance)[along]
        untimed = np.isinf(candidates.unsure)
        off = np.where(untimed, 0.0, candidates.unsure)
        slides = (candidates.status != STICK) & (np.abs(candidates.motion[along]) > np.abs(off))
        sticks = np.flatnonzero((N > 0) & ~slides)
        off[(N <= 0) | slides] = 0.0
        if off.any():
            tangential = compliance[along, along][np.ix_(sticks, sticks)]
            off[sticks] = _SHARE * linalg.pinvh(tangential) @ off[sticks]
        unknown = np.minimum(bound, np.where(untimed, strained, np.abs(off)))
    stuck = np.where((N > 0) & (candidates.status == STICK), bound, 0.0)
    found = np.zeros((5, len(system.interfaces)))
    each = zip(system.interfaces, candidates.vertices, candidates.places, strict=True)
    for k, (interface, at, here) in enumerate(each):
        passed = _passed(interface, start.contacts[k], at, N[here], candidates.slips[k])
        sums = (part[here].sum() for part in (unknown, bound, N, stuck))
        found[:, k] = *sums, passed
    untimed, friction, normal, sticking, way = found
    return Timing(untimed=untimed, friction=friction, passed=way, normal=normal, stuck=sticking)


def _passed(
    interface: Interface, before: ContactState, at: Ints, normal: Array, slip: Array
) -> float:
    """Return the force of a contact times (its motion along a surface / its width) [N].

    Along the slave that is the force that moved from some vertices to others; it is zero if contact
    only grows or shrinks. Along the master the motion is the slip.
    """
    after = np.zeros_like(before.normal)
    after[at] = normal
    if not (after.any() and before.normal.any()):
        return 0.0
    came, left = after @ (before.normal == 0), before.normal @ (after == 0)
    width = interface.slave_surface.tributary @ (after > 0)
    return float(np.max([min(came, left), np.abs(slip) @ after / width]))
