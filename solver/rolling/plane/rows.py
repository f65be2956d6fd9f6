"""Rows of integration points along which material flows through a fixed mesh.

The load moves along +x, so material flows along -x. In a window around the load the mesh is uniform
along x and may yield; columns of points are numbered downstream. Behind the window, up to the left
end of the mesh, plastic strain is that of the last column after unloading to the residual state.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.interpolate import RegularGridInterpolator

from solver.fem.discretisation import Discretisation
from solver.linear import solvers as linear
from solver.linear.schur import SchurComplement
from solver.materials.law import Law
from solver.materials.state import PlasticState
from solver.rolling.flow import Flow, allowed_inflow
from solver.rolling.load import FlowPast
from solver.rolling.plane.layers import Layers
from solver.typing import Array, Bools, Ints


class CondensedTrack:
    """The elastic half-plane reduced to the nodes of its window, exactly.

    It is the inverse of an elastic stiffness, for forces on the kept nodes and, slower, on all
    nodes. Outside the window plastic strain depends on depth alone. The condensed stiffness is
    sparse except for a dense block on the boundary of the window, and has a third of the unknowns.

    Parameters
    ----------
    part : the body
    nodes : nodes that are kept; no support holds them

    Attributes
    ----------
    kept : (m,) unknowns of these nodes, increasing
    """

    def __init__(self, part: Discretisation, nodes: Ints) -> None:
        self.kept = np.sort(np.concatenate([2 * nodes, 2 * nodes + 1]))
        K = part.elastic_matrix()
        self._outside = SchurComplement(K, self.kept, np.setdiff1d(part.free, self.kept))
        at = self._outside.boundary
        pairs = np.repeat(at, len(at)), np.tile(at, len(at))
        taken = sparse.csr_array((self._outside.taken.ravel(), pairs), shape=(len(self.kept),) * 2)
        upper = sparse.csr_array(sparse.triu(K[self.kept][:, self.kept] - taken, format="csr"))
        upper.sort_indices()
        self._window = linear.analyse(upper, coupled=True)
        self._window.factorise(upper.data)

    def place(self, unknowns: Ints) -> Ints:
        """Return the positions of unknowns of the body among the kept ones."""
        return np.searchsorted(self.kept, unknowns)

    def condense(self, force: Array) -> Array:
        """Return condensed forces (m, ...), equivalent to forces on all nodes (n, ...) [N]."""
        return self._outside.begin(force).condensed

    def solve(self, force: Array) -> Array:
        """Return displacements (m,) or (m, k) for condensed forces."""
        return self._window.solve(force)

    def expand(self, kept: Array, force: Array) -> Array:
        """Return all displacements (n,) from the kept ones (m,) and the forces (n,)."""
        return self._outside.begin(force).finish(kept)


_LEVEL = 1e-6
"""Points are on one row if their depths differ by less than this share of the window's depth."""


