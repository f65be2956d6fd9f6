"""Points at which strain has no bound, such as a sharp corner in contact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.errors import ModelError

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class SingularPoint:
    """A point at which strain grows without bound as the mesh is refined.

    What lies within its radius, in whichever body, is not the solution of the problem but that of
    a mesh; small-strain theory is judged by what lies outside.

    Attributes
    ----------
    at : position (x, y) before loading [mm]
    radius : how far it reaches [mm]: as far as nothing is read there, and at least over the
        elements that meet in it, 1.5 of their sides
    """

    at: tuple[float, float]
    radius: float

    def __post_init__(self) -> None:
        if len(self.at) != 2 or not np.isfinite(self.at).all():
            raise ModelError("at", self.at, "must be two finite numbers [mm]")
        if not (np.isfinite(self.radius) and self.radius > 0):
            raise ModelError("radius", self.radius, "must be positive and finite [mm]")

    def reaches(self, X: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which of the positions (2, n) [mm] lie within its radius (n,)."""
        x, y = self.at
        return np.asarray(np.hypot(X[0] - x, X[1] - y) <= self.radius)
