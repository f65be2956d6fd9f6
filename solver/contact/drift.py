"""Contact that has moved over its surfaces: finite sliding where needed, and never beyond an end.

Beyond the end of a surface (`beyond_end`) the model has no contact, so such a state is wrong, even
in equilibrium. If the surface ends at a corner of the body, contact may reach this end.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.contact.candidates import Candidates
from solver.contact.interface import Interface
from solver.contact.state import ContactState, State
from solver.contact.system import System
from solver.typing import Array, Ints

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


_COVERED = 1 - 1e-6
"""Share of a hat function that faces the master: with less the master ends under the hat."""


def beyond_end(system: System, u: tuple[Array, ...], candidates: Candidates) -> str:
    """Return the message that contact has reached the end of a surface; empty if it has not."""
    for interface, vertices, covered, here in zip(
        system.interfaces, candidates.vertices, candidates.covered, candidates.places, strict=True
    ):
        pressed = candidates.forces[here] > 0
        side = _side(interface, u, vertices[pressed], covered[pressed])
        if side is not None:
            body = interface.parts[side].body.name
            return (
                f"contact has reached the end of the surface of body {body!r}, but the body "
                "continues beyond it: extend the boundary of this contact pair"
            )
    return ""


def _side(
    interface: Interface,
    u: tuple[Array, ...],
    vertices: Ints,
    covered: Array,
) -> int | None:
    """Return the side (0 slave, 1 master) whose end the vertices in contact have reached."""
    slave, master = interface.slave_surface, interface.master_surface
    last = len(slave.edges)
    at_end = [end for end, vertex in enumerate((0, last)) if vertex in vertices]
    cut = vertices[covered < _COVERED]
    if not any(slave.goes_on[end] for end in at_end) and not len(cut):
        return None
    (xs, xm) = (
        chain.X[:, chain.vertices] + part.motion(chain, u[number])[:, chain.vertices]
        for number, part, chain in interface.sides
    )
    ends = xm[:, [0, -1]]
    for end in at_end:
        here = xs[:, -end]
        nearest = np.linalg.norm(ends - here[:, None], axis=0)
        edge = np.linalg.norm(xs[:, -end] - xs[:, (1, -2)[end]])
        master_ends_too = nearest.min() < edge / 2 and not master.goes_on[nearest.argmin()]
        if slave.goes_on[end] and not master_ends_too:
            return 0
    for vertex in cut:
        nearest = np.linalg.norm(ends - xs[:, vertex, None], axis=0)
        if master.goes_on[nearest.argmin()]:
            return 1
    return None
