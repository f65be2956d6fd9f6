"""A change of displacements, carried along with the load that made it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from solver.linear import solvers as linear

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.fem.part import Part


class Following:
    """What happens to a part when a load has moved over it, given what happened before.

    Unknowns that have none behind them, at the ends of the mesh and where it is graded, follow
    elastically: without this they would tear the elements beside them.

    Parameters
    ----------
    way : from one node to another [mm]

    Attributes
    ----------
    source : (n,) for each unknown the one that lies ``way`` behind it, -1 where there is none
    """

    def __init__(self, part: Part, way: float) -> None:
        self.source = part.sources(way)
        free = np.zeros(part.n, dtype=bool)
        free[part.free] = True
        # a support stays where it is; a prescribed motion goes on by itself
        own = self.source == np.arange(part.n)
        self._known = (self.source >= 0) & (free | own)
        self._others = np.flatnonzero(free & (self.source < 0))
        self._copied = part.copied
        if len(self._others):
            self._rows = part.elastic_matrix()[self._others]
            upper = sparse.csr_array(sparse.triu(self._rows[:, self._others], format="csr"))
            self._solver = linear.analyse(upper)
            self._solver.factorise(upper.data)

    def carried(self, change: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a change of the unknowns (n,), farther on by the way [mm]."""
        moved = np.where(self._known, change[self.source], 0.0)
        if len(self._others):
            moved[self._others] = self._solver.solve(-(self._rows @ moved))
        return moved[self._copied]
