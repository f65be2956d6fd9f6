"""What small sliding leaves out as bodies move: when ``auto`` pairs straight surfaces anew."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from solver.contact.interface import Interface
    from solver.contact.state import ContactState, State
    from solver.contact.system import System

_STILL, _FAR = 0.01, 0.5
"""Motion along the partner / side of an element: below the first nothing is left out, above the
second surfaces are paired anew, before the audit finds fault with small sliding."""
_GAP = 1e-3
"""Ratio of the error of the gap to the side of an element, above which they are."""


def followed(system: System, before: State, after: State) -> State | None:
    """Return the state before an increment with those pairs finite that drift in it.

    None where small sliding does for all pairs.
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
    """Whether a pair that may choose leaves out too much; means weighted with the force."""
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
