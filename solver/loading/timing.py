"""Resolution of contact in time by one increment.

Friction depends on the slip since a vertex touched. If the rates of gap and slip are known, the
vertex touches when the gap closes. In the first increment of a contact this time is unknown, and
slip counts from the beginning of the increment. Also, a contact that moves by more than its width
passes vertices without loading them. Smaller increments reduce both errors.
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
"""Error of the slip before contact, over the last term of its series (measured)."""


def timing(system: System, start: State, candidates: Candidates, compliance: Array) -> Timing:
    """Return the timing of an increment from ``start``.

    ``compliance`` (m, m) is the elastic compliance of the contact points [mm/N]. It bounds the
    uncertain friction of a vertex. If the time of first contact is unknown, the bound is the
    tangential force plus elastic stiffness times slip. If it is known, the bound is the change of
    friction by the possible error of the slip before contact, at vertices that stick or would stick
    without this error.
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

    Along the slave it is the force that moved from some vertices to others, zero if contact only
    grows or shrinks. Along the master the motion is the slip. The larger value counts.
    """
    after = np.zeros_like(before.normal)
    after[at] = normal
    if not (after.any() and before.normal.any()):
        return 0.0
    gained, lost = after @ (before.normal == 0), before.normal @ (after == 0)
    width = interface.slave_surface.tributary @ (after > 0)
    return float(np.max([min(gained, lost), np.abs(slip) @ after / width]))
