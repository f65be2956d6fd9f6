"""What increments need of a body: unknowns, forces, motion of surfaces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.fem.surface import Surface
    from solver.model.body import Body


class Part:
    """A body as increments use it; the defaults here are for loads that do not move.

    Its unknowns are ``u`` (n,). ``moves`` tells whether its load moves along a body.
    ``load_vector`` (n,) holds the nodal forces of the body's pressures at load factor one [N].
    """

    n: int
    body: Body
    load_vector: NDArray[np.float64]
    moves: bool = False

    @property
    def volumes(self) -> NDArray[np.float64]:
        """Volume of the points (n_points,) [mm3]; a part without points has none."""
        return np.zeros(0)

    def start(self) -> NDArray[np.float64]:
        """Return the unknowns (n,) before any load."""
        return np.zeros(self.n)

    def external(self, time: float) -> NDArray[np.float64]:
        """Return the external nodal forces (n,) at a time [N]."""
        return self.body.load_factor(time) * self.load_vector

    def grows(self, before: float, after: float) -> bool:
        """Whether the external load grows from one time to another."""
        less, more = (abs(self.body.load_factor(time)) for time in (before, after))
        return more > less and bool(self.load_vector.any())

    def moved(self, u: NDArray[np.float64], time: float) -> NDArray[np.float64]:
        """Return the unknowns with prescribed motions at their values for a time."""
        del time
        return u

    def most_strained(self, step: NDArray[np.float64]) -> tuple[float, float]:
        """Return the point (x, y) that a step (n,) strains most [mm]; NaN without points."""
        del step
        return np.nan, np.nan

    def motion(self, surface: Surface, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the displacements (2, n_nodes) of a surface's nodes [mm]."""
        return u[surface.dofs].reshape(-1, 2).T

    def pull_back(
        self, surface: Surface, u: NDArray[np.float64], block: NDArray[np.float64], gaps: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return derivative rows on this part's unknowns, after the numbers of these unknowns.

        ``block`` holds the rows on the displacements of a surface; its first ``gaps`` rows are
        derivatives of gaps, the others of slips.
        """
        del u, gaps
        return surface.dofs, block
