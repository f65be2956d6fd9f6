"""Division of elements into cells, for the integration of a field with kinks and jumps.

An element is the image of the unit square; for a triangle one side collapses to a point. Cells
begin as whole squares, or as their ``parts``. A cell is halved if the integrals of the field by
Gauss's and Lobatto's rule differ, along the direction in which they differ more. A feature narrower
than a sixth of the first cells may lie between all points of both rules, and is then missed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from skfem import CellBasis

from solver.typing import Array, Bools, Ints

Rule = tuple[Array, Array]


_ACCURATE, _HALVINGS, _MOST = 1e-7, 40, 200_000
"""Error of the integral over a cell, over the largest integral over an element: a cell with a
larger one is halved. Most halvings in a row. Most cells."""
_END = 1 - 1e-9
LOBATTO = (
    np.array([-_END, -((3 / 7) ** 0.5), 0.0, (3 / 7) ** 0.5, _END]),
    np.array([1 / 10, 49 / 90, 32 / 45, 49 / 90, 1 / 10]),
)
"""Lobatto's rule, as exact as four Gauss points; its ends detect jumps outside of these."""


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """Rectangles that fill the unit squares of elements.

    Attributes
    ----------
    basis : basis of the elements
    element : (n,) element of each cell
    corner, size : (2, n) lowest corner and sides of each cell
    """

    basis: CellBasis
    element: Ints
    corner: Array
    size: Array

    def share(self, *rules: Rule) -> Array:
        """Return the weights (n, k) of points in the unit squares."""
        (_, wa), (_, wb) = rules
        return np.asarray(self.size.prod(axis=0)[:, None] * np.outer(wa, wb).ravel() / 4)

    def points(self, *rules: Rule) -> tuple[Array, Array, Array]:
        """Return local and global positions (2, n, k) of points, and their areas (n, k) [mm2].

        Parameters
        ----------
        rules : places and weights on [-1, 1], along both sides of the cells
        """
        (a, _), (b, _) = rules
        own = np.stack(np.broadcast_arrays(a[:, None], b)).reshape(2, 1, -1)
        local = self.corner[..., None] + self.size[..., None] * (1 + own) / 2
        area = self.share(*rules)
        if self.basis.mesh.t.shape[0] == 3:
            width = 1 - local[0]
            local, area = np.stack([local[0], width * local[1]]), width * area
        mapping = self.basis.mapping
        area = area * np.abs(mapping.detDF(local, tind=self.element))
        return local, np.asarray(mapping.F(local, tind=self.element)), area

    def __getitem__(self, some: Bools) -> Cells:
        return Cells(self.basis, self.element[some], self.corner[:, some], self.size[:, some])

    def halves(self, axis: Ints) -> Cells:
        """Return both halves of all cells, each divided along its axis (n,)."""
        across = axis == [[0], [1]]
        size = np.where(across, 0.5, 1.0) * self.size
        corners = np.hstack([self.corner, self.corner + across * size])
        return Cells(self.basis, np.tile(self.element, 2), corners, np.tile(size, 2))


def smooth_cells(basis: CellBasis, field: Callable[[Array], Array], parts: int = 1) -> Cells:
    """Return cells on each of which ``field``, (2, n, k) -> (2, n, k), is smooth.

    The sides of an element are first divided into at most ``parts`` parts.
    """
    gauss, count = np.polynomial.legendre.leggauss(4), basis.mesh.nelements
    parts = min(parts, max(math.isqrt(_MOST // (4 * count)), 1))
    element, n = np.repeat(np.arange(count), parts**2), count * parts**2
    corner = np.tile(np.indices((parts, parts)).reshape(2, -1) / parts, count)
    some, done = Cells(basis, element, corner, np.full((2, n), 1 / parts)), []
    _, x, area = some.points(gauss, gauss)
    areas = np.bincount(element, area.sum(axis=1))
    each = (np.bincount(element, own) for own in (np.abs(field(x)) * area).sum(axis=-1))
    whole = max(float(own.max(initial=0.0)) for own in each)
    for further in reversed(range(_HALVINGS + 1)):
        gauss_value, *others = (
            (field(some.points(*rules)[1]) * some.share(*rules)).sum(axis=-1)
            for rules in ((gauss, gauss), (LOBATTO, gauss), (gauss, LOBATTO), (LOBATTO,) * 2)
        )
        off = np.abs(np.array(others) - gauss_value).max(axis=1) * areas[some.element]
        halved = (off.max(axis=0) > _ACCURATE * whole) & (further > 0 and n < _MOST)
        done.append(some[~halved])
        if not halved.any():
            break
        some = some[halved].halves(np.where(off[0] > off[1], 0, 1)[halved])
        n = len(some.element)
    element, corner, size = (
        np.concatenate([getattr(cells, name) for cells in done], axis=-1)
        for name in ("element", "corner", "size")
    )
    return Cells(basis, element, corner, size)
