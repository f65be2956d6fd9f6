"""Singular points, at which strain is unbounded, such as a sharp corner in contact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.parameters import Checked, Coordinate, Length
from solver.typing import Array, Bools


@dataclass(frozen=True, slots=True, kw_only=True)
class SingularPoint(Checked):
    """A point at which strain grows without bound as the mesh is refined.

    Strain within its radius, in any body, depends on the mesh. The audit checks small-strain theory
    by the strain outside of it.

    Attributes
    ----------
    at : position (x, y) before loading [mm]
    radius : radius within which no result is used [mm]; at least 1.5 sides of the elements at the
        point
    """

    at: tuple[Coordinate, Coordinate]
    radius: Length

    def reaches(self, X: Array) -> Bools:
        """Return which of the positions (2, n) [mm] lie within its radius (n,)."""
        x, y = self.at
        return np.asarray(np.hypot(X[0] - x, X[1] - y) <= self.radius)
