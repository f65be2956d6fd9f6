"""The rim of an elastic wheel, condensed once for all its loads."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from solver.fem.discretisation import Discretisation
from solver.fem.frame import turning
from solver.fem.surface import Surface, extract
from solver.fem.wheel import Wheel
from solver.model.body import Body
from solver.typing import Array


class Rim:
    """The part of a wheel's rim that may touch a track, in the frame of the hub.

    Parameters
    ----------
    body : the wheel, with its axle; its lowest point is at x = 0, and elements along the rim are as
        long as those of the track
    boundary : name of the part of the rim that may touch the track

    Attributes
    ----------
    wheel : the wheel condensed to this part of the rim
    surface : the rim as a chain of edges
    """

    def __init__(self, body: Body, boundary: str) -> None:
        whole = Discretisation(body)
        chain = extract(whole, boundary)
        self.wheel = Wheel(whole, [chain], "auto")
        self.surface = self.wheel.surface(chain)

    def rolled(self, length: float) -> Array:
        """Return the displacements (n,) of a rigid wheel that rolls over a length [mm].

        Material moves along the arc. Along the tangent it would leave the rim by
        ``length^2 / (2 R)``, and have an apparent slip of x / R of that at a contact at x: with
        elements of a quarter of the half-width, 2 % of the slip at 30 % braking.
        """
        frame = self.wheel.frame
        arm = self.surface.X - frame.centre[:, None]
        return np.asarray((arm - turning(length / frame.radius) @ arm).T.ravel())

    def passing(self, d: Array) -> Array:
        """Return the derivative (n,) of positions by the arc, on a rim with displacements (n,)."""
        return self.wheel.passing(self.surface, d.reshape(-1, 2).T).T.ravel()

    @cached_property
    def compliance(self) -> Array:
        """Displacements of the rim for forces on it (n, n), over its unknowns [mm/N]."""
        dofs = self.surface.dofs
        return self.wheel.operators([], "auto").elastic.compliance(dofs, np.eye(len(dofs)))


def flowed(surface: Surface, way: int) -> Array:
    """Return the matrix from a nodal field to its change over one element, from upstream.

    ``way`` is +1 for a chain of edges that goes downstream. At the upstream end of the chain the
    change is zero.
    """
    chain = np.append(surface.edges[:, [0, 2]].ravel(), surface.edges[-1, 1])
    chain = chain if way > 0 else chain[::-1]
    change = np.zeros((surface.X.shape[1],) * 2)
    change[chain[2:], chain[2:]] = 1.0
    change[chain[2:], chain[:-2]] = -1.0
    return np.asarray(np.kron(change, np.eye(2)), dtype=float)
