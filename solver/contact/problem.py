"""The frictional contact problem on the contact points, and its solution, as data.

Unknowns are the normal forces N >= 0 and tangential forces T at n points and the free rigid
motions q of bodies held by contact alone. With ``F = (N, T)`` (without friction ``F = N``)::

    (gap, slip) = offset + W F + A q        0 = balance + A' F
    N >= 0, gap >= 0, N gap = 0
    |T| <= s,  slip = 0 where below,  T = -s sign(slip) where equal
    s = min(mu N + c, limit),  where N < c:  s = min((mu + 1) N, limit)

Cohesion grows with N up to c: a jump at N = 0 would leave many problems without a solution.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Lines = tuple[NDArray[np.float64], NDArray[np.float64]]

OPEN, STICK, FORWARD, BACKWARD = 0, 1, 2, 3
"""Status of a contact point."""


def bound_lines(
    friction: NDArray[np.float64],
    cohesion: NDArray[np.float64] | None,
    limit: NDArray[np.float64] | None,
) -> Lines:
    """Return the lines ``slope N + force`` whose least is the bound: both (n_lines, n)."""
    nothing = np.zeros(len(friction))
    lines = [(friction, nothing)]
    if cohesion is not None and cohesion.any():
        lines = [(friction + (cohesion > 0), nothing), (friction, cohesion)]
    if limit is not None:
        lines.append((nothing, limit))
    slope, force = zip(*lines, strict=True)
    return np.array(slope), np.array(force)


def least(lines: Lines, N: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the least of the lines (n,) at normal forces N [N]."""
    slope, force = lines
    return np.asarray((slope * np.maximum(N, 0) + force).min(axis=0))


@dataclass(frozen=True, slots=True)
class ContactProblem:
    """One contact problem.

    Attributes
    ----------
    W : (m, m) compliance of the contact points [mm/N], m = 2n with friction, n without
    offset : (m,) gap and slip at zero force [mm]
    friction : (n,) coefficient at each point; zero means no tangential force
    A : (m, k) gap and slip of the free rigid motions
    balance : (k,) resultants of all other forces on those motions [N]
    limit : (n,) largest tangential force at any normal force [N]; inf sets no limit, None sets none
        at any point
    cohesion : (n,) tangential force c that needs no normal force [N]; None where there is none
    """

    W: NDArray[np.float64]
    offset: NDArray[np.float64]
    friction: NDArray[np.float64]
    A: NDArray[np.float64]
    balance: NDArray[np.float64]
    limit: NDArray[np.float64] | None = None
    cohesion: NDArray[np.float64] | None = None

    @property
    def n(self) -> int:
        """Number of contact points."""
        return len(self.friction)

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

    @property
    def rough(self) -> NDArray[np.bool_]:
        """Which points (n,) can bear a tangential force."""
        return self.friction > 0 if self.cohesion is None else (self.friction + self.cohesion) > 0

    @property
    def lines(self) -> Lines:
        """The lines whose least is the bound of tangential forces."""
        return bound_lines(self.friction, self.cohesion, self.limit)

    def bound(self, N: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the largest tangential forces (n,) under normal forces N [N]."""
        return least(self.lines, N)


@dataclass(frozen=True, slots=True)
class ContactSolution:
    """Forces (m,), rigid motions (k,), status (n,), and whether it was found by pivoting."""

    forces: NDArray[np.float64]
    rigid: NDArray[np.float64]
    status: NDArray[np.int64]
    pivoted: bool
