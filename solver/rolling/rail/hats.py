"""Hats across a surface: functions that are 1 at one vertex, 0 at the others, linear between."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.typing import Array

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

    def nearest(self, shares: Array, weights: Array) -> Array:
        """Weights (m, n (m - 1)): the sum of hats nearest to a function, of its values at points.

        Nearest means least squares. The integral over all hats is that of the function, and so is
        its product with every hat: forces on the vertices of a mesh are those of the function.

        Parameters
        ----------
        shares, weights : (n,) positions of the points of an edge, over its length, and the weights
            by which values there make the mean over the edge
        """
        edges, m = np.arange(len(self.s) - 1), len(self.s)
        length = np.diff(self.s)[:, None]
        products = np.zeros((m, m - 1, len(shares)))
        products[edges, edges] = length * weights * (1 - shares)
        products[edges + 1, edges] = length * weights * shares
        hats = np.diag(4 * self.width) + np.diag(length[:, 0], 1) + np.diag(length[:, 0], -1)
        return np.asarray(np.linalg.solve(hats / 6, products.reshape(m, -1)))

    @staticmethod
    def along(first: Array, last: Array) -> Array:
        """Return values (2m - 2,) at the points, of functions linear on every edge.

        ``first`` and ``last`` (m - 1,) are the values at both ends of the edges.
        """
        return np.asarray((first[:, None] + (last - first)[:, None] * SHARES).ravel())
