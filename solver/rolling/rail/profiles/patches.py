"""Quadrilateral patches between four curves, and meshes joined of them.

A patch is an array of nodes (2, n, m): corners and midsides of its elements in turn, from left to
right and upwards; n and m are odd. The node in the middle of an element follows from the other
eight, so that the element may have 8 nodes or 9.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import scipy
from scipy import sparse
from scipy.sparse.linalg import spsolve
from skfem import MeshQuad2

from solver.mesh.grids import grid, joined, mapped
from solver.typing import Array

Sides = tuple[Array, Array, Array, Array]


_STEPS, _SMALL = 30, 1e-3
"""Largest number of iterations for smooth lines; they end when no node moves by more than `_SMALL`
of the size of the patch, which changes angles by less than a degree."""


def halved(lines: Array) -> Array:
    """Return positions with the middle between each two: corners and midsides of elements."""
    out = np.empty(2 * len(lines) - 1)
    out[::2], out[1::2] = lines, (lines[1:] + lines[:-1]) / 2
    return out


def even(count: int) -> Array:
    """Return the shares of corners and midsides of equal elements."""
    return np.linspace(0, 1, 2 * count + 1)


def straight(start: Array, end: Array, shares: Array) -> Array:
    """Return points (2, n) on a straight line."""
    return start[:, None] + (end - start)[:, None] * shares


def patch(bottom: Array, right: Array, top: Array, left: Array) -> Array:
    """Return the patch between four curves.

    Transfinite interpolation; the coordinates of a node are those of the intersection of the
    straight lines that join its places on opposite sides of the unit square. Edges inside are
    straight.

    Parameters
    ----------
    bottom, top : (2, n) from left to right
    left, right : (2, m) upwards

    References
    ----------
    J.F. Thompson, B.K. Soni, N.P. Weatherill, Handbook of Grid Generation (1999), section 3.6.
    """
    low, high = (_shares(side)[:, None] for side in (bottom, top))
    near, far = (_shares(side) for side in (left, right))
    whole = 1 - (high - low) * (far - near)
    u = (low + near * (high - low)) / whole
    v = (near + low * (far - near)) / whole
    B, T, L, R = bottom[:, :, None], top[:, :, None], left[:, None], right[:, None]
    corners = (1 - u) * ((1 - v) * B[:, :1] + v * T[:, :1]) + u * (
        (1 - v) * B[:, -1:] + v * T[:, -1:]
    )
    X = (1 - v) * B + v * T + (1 - u) * L + u * R - corners
    _straighten(X)
    return X


def smooth_patch(sides: Sides, u: Array, v: Array) -> Array:
    """Return the patch between four curves whose lines are level lines of harmonic functions.

    Winslow's equations hold for the corners of its elements, with the lines at u and v:

        g22 X_uu - 2 g12 X_uv + g11 X_vv = 0,   g_ab = X_a . X_b

    Each iteration solves them with the metric g of the grid before.

    Parameters
    ----------
    sides : as for `patch`
    u, v : positions of the lines of corners, increasing; their distances give the grading

    References
    ----------
    A.M. Winslow, J. Comput. Phys. 1 (1966) 149-172.
    """
    X = patch(*sides)
    X[:, ::2, ::2] = _smoothed(X[:, ::2, ::2], u, v)
    _straighten(X)
    return X


def joined_patches(patches: Sequence[Array], names: Mapping[str, Array]) -> MeshQuad2:
    """Return the mesh of patches (2, n, m), elements counterclockwise.

    Parameters
    ----------
    names : midsides (2, n) of the facets of each boundary, in the order that they shall have
    """
    mesh = joined([_mesh(X) for X in patches])
    tree = scipy.spatial.cKDTree(mesh.doflocs[:, mesh.dofs.facet_dofs[0]].T)
    return mesh.with_boundaries({name: tree.query(X.T)[1] for name, X in names.items()})


def _mesh(X: Array) -> MeshQuad2:
    """Return the mesh of a patch; nodes in the middle of elements follow from the others."""
    nodes = X.copy()
    nodes[:, 1::2, 1::2] = (
        (X[:, :-1:2, 1::2] + X[:, 2::2, 1::2] + X[:, 1::2, :-1:2] + X[:, 1::2, 2::2]) / 2
        - (X[:, :-1:2, :-1:2] + X[:, 2::2, :-1:2] + X[:, :-1:2, 2::2] + X[:, 2::2, 2::2]) / 4
    )  # fmt: skip
    along, up = (np.arange((count + 1) // 2, dtype=float) for count in X.shape[1:])

    def node(at: Array) -> Array:
        j, i = np.rint(2 * at).astype(int)
        return np.ascontiguousarray(nodes[:, i, j])

    return mapped(grid(up, along), node)  # corners of a grid are clockwise: of this, the other way


def _straighten(X: Array) -> None:
    """Put midsides inside a patch in the middle of their edges."""
    X[:, 1::2, 2:-1:2] = (X[:, :-1:2, 2:-1:2] + X[:, 2::2, 2:-1:2]) / 2
    X[:, 2:-1:2, 1::2] = (X[:, 2:-1:2, :-1:2] + X[:, 2:-1:2, 2::2]) / 2


def _shares(points: Array) -> Array:
    """Return the shares of length (n,) of points on a curve."""
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points)))])
    return length / length[-1]


def _smoothed(X: Array, u: Array, v: Array) -> Array:
    """Return the nodes (2, n, m) with those inside moved; see `smooth_patch`."""
    n, m = len(u), len(v)
    inside = np.zeros((n, m), dtype=bool)
    inside[1:-1, 1:-1] = True
    free = np.flatnonzero(inside)
    if not free.size:  # a single row of elements
        return X
    along, across = np.eye(n), np.eye(m)
    (d1, d2), (e1, e2) = _differences(u), _differences(v)
    operators = ((d1, across), (along, e1), (d2, across), (d1, e1), (along, e2))
    by_u, by_v, by_uu, by_uv, by_vv = (
        sparse.csr_array(sparse.kron(*pair, format="csr"))[free] for pair in operators
    )
    flat = X.reshape(2, -1).copy()
    size = np.ptp(flat, axis=1).max()
    for _ in range(_STEPS):
        Xu, Xv = by_u @ flat.T, by_v @ flat.T
        g11, g12, g22 = ((a * b).sum(axis=1)[:, None] for a, b in ((Xu, Xu), (Xu, Xv), (Xv, Xv)))
        K = by_uu * g22 - 2 * by_uv * g12 + by_vv * g11
        step = spsolve(sparse.csc_array(K[:, free]), K @ flat.T).T
        flat[:, free] -= step
        if abs(step).max() < _SMALL * size:
            break
    return flat.reshape(X.shape)


def _differences(lines: Array) -> tuple[Array, Array]:
    """Return matrices (n, n) of first and second derivatives at the inner ones of uneven lines."""
    n, steps = len(lines), np.diff(lines)
    before, after = steps[:-1], steps[1:]
    both, k = before + after, np.arange(1, n - 1)
    first, second = np.zeros((2, n, n))
    first[k, k - 1], first[k, k + 1] = -after / (before * both), before / (after * both)
    first[k, k] = (after - before) / (before * after)
    second[k, k - 1], second[k, k + 1] = 2 / (before * both), 2 / (after * both)
    second[k, k] = -2 / (before * after)
    return first, second
