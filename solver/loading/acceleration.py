"""Anderson acceleration of Newton's method, for iterations with an incomplete tangent.

The tangent lacks derivatives of the friction bound along a surface, with small strain also those
of contact normals, and may be blended with the elastic stiffness. Newton's method then converges
like a geometric series, sometimes with a ratio of 0.9. Anderson's mixing combines the last iterates
so that the remaining step is smallest. If the missing part of the tangent is constant, this
restores Newton's method.

D.G. Anderson, J. ACM 12 (1965) 547-560; H.F. Walker, P. Ni, SIAM J. Numer. Anal. 49 (2011)
1715-1735, algorithm 2.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from solver.contact.candidates import Candidates
from solver.loading.step import NewtonStep
from solver.typing import Array

Vectors = tuple[Array, ...]


_SLOW = 0.6
"""|step_k| / |step_k-1|: convergence is slow above this ratio."""
_PATIENCE = 5
"""Number of slow steps in a row before acceleration; a change of contact status causes a few."""
_WINDING = 3.0
"""|step_k| / |step_k-1|: a step above this ratio begins a new series."""
_ALONG = 0.7
"""Cosine of the angle between two steps: above it they have the same direction."""
_DEPTH = 5


@dataclass(slots=True)
class Series:
    """Successive whole steps that hardly decrease, with the same contact status.

    They may alternate or circle about the solution. Steps that grow in one direction may be plastic
    flow of a body and are not accelerated. A partial step ends the series: points have changed
    between elastic and plastic, so the missing part of the tangent has changed too.
    """

    _key: bytes = b""
    _slow: int = 0
    _places: list[Array] = field(default_factory=list)
    _steps: list[Array] = field(default_factory=list)

    def sum(
        self, u: Vectors, candidates: Candidates, step: NewtonStep, share: float
    ) -> tuple[Vectors, Array] | None:
        """Return accelerated displacements and contact forces after a step.

        None if convergence is fast, as nearly always: the step itself is then used.
        """
        if share < 1:
            self._slow, self._places, self._steps = 0, [], []
            return None
        place = np.concatenate([*u, candidates.forces])
        now = np.concatenate([*step.u, step.forces - candidates.forces])
        cut = np.cumsum([len(ui) for ui in u])
        n = int(cut[-1])
        key = b"".join(v.tobytes() for v in (*candidates.vertices, step.status))
        size = np.linalg.norm(now[:n])
        last = np.linalg.norm(self._steps[-1][:n]) if self._steps else 0.0
        along = now[:n] @ self._steps[-1][:n] if self._steps else 0.0
        flows = size > last and along > _ALONG * size * last
        if key != self._key or size > _WINDING * last or flows:
            self._key, self._slow, self._places, self._steps = key, 0, [], []
        elif self._slow < _PATIENCE:
            self._slow = self._slow + 1 if size > _SLOW * last else 0
        self._places = [*self._places[-_DEPTH:], place]
        self._steps = [*self._steps[-_DEPTH:], now]
        if self._slow < _PATIENCE:
            return None
        moved = np.diff(self._places, axis=0)
        changed = np.diff(self._steps, axis=0)
        weight = np.linalg.lstsq(changed[:, :n].T, now[:n])[0]
        *ahead, forces = np.split(place + now - weight @ (moved + changed), cut)
        return tuple(ahead), forces
