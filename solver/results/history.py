"""Numbers stored after every increment: motions of rigid bodies, reactions, contact forces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from solver.contact.state import Converged
from solver.contact.system import System
from solver.fem.dofs import vectors
from solver.fem.frame import RigidMotion
from solver.fem.rigid import RigidPart
from solver.fem.wheel import Wheel
from solver.results.quantities import Quantity
from solver.typing import Array


@dataclass(frozen=True, slots=True)
class Observed:
    """A converged increment in a few numbers.

    Attributes
    ----------
    time : time of the program; the load factor if loads have no amplitude
    motions : motion of each rigid body
    reactions : forces x, y (in space also z) [N] and moment [N mm] by body. Meshed body: forces of
        supports and prescribed displacements, moment NaN. Rigid body: all forces except contact,
        given ones and those of prescribed motions, and their moment about its centre
    contact : sums of normal and of tangential forces on the slave of each pair [N]
    watched : numbers of outputs after every increment
    """

    time: float
    motions: Mapping[str, RigidMotion]
    reactions: Mapping[str, tuple[float, ...]]
    contact: Sequence[tuple[float, float]]
    watched: Mapping[Quantity, float] = field(default_factory=dict)


def observe(system: System, converged: Converged) -> Observed:
    """Return the stored numbers of an increment."""
    state = converged.state
    motions, reactions = {}, {}
    for name, part, u, touch, forces in zip(
        system.all_names, system.parts, state.u, converged.contact_forces, converged.forces,
        strict=True,
    ):  # fmt: skip
        if isinstance(part, RigidPart):
            motions[name] = part.motion_of(u)
            x, y, turning = forces
            reactions[name] = (float(x), float(y), float(turning) * part.frame.radius)
        elif not isinstance(part, Wheel):
            # from equilibrium: the supported nodes of a condensed body are eliminated
            whole = system.full(name)
            loads = vectors(whole.external(state.time, u), whole.dim).sum(axis=1)
            held = -loads - vectors(touch, whole.dim).sum(axis=1)
            reactions[name] = (*held.tolist(), np.nan)
    pairs = [(float(c.normal.sum()), float(c.tangential.sum())) for c in state.contacts]
    return Observed(state.time, motions, reactions, pairs)


def curve(history: Sequence[Observed], body: str) -> Array:
    """Return the history (7, n) of a rigid body.

    Rows: time, displacement x and y [mm], rotation [rad], forces x and y [N], moment [N mm].
    """
    return np.array([[o.time, *o.motions[body], *o.reactions[body]] for o in history]).T
