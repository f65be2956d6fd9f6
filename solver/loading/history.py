"""Check that an increment begins with the state in which the previous one ended."""

from __future__ import annotations

import numpy as np

from solver.contact.state import Converged
from solver.contact.system import System
from solver.fem.discretisation import Discretisation

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
