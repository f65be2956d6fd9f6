"""The outlines of the bodies on the map, as closed curves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from solver.results.mesh_fields import counterclockwise
from solver.results.quantities import declare, declare_along
from solver.results.run import FinishedRun, Values
from solver.tensors import AXES
from solver.typing import Array, Ints

OUTLINE = declare("outline", "number of a point of the outlines", dims=("outline",), count=True)
OUTLINE_AT = declare_along(
    "outline_{}", "position along {} of a point of the outlines before loading, NaN between them",
    "mm", dims=("outline",),
)  # fmt: skip
_STRAIGHT = 1e-9
"""Sine of the angle between two edges: their common point is left out at a smaller angle."""


def outlines(run: FinishedRun) -> Values:
    """Return the outlines of all bodies in the plane of the map; empty without a map.

    A curve ends at its first point, and has its body on the left. NaN separates two curves.
    """
    if not all(axis.size for axis in run.view.map_grid):
        return {}
    rows = [AXES.index(axis) for axis in run.view.map_axes]
    curves: list[Array] = []
    for name in run.system.names:
        whole = run.system.full(name)
        curves += closed_curves(whole.X[rows], whole.basis.element_dofs.T)
    gaps = [np.hstack([curve, np.full((2, 1), np.nan)]) for curve in curves]
    points = np.hstack(gaps)[:, :-1]
    along = {OUTLINE_AT[row]: points[k] for k, row in enumerate(rows)}
    return {OUTLINE: np.arange(points.shape[1]), **along}


def closed_curves(X: Array, cells: Ints) -> Iterator[Array]:
    """Yield the border of a mesh as closed curves (2, n), without points on straight pieces.

    Parameters
    ----------
    X : (2, n_nodes) positions [mm]
    cells : (n_cells, k) nodes of elements: corners, mid-sides, middle
    """
    corners = 3 if cells.shape[1] in (3, 6) else 4
    cells = counterclockwise(cells, X)
    start, end = cells[:, :corners], np.roll(cells[:, :corners], -1, axis=1)
    bent = cells.shape[1] >= 2 * corners
    middle = cells[:, corners : 2 * corners] if bent else start
    n = X.shape[1]
    alone = ~np.isin(start * n + end, end * n + start)  # no other element has the edge
    after: dict[int, list[tuple[int, int]]] = {}
    for a, m, b in zip(*(each[alone].tolist() for each in (start, middle, end)), strict=True):
        after.setdefault(a, []).append((m, b))
    while after:
        a = next(iter(after))
        nodes = [a]
        while a in after:
            m, b = after[a].pop()
            if not after[a]:
                del after[a]
            nodes += [m, b] if bent else [b]
            a = b
        yield _without_straight(X[:, nodes])


def _without_straight(curve: Array) -> Array:
    """Return a closed curve (2, n) without points on its straight pieces."""
    ahead = np.diff(curve, axis=1)
    before = np.roll(ahead, 1, axis=1)
    turn = ahead[0] * before[1] - ahead[1] * before[0]
    size = np.hypot(*ahead) * np.hypot(*before)
    kept = curve[:, :-1][:, np.abs(turn) > _STRAIGHT * size]
    return np.hstack([kept, kept[:, :1]])
