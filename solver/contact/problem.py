"""The frictional contact problem on the contact points, and its solution, as data.

Unknowns are the normal forces N >= 0 and tangential forces T at n points and the free rigid
motions q of bodies held by contact alone. With ``F = (N, T)`` (without friction ``F = N``)::

    (gap, slip) = offset + W F + G q        0 = balance + A' F
    N >= 0, gap >= 0, N gap = 0
    |T| <= s,  slip = 0 where |T| < s,  T = -s sign(slip) where |T| = s
    s = min_k (slope_k N + level_k),  the lines of a law of friction (`solver.model.friction`)

G is A, but for normals that lean under a hat: forces act along the slave's, gaps change along the
master's. Without this a ring that rests on two vertices could turn without opening either.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.model.friction import BoundLines
from solver.typing import Array, Ints

OPEN, STICK, FORWARD, BACKWARD = 0, 1, 2, 3
"""Status of a contact point."""


@dataclass(frozen=True, slots=True)
class ContactProblem:
    """One contact problem.

    Attributes
    ----------
    W : (m, m) compliance of the contact points [mm/N], m = 2n with friction, n without; symmetric,
        but for links that hold a body with a G of its own
    offset : (m,) gap and slip at zero force [mm]
    lines : the friction bound at each point, the least of lines of tangential over normal force [N]
    A : (m, k) motions along the forces of the free rigid motions
    balance : (k,) resultants of all other forces on those motions [N]
    G : (m, k) gap and slip of the free rigid motions; A if absent
    """

    W: Array
    offset: Array
    lines: BoundLines
    A: Array
    balance: Array
    G: Array | None = None

    @property
    def turned(self) -> Array:
        """G, or A if absent."""
        return self.A if self.G is None else self.G

    def moved(self, F: Array, q: Array) -> Array:
        """Return gap and slip (m,) with forces F (m,) and rigid motions q (k,) [mm]."""
        return self.offset + self.W @ F + self.turned @ q

    @property
    def n(self) -> int:
        """Number of contact points."""
        return self.lines.slope.shape[1]

    @property
    def frictional(self) -> bool:
        """Whether tangential unknowns exist."""
        return len(self.offset) > self.n

    @property
    def scales(self) -> tuple[float, float]:
        """A force [N] and a length [mm] that tolerances refer to."""
        compliance = np.abs(np.diag(self.W)).max()
        length = np.abs(self.offset[: self.n]).max()
        force = np.abs(self.balance).sum()
        length = max(length, force * compliance * 1e-3, 1e-30)
        return max(force, length / compliance), length


@dataclass(frozen=True, slots=True)
class ContactSolution:
    """Forces (m,), rigid motions (k,), status (n,), and whether it was found by pivoting."""

    forces: Array
    rigid: Array
    status: Ints
    pivoted: bool
