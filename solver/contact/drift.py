"""Automatic sliding: change a pair from small to finite sliding when its bodies have moved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.contact.interface import Interface
from solver.contact.state import ContactState, State
from solver.contact.system import System

_STILL, _FAR = 0.01, 0.5
"""Slip over the length of an element edge. Small sliding is accurate below the first ratio; above
the second the pair becomes finite, before the audit rejects small sliding."""
_GAP = 1e-3
"""Gap error over the length of an element edge: with a larger one the pair becomes finite."""


def followed(system: System, before: State, after: State) -> State | None:
    """Return the state before an increment with finite sliding for the pairs that need it.

    None if small sliding is accurate enough for all pairs.
    """
    each = zip(system.interfaces, after.contacts, strict=True)
    drifting = [_drifts(interface, after, contact) for interface, contact in each]
    if not any(drifting):
        return None
    pairs = zip(before.contacts, drifting, strict=True)
    return replace(
        before, contacts=tuple(replace(c, finite=c.finite or drifts) for c, drifts in pairs)
    )


def _drifts(interface: Interface, state: State, contact: ContactState) -> bool:
    """Whether an ``auto`` pair needs finite sliding; means are weighted with the normal force."""
    pressed = contact.normal > 0
    small = interface.reference
    if small is None or contact.finite or interface.declared.sliding != "auto":
        return False
    if not pressed.any():
        return False
    share = contact.normal[pressed] / contact.normal[pressed].sum()
    way = interface.slip(small, state.u)[pressed]
    far, side = float(np.abs(way) @ share), float(small.length[pressed] @ share)
    if not _STILL * side < far <= _FAR * side:
        return far > _FAR * side
    now, then = (
        interface.pairing(state.u, state.time, finite=f).gap[pressed] for f in (True, False)
    )
    return bool(np.abs(now - then) @ share > _GAP * side)