class FlowRows:
    """The points of the window, their strains, and the forces equivalent to plastic strain.

    Parameters
    ----------
    part : the half-plane, made of quadrilaterals in rows; its top is y = 0
    operator : the inverse of its elastic stiffness, which keeps the m unknowns of the window
    ahead, behind : the window extends from x = -behind to x = ahead [mm]
    deep : depth of the window [mm]

    Attributes
    ----------
    points : (n_rows, n_columns) numbers of the points in the window
    ahead, behind : (n_rows, n) numbers of the points before and behind the window, on these rows
    shape : n_rows, n_columns
    depth : (n_rows,) depths of the rows, increasing [mm]
    uppermost : number of rows at the smallest depth
    weights : (n_rows, n_columns) volume of the points [mm3]
    """

    def __init__(
        self,
        part: Discretisation,
        operator: CondensedTrack,
        ahead: float,
        behind: float,
        deep: float,
    ) -> None:
        self.part = part
        middle = part.points.mean(axis=2)
        shallow = middle[1] > -deep
        inside = shallow & (middle[0] > -behind) & (middle[0] < ahead)
        points = self._in_rows(inside, deep)
        self.shape = points.shape
        self.points = points
        self.weights = part.volumes[points]
        n_rows = len(points)
        elements = np.unique(points // part.weights.shape[1])
        length = float(np.ptp(part.body.mesh.p[0, part.body.mesh.t[:, elements]]))
        self.depth = -part.points[1].ravel()[points[:, 0]]
        self.uppermost = int((self.depth - self.depth[0] < _LEVEL * deep).sum())
        self._thickness = self.weights.sum(axis=1) / length
        self.ahead = self._in_rows(shallow & (middle[0] > ahead), deep)
        self.behind = downstream = self._in_rows(shallow & (middle[0] < -behind), deep)
        self._strain = sparse.csr_array(self._strain_at(points)[:, operator.kept])
        self._force = self._force_of(points, self._strain)
        # all points behind the window have the plastic strain of their row
        same = sparse.kron(
            sparse.eye_array(n_rows), np.ones((downstream.shape[1], 1)), format="csr"
        )
        each = self._force_of(downstream, self._strain_at(downstream))
        self._behind = each @ sparse.kron(same, sparse.eye_array(4), format="csr")
        # condensed, this force acts only on the boundary of the window
        self._force_behind = sparse.csr_array(operator.condense(self._behind.toarray()))

    def _in_rows(self, elements: Bools, deep: float) -> Ints:
        """Return the points of elements (n_rows, n_columns), downwards and downstream."""
        n_points = self.part.weights.shape[1]
        points = (np.flatnonzero(elements)[:, None] * n_points + np.arange(n_points)).ravel()
        x, y = self.part.points.reshape(2, -1)[:, points]
        level = np.round(y / (_LEVEL * deep)).astype(np.int64)
        return points[np.lexsort((-x, -level))].reshape(len(np.unique(level)), -1)

    def virgin(self, law: Law) -> Layers:
        """Return the state before any load."""
        k = self.uppermost
        surface = Layers(law.initial(k, 4), np.zeros(k), np.zeros(k))
        return Layers(law.initial(len(self.depth), 4), self.depth, self._thickness, surface)

    @property
    def every(self) -> Ints:
        """The points of each row along the whole body (n_rows, n), in and outside the window."""
        return np.hstack([self.points, self.ahead, self.behind])

    @cached_property
    def highest(self) -> Ints:
        """The points of the uppermost rows (n,), increasing."""
        return np.sort(self.every[: self.uppermost].ravel())

    @cached_property
    def above(self) -> Ints:
        """Positions of the points of the uppermost rows (n_uppermost, n) in `highest`."""
        return np.searchsorted(self.highest, self.every[: self.uppermost])

    def onto_surface(self, values: Array) -> Array:
        """Return values (n, ...) at the surface, extrapolated linearly from rows (2 n, ...).

        ``n`` is the number of uppermost rows.
        """
        k = self.uppermost
        near, far = self.depth[0], self.depth[k]
        return np.asarray((far * values[:k] - near * values[k : 2 * k]) / (far - near))

    def _force_of(self, points: Ints, strain: sparse.csr_array) -> sparse.csr_array:
        """Return the matrix from plastic strains at points to equivalent nodal forces."""
        stiff = 2 * self.part.body.law.elasticity.shear_modulus
        weights = stiff * np.repeat(self.part.volumes[points].ravel(), 4)
        return sparse.csr_array(strain.T @ sparse.diags_array(weights))

    def _strain_at(self, points: Ints) -> sparse.csr_array:
        """Return the matrix from displacements to strains at points, row by row."""
        part = self.part
        n_points = part.weights.shape[1]
        element, point = np.divmod(points.ravel(), n_points)
        B = part.undeformed.B[element, point]
        columns = np.broadcast_to(part.dofs[element][:, None, :], B.shape)
        indptr = np.arange(0, B.size + 1, B.shape[2])
        return sparse.csr_array(
            (B.ravel(), columns.ravel(), indptr), shape=(4 * points.size, part.n)
        )

    def strain(self, u: Array) -> Array:
        """Return the strains (n_rows, n_columns, 4) of displacements (m,)."""
        return np.asarray((self._strain @ u).reshape(*self.shape, 4))

    def interpolated(self, strain: Array, rows: FlowRows) -> Array:
        """Return strains (n_rows, n_columns, 4) here, interpolated from those of other rows."""
        x, depth = (rows.part.points.reshape(2, -1)[k, rows.points] for k in (0, 1))
        here = self.part.points.reshape(2, -1)[:, self.points]
        along = RegularGridInterpolator(
            (depth[::-1, 0], x[0, ::-1]), strain[::-1, ::-1], bounds_error=False, fill_value=None
        )
        return np.asarray(along((here[1], here[0])))

    def force(self, flow: Array, behind: Array) -> Array:
        """Return the condensed nodal forces (m,) equivalent to plastic strain [N].

        Parameters
        ----------
        flow : (n_rows, n_columns, 4) plastic strain in the window
        behind : (n_rows, 4) plastic strain everywhere behind it
        """
        return np.asarray(self._force @ flow.ravel() + self._force_behind @ behind.ravel())

    def force_behind(self, behind: Array) -> Array:
        """Return the forces on all nodes (n,) equivalent to plastic strain behind the window."""
        return np.asarray(self._behind @ behind.ravel())


class RowFlow(FlowPast[Layers]):
    """Plastic strain along all rows of a window for given strains, and its derivative."""

    def __init__(self, rows: FlowRows, law: Law, before: Layers, added: Array, parts: int) -> None:
        self._rows, self._law, self._added, self._parts = rows, law, added, parts
        self._flow = self._of(before, added)
        super().__init__(law, before, self._flow.sweep)
        self.after = replace(before, state=self._flow.after)
        plastic = np.moveaxis(self.states.plastic_strain, 0, 2)
        self.force = rows.force(
            plastic - before.plastic_strain[:, None],
            self.after.plastic_strain - before.plastic_strain,
        )

    def left(self) -> tuple[PlasticState, Layers]:
        """Return the internal variables (..., n, n_columns) at the surface, and the layers behind.

        The strain at the surface is extrapolated from the uppermost rows. Plastic strain changes
        too abruptly in depth for that; it follows from the strain, as on any row.
        """
        top = self._begin.top
        flow = self._of(top, self._rows.onto_surface(self._added))
        return flow.sweep.states, replace(self.after, surface=replace(top, state=flow.after))

    def _of(self, before: Layers, added: Array) -> Flow:
        """Return the flow along rows with these states before and these added strains."""
        at_rest = before.strain(self._law.elasticity)[:, None]
        strain = np.concatenate([at_rest, at_rest + added], axis=1)
        return Flow(self._law, strain, before.state, self._parts)

    @property
    def beyond(self) -> str:
        """Side where the window is too small, because points yield there; else empty.

        Points that an earlier pass left on the yield surface may flow a little there.
        """
        before = self._begin.accumulated
        ahead = (self.states.accumulated[:, 0] - before).max()
        below = self.after.accumulated[-1] - before[-1]
        if ahead > allowed_inflow(self._law, self.most_added):
            return "ahead"
        return "below" if below > allowed_inflow(self._law, 0.0) else ""

    def along(self, added: Array) -> Array:
        """Return the nodal forces (m,) for a change of the strains."""
        return self._rows.force(*self._flow.along(added))
