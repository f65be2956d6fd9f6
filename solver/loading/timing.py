"""How well one increment resolves contact in time.

Friction depends on the slip since a vertex touched. If the rates of gap and slip are known, the
time of touch is that at which the gap closes. In the first increment of a contact it is not known,
and slip counts from the beginning of the increment. Also, a contact that moves by more than its
width has passed over vertices that never carried force. Smaller increments reduce both errors.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.contact.problem import STICK
from solver.contact.state import Timing

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.contact.candidates import Candidates
    from solver.contact.interface import Interface
    from solver.contact.state import ContactState, State
    from solver.contact.system import System

    Array = NDArray[np.float64]


def timing(system: System, start: State, candidates: Candidates, stiffness: Array) -> Timing:
    """Return the timing of an increment from ``start``.

    ``stiffness`` (n or 2n, and of links,) is that of the contact points, elastic [N/mm]. It bounds
    the uncertain friction of a vertex: elastic stiffness times the slip without friction. A vertex
    that sticks from the beginning of the increment has no slip; its tangential force is added
    instead.
    """
    n = candidates.n
    N = np.maximum(candidates.forces[:n], 0.0)
    bound, strained = np.zeros(n), np.zeros(n)
    if candidates.frictional:
        bound = candidates.lines.least(N)
        slips = zip(candidates.slips, candidates.vertices, strict=True)
        slipped = np.abs(np.concatenate([slip[at] for slip, at in slips]))
        strained = np.abs(candidates.forces[candidates.along])
        strained += stiffness[candidates.along] * slipped
    unknown = np.where(candidates.untimed, np.minimum(bound, strained), 0.0)
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
    interface: Interface, before: ContactState, at: NDArray[np.int64], normal: Array, slip: Array
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
