"""Whether an increment begins with what the one before it has left."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from solver.contact.state import Converged
    from solver.contact.system import System

_APART = 1e-4
"""Ratio of the gap to the edge, above which a vertex without force is no contact that has just
closed."""


def lost(system: System, before: Converged, now: Converged) -> float:
    """Return how far the state that ``now`` begins with is from what ``before`` has left.

    The largest counts of

    - stress at the end of ``before`` that is beyond the yield surface of the internal variables
      with which ``now`` begins, over the yield stress: strain, hardening and back stress forgotten
    - gap of a vertex that is open, yet whose friction has a history, over the mean edge, where that
      is no tolerance
    """
    worst = 0.0
    both = zip(system.parts, before.responses, now.start.plastic, strict=True)
    for part, response, plastic in both:
        law = part.law(before.state.time)
        if part.meshed and not law.elastic:
            beyond = float(law.yield_value(response.stress, plastic).max(initial=0.0))
            worst = float(np.maximum(worst, beyond / law.yield_stress))
    for interface, contact in zip(system.interfaces, now.start.contacts, strict=True):
        kept = contact.touching & (contact.normal <= 0) & np.isfinite(contact.gap)
        if contact.normal.any() and kept.any():
            apart = float(contact.gap[kept].max() / interface.slave_surface.lengths.mean())
            worst = max(worst, apart) if apart > _APART else worst
    return worst
