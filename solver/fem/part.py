"""What every part of a system does unless it does better."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.fem.surface import Surface
    from solver.model.body import Body


class Part:
    """A body as the increment sees it: unknowns ``u`` (n,), forces, surfaces that move.

    ``load`` (n,) holds the external nodal forces at load factor one [N].
    """

    n: int
    body: Body
    load: NDArray[np.float64]

    @property
    def volumes(self) -> NDArray[np.float64]:
        """Volume of the points (n_points,) [mm3]; a part without points has none."""
        return np.zeros(0)

    def start(self) -> NDArray[np.float64]:
        """Return the unknowns (n,) before anything happens."""
        return np.zeros(self.n)

    def external(self, load: float) -> NDArray[np.float64]:
        """Return the external nodal forces (n,) at a load factor [N]."""
        return load * self.load

    def grows(self, before: float, after: float) -> bool:
        """Whether the external load grows from one load factor to another."""
        return abs(after) > abs(before) and bool(self.load.any())

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
