"""Meshes made from points and cells, as files have them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from skfem import Mesh

    Array = NDArray[np.float64]
    Numbers = NDArray[np.int64]


def mesh_of_cells(points: Array, cells: Numbers, corners: int) -> tuple[Mesh, Numbers]:
    """Return the mesh of cells, and the number of its corner at each point, -1 at other points.

    Parameters
    ----------
    points : (n, 2) points
    cells : (m, k) points of the cells: corners one after the other, then the middles of the sides
        from the first corner on, then the middle, or only some of these
    corners : 3 or 4
    """
    from skfem import MeshQuad, MeshQuad2, MeshTri, MeshTri2

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
        X = points[cells].transpose(2, 1, 0)
        middle = X[:, 8] if cells.shape[1] == 9 else X[:, 4:8].sum(1) / 2 - X[:, :4].sum(1) / 4
        at[:, dofs[8]] = middle
    return curved(doflocs=at, t=bent.t, sort_t=False, validate=False), number


def facets_of(mesh: Mesh, edges: Numbers) -> Numbers:
    """Return the facets (n,) of edges (n, 2), pairs of corners; -1 where there is none."""
    known = {ends: k for k, ends in enumerate(map(tuple, np.sort(mesh.facets, axis=0).T.tolist()))}
    pairs = map(tuple, np.sort(edges, axis=1).tolist())
    return np.array([known.get(pair, -1) for pair in pairs], dtype=np.int64)
