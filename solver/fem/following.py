"""Shift of a displacement change along with a moving load, for the prediction of increments."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from solver.fem.part import Part, same_unknowns
from solver.fem.rigid import RigidPart
from solver.fem.wheel import Wheel
from solver.linear import solvers as linear
from solver.typing import Array, Ints


def passed_over(part: Part, before: Array, after: Array, way: float) -> float:
    """Return the motion over the material of a part of a load that moves by ``way`` [mm].

    ``before`` and ``after`` are the unknowns (n,) of the part; those of a rigid body do not shift.
    """
    if isinstance(part, Wheel):
        return part.passed(before, after)
    return 0.0 if isinstance(part, RigidPart) else way


def _sources(part: Part, way: float) -> Ints:
    """Return for each unknown (n,) the one at ``way`` [mm] behind it along x, or -1."""
    if isinstance(part, Wheel):
        return part.sources(way)
    if isinstance(part, RigidPart):
        return np.arange(part.n)
    return same_unknowns(part.nodes, part.nodes - np.array([[way], [0.0]]))


class Following:
    """The shift of a part's displacement changes by a distance along x.

    At the ends of the mesh, and where the mesh is graded, an unknown has none at this distance
    behind it. It then follows elastically; at rest it would distort the elements next to it.

    Parameters
    ----------
    way : distance, a whole number of element sides [mm]

    Attributes
    ----------
    source : (n,) unknown at the distance ``way`` behind each unknown, -1 if there is none
    """

    def __init__(self, part: Part, way: float) -> None:
        self.source = _sources(part, way)
        free = np.zeros(part.n, dtype=bool)
        free[part.free] = True
        # held unknowns are not shifted: supports stay at rest, prescribed motions are known
        own = self.source == np.arange(part.n)
        self._known = (self.source >= 0) & (free | own)
        self._others = np.flatnonzero(free & (self.source < 0))
        if len(self._others):
            self._rows = part.elastic_matrix()[self._others]
            upper = sparse.csr_array(sparse.triu(self._rows[:, self._others], format="csr"))
            self._solver = linear.analyse(upper)
            self._solver.factorise(upper.data)

    def carried(self, change: Array) -> Array:
        """Return a change of the unknowns (n,), shifted by the distance [mm]."""
        moved = np.where(self._known, change[self.source], 0.0)
        if len(self._others):
            moved[self._others] = self._solver.solve(-(self._rows @ moved))
        return moved
