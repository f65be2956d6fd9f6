"""Sliding of a whole body, whose load exceeds the friction of all its contacts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from solver.contact.candidates import Candidates
from solver.contact.state import State
from solver.contact.system import System
from solver.typing import Array

_SPENT = 0.95
"""Tangential force of a pair over its friction bound: a message gives a hint above this ratio."""
_ALONG = 0.05
"""Normal motion over all motion of the contact points in a slide, at most: deformed surfaces are
not quite straight."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Slide:
    """A rigid motion of ``body`` along its contacts, in which the load exceeds friction.

    ``ratio`` is the power of the load over the largest power that friction can dissipate.
    """

    body: str
    ratio: float

    @property
    def excludes(self) -> bool:
        """Whether equilibrium is excluded from any other state: no, normal forces may differ."""
        return False

    @property
    def limit(self) -> bool:
        """Whether no equilibrium exists: yes, by the upper-bound theorem."""
        return True

    def __str__(self) -> str:
        return (
            f"body {self.body!r} slides on all its contacts: its load is {self.ratio:.4g} times "
            "the largest friction"
        )


def spent(system: System, state: State) -> str:
    """Return a hint on pairs that are close to their friction bound in a state; else empty."""
    found = []
    for k, (interface, contact) in enumerate(zip(system.interfaces, state.contacts, strict=True)):
        pairing = system.pairing(state, k)
        lines = system.bound(k, pairing, state, state.time).over(pairing.area)
        most = float(lines.least(contact.normal)[contact.normal > 0].sum())
        share = abs(float(contact.tangential.sum())) / most if most > 0 else 0.0
        if share > _SPENT:
            names = [system.all_names[k] for k in (interface.slave, interface.master)]
            found.append(f"{' and '.join(names)} was at {share:.0%} of its bound")
    return f"; just before, friction between {', '.join(found)}" if found else ""


def slide(system: System, residuals: Sequence[Array], candidates: Candidates) -> Slide | None:
    """Return the slide of a floating body under the normal forces of the candidates, if any.

    Motions go along all closed contacts, so that they do not change normal forces. Deformed
    surfaces are not quite straight, so the power of normal forces counts too.

    Parameters
    ----------
    residuals : external minus internal forces of each part, without contact forces [N]
    """
    n = candidates.n
    N = candidates.forces[:n]
    closed = N > 0
    if not closed.any():
        return None
    bound = candidates.lines.least(N)
    for i, part in enumerate(system.parts):
        motion = candidates.of_part(i, part.rigid)
        if not candidates.frictional or not motion.size or motion[candidates.linked].any():
            continue
        _, apart, ways = linalg.svd(motion[:n][closed])
        apart = np.append(apart, np.zeros(len(ways) - len(apart)))
        along = ways[apart <= _ALONG * np.linalg.norm(motion, 2)].T
        load = along.T @ (part.rigid.T @ (residuals[i] + candidates.pushes[i]))
        for way in (*np.eye(len(load)), load):
            power = abs(float(load @ way))
            moved = motion @ along @ way
            most = float(bound @ np.abs(moved[candidates.along])) + abs(float(N @ moved[:n]))
            if power > most > 0:
                return Slide(body=part.body.name, ratio=power / most)
    return None
