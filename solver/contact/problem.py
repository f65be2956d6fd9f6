"""The frictional contact problem on the contact points, and its solution, as data.

Unknowns are the normal forces N >= 0 and tangential forces T at n points and the free rigid
motions q of bodies held by contact alone. With ``F = (N, T)`` (without friction ``F = N``)::

    (gap, slip) = offset + W F + G q        0 = balance + A' F + D q
    N >= 0, gap >= 0, N gap = 0
    |T| <= s,  slip = 0 where |T| < s,  T = -s sign(slip) where |T| = s
    s = min_k (slope_k N + level_k),  the lines of a friction law (`solver.model.friction`)

G equals A unless the normals of the two surfaces differ under a hat: forces act along the slave's
normals (or those of a rigid tool), gaps change along the master's. With A a ring that rests on two
vertices could turn without opening either. D is zero unless forces on a floating body of large
strain do not turn with it.
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
    W : (m, m) compliance of the contact points [mm/N], m = 2n with friction, n without; symmetric
        unless links hold a body whose G differs from A, or forces turn with surfaces or frames
    offset : (m,) gap and slip at zero force [mm]
    lines : friction bound at each point, the least of lines of tangential over normal force [N]
    A : (m, k) motion of the points along the forces, per free rigid motion
    balance : (k,) resultants of all other forces on the rigid motions [N]
    G : (m, k) gap and slip per free rigid motion; by default A
    D : (k, k) change of the resultants by the rigid motions [N/mm]; by default zero
    """

    W: Array
    offset: Array
    lines: BoundLines
    A: Array
    balance: Array
    G: Array | None = None
    D: Array | None = None

    @property
    def turned(self) -> Array:
        """G, by default A."""
        return self.A if self.G is None else self.G

    def moved(self, F: Array, q: Array) -> Array:
        """Return gap and slip (m,) with forces F (m,) and rigid motions q (k,) [mm]."""
        return self.offset + self.W @ F + self.turned @ q

    def unbalanced(self, F: Array, q: Array) -> Array:
        """Return the resultants (k,) of all forces with contact forces F and motions q [N]."""
        own = self.balance + self.A.T @ F
        return own if self.D is None else own + self.D @ q

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


@dataclass(frozen=True, slots=True)
class ContactRows:
    """Derivatives of all gaps (and slips) with respect to the unknowns ``dofs`` of one part."""

    dofs: Ints
    block: Array


class OnParts:
    """Base of conditions between parts; ``rows`` are their derivatives on each part, or None."""

    __slots__ = ()
    rows: tuple[ContactRows | None, ...]

    def on_part(self, part: int, forces: Array, size: int) -> Array:
        """Return the nodal forces (size,) on a part, given the forces of the conditions [N]."""
        rows, nodal = self.rows[part], np.zeros(size)
        if rows is not None:
            nodal[rows.dofs] = forces @ rows.block
        return nodal


def joined(pieces: list[ContactRows]) -> ContactRows | None:
    """Return the sum of the rows of all surfaces of a part, on the unknowns that change them."""
    if not pieces:
        return None
    every, block = np.concatenate([p.dofs for p in pieces]), np.hstack([p.block for p in pieces])
    acts = block.any(axis=0)
    every, block = every[acts], block[:, acts]
    order = np.argsort(every, kind="stable")
    dofs, first = np.unique(every[order], return_index=True)
    return ContactRows(dofs, np.add.reduceat(block[:, order], first, axis=1))
