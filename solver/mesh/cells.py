"""Meshes of cells given by the numbers of their points, as in files."""

from __future__ import annotations

import numpy as np
from skfem import Mesh, MeshQuad, MeshQuad2, MeshTri, MeshTri2

from solver.typing import Array, Ints


def mesh_of_cells(points: Array, cells: Ints, corners: int) -> tuple[Mesh, Ints]:
    """Return the mesh of cells, and the number of its corner at each point, -1 at other points.

    Parameters
    ----------
    points : (n, 2) points
    cells : (m, k) points of the cells: corners one after the other, then the middles of the sides
        from the first corner on, then the middle, or only some of these
    corners : 3 or 4
    """
    straight, curved = (MeshQuad, MeshQuad2) if corners == 4 else (MeshTri, MeshTri2)
    used, local = np.unique(cells[:, :corners], return_inverse=True)
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    nodes = np.ascontiguousarray(points[used].T)
    mesh = straight(nodes, np.ascontiguousarray(local.reshape(-1, corners).T), sort_t=False)
    if cells.shape[1] == corners:
        return mesh, number
    bent = curved.from_mesh(mesh)
    at = bent.doflocs.copy()
    dofs = bent.dofs.element_dofs
    for k in range(corners, 2 * corners):  # both number the sides from the first corner
        at[:, dofs[k]] = points[cells[:, k]].T
    if corners == 4:
        at[:, dofs[8]] = _middles(points, cells).T
    return curved(doflocs=at, t=bent.t, sort_t=False, validate=False), number


def triangles_of(points: Array, cells: Ints) -> tuple[Array, Ints]:
    """Return quadrilaterals as triangles: the points, and two cells for each, in its order.

    The shorter diagonal divides a quadrilateral; its middle is a new point if there are middles.
    """
    sides, n = cells[:, :4], len(points)
    span = np.hypot(*(points[sides] - points[np.roll(sides, -2, axis=1)]).T)
    turn = (np.arange(4) + (span[1] < span[0])[:, None]) % 4  # the diagonal goes from 0 to 2
    a, b, c, d = np.take_along_axis(sides, turn, axis=1).T
    if cells.shape[1] == 4:
        halves = [[a, b, c], [a, c, d]]
    else:
        ab, bc, cd, da = np.take_along_axis(cells[:, 4:8], turn, axis=1).T
        points = np.concatenate([points, _middles(points, cells)])
        middle = n + np.arange(len(cells))
        halves = [[a, b, c, ab, bc, middle], [a, c, d, middle, cd, da]]
    return points, np.array(halves).transpose(2, 0, 1).reshape(2 * len(cells), -1)


def collapsed(cells: Ints) -> tuple[Ints, Ints]:
    """Return which quadrilaterals have two corners at one point (n,), and their triangles."""
    same = cells[:, :4] == np.roll(cells[:, :4], -1, axis=1)
    which = np.flatnonzero(same.any(axis=1))
    side = same[which].argmax(axis=1)[:, None]
    kept = (side + np.arange(1, 4)) % 4  # the corners behind the collapsed side
    kept = kept if cells.shape[1] == 4 else np.hstack([kept, 4 + kept])
    return which, np.take_along_axis(cells[which], kept, axis=1)


def _middles(points: Array, cells: Ints) -> Array:
    """Return the middles (n, 2) of quadrilaterals with middles of sides."""
    if cells.shape[1] == 9:
        return np.asarray(points[cells[:, 8]])
    X = points[cells]
    return np.asarray(X[:, 4:8].sum(1) / 2 - X[:, :4].sum(1) / 4)


def facets_of(mesh: Mesh, edges: Ints) -> Ints:
    """Return the facets (n,) of edges (n, 2), pairs of corners; -1 where there is none."""
    known = {ends: k for k, ends in enumerate(map(tuple, np.sort(mesh.facets, axis=0).T.tolist()))}
    pairs = map(tuple, np.sort(edges, axis=1).tolist())
    return np.array([known.get(pair, -1) for pair in pairs], dtype=np.int64)
