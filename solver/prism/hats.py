"""Hats across a surface: functions that are 1 at one vertex, 0 at the others, linear between."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

SHARES = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
"""Positions of the two Gauss points of an edge, over its length."""


@dataclass(frozen=True, slots=True)
class Hats:
    """The hats of m vertices at positions ``s`` (m,) along a surface, increasing [mm]."""

    s: Array

    @property
    def width(self) -> Array:
        """Integrals (m,) of the hats [mm]."""
        edges = np.diff(self.s)
        return np.asarray((np.append(edges, 0.0) + np.append(0.0, edges)) / 2)

    @property
    def points(self) -> Array:
        """Positions (2m - 2,) of two Gauss points an edge [mm]."""
        return self.along(self.s[:-1], self.s[1:])

    @property
    def mean(self) -> Array:
        """Weights (m, 2m - 2): mean values under the hats, of values at the points.

        The mean under hat j is the integral of value times hat, over that of the hat.
        """
        edges, m = np.arange(len(self.s) - 1), len(self.s)
        half = np.diff(self.s)[:, None] / 2
        weights = np.zeros((m, m - 1, 2))
        weights[edges, edges] = half * (1 - SHARES)
        weights[edges + 1, edges] = half * SHARES
        return weights.reshape(m, -1) / self.width[:, None]

    @property
    def nearest(self) -> Array:
        """Weights (m, 2m - 2): the sum of hats nearest to a function, of its values at the points.

        Nearest means least squares. The integral over all hats is that of the function, and so is
        its product with every hat: forces on the vertices of a mesh are those of the function.
        """
        mean = self.mean
        hats = np.stack([self.along(each[:-1], each[1:]) for each in np.eye(len(self.s))], axis=1)
        return np.asarray(np.linalg.solve(mean @ hats, mean))

    @staticmethod
    def along(first: Array, last: Array) -> Array:
        """Return values (2m - 2,) at the points, of functions linear on every edge.

        ``first`` and ``last`` (m - 1,) are the values at both ends of the edges.
        """
        return np.asarray((first[:, None] + (last - first)[:, None] * SHARES).ravel())
