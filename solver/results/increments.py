"""Numbers after every increment: motions of rigid bodies, reactions, contact forces."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from solver.contact.state import Converged
from solver.contact.system import System
from solver.fem.nodes import vectors
from solver.fem.rigid import RigidMotion, RigidPart
from solver.fem.wheel import Wheel
from solver.results.contact import CONTACT
from solver.results.quantities import Quantity, declare
from solver.results.run import Values
from solver.typing import Array

INCREMENT = declare(
    "increment", "number of the increment; 0 is the state before loading", dims=("increment",),
    count=True,
)  # fmt: skip
PART = declare("part", "body or rigid body", "", dims=("part",))

_PART, _FORCE = ("part", "increment"), ("contact", "increment")
INCREMENT_TIME = declare(
    "increment_time", "time of the program: completed stages, or load factor", dims=("increment",)
)
REACTION = tuple(
    declare(f"reaction_{a}", f"force of supports and prescribed motions along {a}", "N", dims=_PART)
    for a in "xy"
)
MOTION = tuple(
    declare(f"motion_{a}", f"displacement of a rigid body along {a}", "mm", dims=_PART)
    for a in "xy"
)
ROTATION = declare("motion_rotation", "rotation of a rigid body", "rad", dims=_PART)
NORMAL_FORCE = declare("contact_normal_force", "sum of the normal forces", "N", dims=_FORCE)
TANGENTIAL_FORCE = declare(
    "contact_tangential_force", "sum of the tangential forces on the master along s", "N",
    dims=_FORCE,
)  # fmt: skip


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


def over_increments(
    history: Sequence[Observed], times: Sequence[float], parts: Sequence[str], pairs: Sequence[str]
) -> Values:
    """Return the numbers at the ends of the program's increments.

    Parameters
    ----------
    history : all increments, including the parts of increments that were cut
    times : initial time, and the times at which the increments of the program end
    parts, pairs : names of all bodies, also of rigid ones, and of the contact pairs

    Returns
    -------
    reactions (n_parts, n_times) [N], with rigid bodies also motions (n_parts, n_times) [mm, rad],
    contact forces (n_pairs, n_times) [N], and the numbers that outputs watch (n_times,); NaN for
    increments that were not computed
    """
    kept = _in_order(history, times)
    none = (np.nan, np.nan, np.nan)
    reactions = np.array([[o.reactions.get(p, none) if o else none for o in kept] for p in parts])
    motions = np.array([[o.motions.get(p, none) if o else none for o in kept] for p in parts])
    out: dict[Quantity, Any] = {
        PART: np.array(list(parts)),
        INCREMENT: np.arange(len(times)),
        INCREMENT_TIME: np.array(times),
        REACTION[0]: reactions[..., 0],
        REACTION[1]: reactions[..., 1],
    }
    if any(observed.motions for observed in history):
        for k, motion in enumerate((*MOTION, ROTATION)):
            out[motion] = motions[..., k]
    if pairs:
        forces = np.array([o.contact if o else [none[:2]] * len(pairs) for o in kept])
        out |= {
            CONTACT: np.array(list(pairs)),
            NORMAL_FORCE: forces[..., 0].T,
            TANGENTIAL_FORCE: -forces[..., 1].T,
        }
    watched = history[0].watched
    return out | {q: np.array([o.watched[q] if o else np.nan for o in kept]) for q in watched}


def _in_order(history: Sequence[Observed], times: Sequence[float]) -> list[Observed | None]:
    """Return the increment that ends at each time; None if it was not computed."""
    found: list[Observed | None] = []
    at = 0
    for time in times:
        later = range(at, len(history))
        near = (k for k in later if math.isclose(history[k].time, time, abs_tol=1e-12))
        k = next(near, None)
        found.append(None if k is None else history[k])
        at = at if k is None else k + 1
    return found
