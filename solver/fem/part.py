"""What the increments ask of a body: unknowns, forces, surfaces that move."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.fem.surface import Surface
    from solver.model.body import Body


class Part:
    """A body as the increments see it; this base class answers for a body that does not move.

    Its unknowns are ``u`` (n,); ``moves`` tells whether its load moves over the bodies.

    ``load_vector`` (n,) holds the nodal forces of the body's pressures [N].
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
        """Return the unknowns (n,) before anything happens."""
        return np.zeros(self.n)

    def external(self, time: float) -> NDArray[np.float64]:
        """Return the external nodal forces (n,) at a time [N]."""
        return self.body.load_factor(time) * self.load_vector

    def grows(self, before: float, after: float) -> bool:
        """Whether the external load grows from one time to another."""
        less, more = (abs(self.body.load_factor(time)) for time in (before, after))
        return more > less and bool(self.load_vector.any())

    def moved(self, u: NDArray[np.float64], time: float) -> NDArray[np.float64]:
        """Return the unknowns with what moves by itself gone on to a time."""
        del time
        return u

    def most_strained(self, step: NDArray[np.float64]) -> tuple[float, float]:
        """Return where a step (n,) strains this part most [mm]; nowhere in one without points."""
        del step
        return np.nan, np.nan

    def motion(self, surface: Surface, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the displacements (2, n_nodes) of a surface's nodes [mm]."""
        return u[surface.dofs].reshape(-1, 2).T

    def pull_back(
        self, surface: Surface, u: NDArray[np.float64], block: NDArray[np.float64], gaps: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return unknowns and rows on them from rows on a surface's displacements.

        The first ``gaps`` rows are those of gaps, the others those of slips.
        """
        del u, gaps
        return surface.dofs, block
