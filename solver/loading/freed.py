"""Refuse loads on bodies that nothing holds, before anything is computed.

If neither supports nor links hold a body, and its contact pairs are absent or the bodies separated,
a load that moves it has no equilibrium.
"""

from __future__ import annotations

import numpy as np

from solver.contact.system import System
from solver.errors import ModelError
from solver.fem.discretisation import Discretisation
from solver.fem.dofs import vectors
from solver.fem.part import Part
from solver.fem.rigid import RigidPart
from solver.fem.wheel import Wheel
from solver.loading.program import Program
from solver.loading.step import moving
from solver.model.contact_pair import ContactPair
from solver.typing import Array

_LITTLE = 1e-6
"""Resultant over the largest load on its body: a smaller ratio is rounding."""
_ALONG = 0.1
"""Motion in one direction over the largest: messages name directions above this ratio."""


def check_freed(system: System, program: Program) -> None:
    """Raise `ModelError` if a load of a program would move a body while nothing holds it."""
    for number, linked in enumerate(system.links.rows):
        part = system.parts[number]
        if not part.rigid.shape[1] or linked is not None:
            continue
        name = part.body.name
        if name in system.names and not isinstance(part, Wheel):
            part = system.full(name)  # saves the condensation
        pairs = [i.declared for i in system.interfaces if number in (i.slave, i.master)]
        targets, least = program.targets, None
        times = [program.laps[0].start, *(target.time for target in targets)]
        for before, target in zip(times, targets, strict=False):
            held = not target.apart and not all(pair.absent(target.time) for pair in pairs)
            if held or not part.force_level(target.time):
                continue
            own = part.during(before, part.start()) if isinstance(part, RigidPart) else part
            pushed = moving(own, own.external(target.time))
            least = least or _LITTLE * max(part.force_level(time) for time in times)
            if np.linalg.norm(pushed) > least:
                raise ModelError(
                    "supports", getattr(part.body, "supports", {}),
                    f"body {name!r} is free to move {_ways(part, pushed)} at "
                    f"{program.place(target.time)}, but its load acts in this direction: no "
                    "support or link holds it, and "
                    f"{'bodies are separated' if target.apart else _gone(pairs)}. "
                    "End the load before, or hold the body",
                )  # fmt: skip


def _gone(pairs: list[ContactPair]) -> str:
    each = [f"{'.'.join(pair.slave)} and {'.'.join(pair.master)}" for pair in pairs]
    return f"there is no contact between {', or between '.join(each)}"


def _ways(part: Part, pushed: Array) -> str:
    """Return the directions in which a body would move, in words."""
    sizes = np.abs(pushed[-3:])  # motion of a rigid body or a hub
    if isinstance(part, Discretisation):
        each = vectors(pushed, len(part.nodes))
        sizes = np.append(np.abs(each.mean(axis=1)), np.ptp(each, axis=1).max() / 2)
    ways = zip(("along x", "along y", "in rotation"), sizes, strict=True)
    return " and ".join(way for way, size in ways if size > _ALONG * sizes.max())
