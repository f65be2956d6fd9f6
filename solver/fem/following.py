"""Shift a change of displacements along with a moving load, for the prediction of increments."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from solver.fem.part import Part
from solver.linear import solvers as linear
from solver.typing import Array


class Following:
    """The shift of a part's displacement changes by a distance along x.

    An unknown without another one at this distance behind it, at the ends of the mesh and where it
    is graded, follows elastically; if it stayed at rest, the elements beside it would be distorted.

    Parameters
    ----------
    way : distance, a whole number of element sides [mm]

    Attributes
    ----------
    source : (n,) for each unknown the one at the distance ``way`` behind it, -1 if there is none
    """

    def __init__(self, part: Part, way: float) -> None:
        self.source = part.sources(way)
        free = np.zeros(part.n, dtype=bool)
        free[part.free] = True
        # a support stays where it is; a prescribed motion goes on by itself
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
