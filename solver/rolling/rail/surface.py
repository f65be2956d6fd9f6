"""The running surface of a section: its vertices, and the means under their hats."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from solver.errors import ModelError
from solver.fem.surface import extract
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.rolling.rail.hats import SHARES
from solver.rolling.rail.patch_grid import PatchGrid
from solver.rolling.rail.section import Section


class RunningSurface:
    """A chain of m - 1 edges of a section, on which a load may act, from small to large z.

    Parameters
    ----------
    section : the cross-section
    boundary : name of the chain

    Attributes
    ----------
    z, y : (m,) positions of the vertices [mm]
    angle : (m,) slope angle of the surface at the vertices [rad]

    Raises
    ------
    ModelError
        if the edges are no chain along which z increases
    """

    def __init__(self, section: Section, boundary: str) -> None:
        plane = section.plane
        chain = extract(plane, boundary)
        edges = chain.nodes[chain.edges]
        if plane.X[0, edges[0, 0]] > plane.X[0, edges[-1, 1]]:
            edges = edges[::-1, [1, 0, 2]]
        self.z, self.y = plane.X[:, np.append(edges[:, 0], edges[-1, 1])]
        if not (np.diff(self.z) > 0).all():
            raise ModelError("boundary", boundary, "must be a chain along which z increases")
        self._edges, self._n = edges, plane.X.shape[1]
        ends = np.stack([plane.X[:, edges] @ shape_derivatives(np.array(xi), 3) for xi in (-1, 1)])
        slopes = np.arctan2(ends[:, 1], ends[:, 0])  # (2, m - 1): at both ends of each edge
        both = np.append(slopes[0], slopes[1, -1]), np.append(slopes[0, 0], slopes[1])
        self.angle = (both[0] + both[1]) / 2

    def grid(self, spacing: float, ahead: float, stations: int) -> PatchGrid:
        """Return the grid of the surface with some stations; see `PatchGrid`."""
        return PatchGrid(
            z=self.z, y=self.y, angle=self.angle, spacing=spacing, ahead=ahead, stations=stations
        )

    def rows(self, grid: PatchGrid) -> sparse.csr_array:
        """Return the means under the hats (3 m, n) of the section's displacements.

        Rows are along x at all vertices, then along y, then along z.
        """
        at = np.stack([shape_functions(np.array(2 * share - 1), 3) for share in SHARES])
        edges = len(self._edges)
        columns = np.broadcast_to(self._edges[:, None, :], (edges, *at.shape))
        values = np.broadcast_to(at, columns.shape)
        indptr = np.arange(0, values.size + 1, at.shape[1])
        at_points = sparse.csr_array(
            (values.ravel(), columns.ravel(), indptr), shape=(2 * edges, self._n)
        )
        mean = sparse.csr_array(sparse.csr_array(grid.hats.mean) @ at_points)
        each = [sparse.kron(mean, np.eye(3)[[axis]]) for axis in range(3)]
        return sparse.csr_array(sparse.vstack(each))
