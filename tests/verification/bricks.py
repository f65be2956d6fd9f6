"""A small model of 20-node bricks: material stands still, and a load moves over it.

It shares with `solver.rolling.rail` the material law alone. Along x the model repeats itself.
Bricks have their usual 2 x 2 x 2 Gauss points. Material is at other points, which are equispaced
along x: two in each brick, half a brick apart. Strain, and the stress that plastic strain takes
away, are linear along a brick from one to the other.

Strain and stress are Mandel vectors (xx, yy, zz, sqrt(2) xy, sqrt(2) yz, sqrt(2) zx).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, gmres
from skfem import Basis, ElementHexS2, FacetBasis, MeshHex

from solver.linear import solvers as linear
from solver.materials.elasticity import Elasticity
from solver.materials.law import Law
from solver.materials.state import PlasticState, Response
from solver.tensors import SQRT2, deviator

Array = NDArray[np.float64]
Points = NDArray[np.int64]
_TOLERANCE = 1e-4
"""Largest deviatoric strain of a correction, times 2 G / yield stress, of a converged increment."""
_FORCING = 0.05
_STEPS = 40
_SIGNS = np.array([(p, q, r) for p in (-1, 1) for q in (-1, 1) for r in (-1, 1)])
"""Places of the 8 points of a brick, along its axes, which are z, x and y."""
_TERMS = (
    (0, 0, 0, 1.0), (1, 1, 1, 1.0), (2, 2, 2, 1.0),
    (3, 0, 1, 1 / SQRT2), (3, 1, 0, 1 / SQRT2), (4, 1, 2, 1 / SQRT2),
    (4, 2, 1, 1 / SQRT2), (5, 2, 0, 1 / SQRT2), (5, 0, 2, 1 / SQRT2),
)  # fmt: skip
"""Terms of strain: component, axis of displacement, axis of derivative, factor."""


@dataclass(frozen=True)
class BrickState:
    """Internal variables and strain (6, n) at the n points that may flow."""

    state: PlasticState
    strain: Array


class Bricks:
    """Half of a block, z >= 0, that repeats itself along x and is held at its lowest nodes.

    Parameters
    ----------
    x, y, z : lines of the grid, increasing, those along x equispaced [mm]; the last x is the first
        one again, and z begins at 0, the plane of symmetry
    elasticity : elastic constants

    Attributes
    ----------
    points : (3, n_points) positions of the points of material [mm]
    weights : (n_points,) volumes of the points [mm3]
    double_shear : 2 G [MPa]; plastic strain times it is missing in stress, for it keeps volume
    """

    def __init__(self, x: Array, y: Array, z: Array, elasticity: Elasticity) -> None:
        self._C = elasticity.stiffness(6)
        self.double_shear = 2 * elasticity.shear_modulus
        mesh, element = MeshHex.init_tensor(x, y, z), ElementHexS2()
        at = _SIGNS.T / np.sqrt(3.0)
        own = at * [[1.0], [np.sqrt(3.0) / 2], [1.0]]
        self._basis = basis = Basis(mesh, element, quadrature=((1 + at) / 2, np.full(8, 1 / 8)))
        self.points = np.asarray(mesh.mapping().F((1 + own) / 2)).reshape(3, -1)
        self.weights = basis.dx.ravel()
        X = basis.doflocs
        same = np.where([[True], [False], [False]] & np.isclose(X, x[-1]), x[0], X)
        _, node = np.unique(same.round(6), axis=1, return_inverse=True)
        held = np.zeros((node.max() + 1, 3), dtype=bool)
        held[node[np.isclose(X[1], y[0])]] = True
        held[node[np.isclose(X[2], z[0])], 2] = True
        number = np.where(held, -1, np.cumsum(~held).reshape(held.shape) - 1)
        self._n, self._number = int((~held).sum()), number[node].T
        between = np.eye(8), np.array([(_SIGNS == s * [1, -1, 1]).all(axis=1) for s in _SIGNS])
        half = np.sqrt(3.0) / 4
        to_own = (0.5 + half) * between[0] + (0.5 - half) * between[1]
        each = sparse.eye_array(6 * mesh.nelements)
        gauss = self._strain_operator()
        self._factor = self._factorised(gauss)
        self._strain = sparse.csr_array(sparse.kron(each, to_own) @ gauss)
        volume = sparse.diags_array(np.tile(self.weights, 6))
        self._force = sparse.csr_array(
            (gauss.T @ volume @ sparse.kron(each, np.linalg.inv(to_own))).tocsr()
        )

    def _strain_operator(self) -> sparse.csr_array:
        """Return the operator (6 n_points, n) from displacements to strain at the Gauss points."""
        grad = np.array([b[0].grad for b in self._basis.basis]).swapaxes(0, 1)
        count = len(self.weights)
        at = np.broadcast_to(np.arange(count).reshape(grad.shape[2:]), grad.shape[1:])
        number = self._number[:, self._basis.element_dofs]
        rows, columns, values = [], [], []
        for component, axis, along, factor in _TERMS:
            column = np.broadcast_to(number[axis][..., None], at.shape)
            free = column >= 0
            rows.append(component * count + at[free])
            columns.append(column[free])
            values.append(factor * grad[along][free])
        where = np.concatenate(rows), np.concatenate(columns)
        shape = 6 * count, self._n
        return sparse.csr_array(sparse.coo_array((np.concatenate(values), where), shape=shape))

    def _factorised(self, strain: sparse.csr_array) -> linear.LinearSolver:
        """Return the factorised elastic stiffness."""
        C = sparse.kron(self._C, sparse.diags_array(self.weights), format="csr")
        upper = sparse.csr_array(sparse.triu(strain.T @ (C @ strain)))
        upper.sort_indices()
        factor = linear.analyse(upper)
        factor.factorise(upper.data)
        return factor

    def strain(self, u: Array) -> Array:
        """Return the strain (6, n_points) of displacements."""
        return np.asarray(self._strain @ u).reshape(6, -1)

    def forces(self, stress: Array) -> Array:
        """Return the nodal forces of a stress (6, n_points) at the points [N]."""
        return np.asarray(self._force @ stress.ravel())

    def solve(self, force: Array) -> Array:
        """Return the elastic displacements for nodal forces."""
        return self._factor.solve(force)

    def pressed(self, pressure: Callable[[Array, Array], Array]) -> Array:
        """Return the nodal forces of a pressure (x, z) on the top [N]."""
        mesh = self._basis.mesh
        top = mesh.facets_satisfying(lambda X: np.isclose(X[1], X[1].max()))
        xi, weight = np.polynomial.legendre.leggauss(10)
        xi, weight = (1 + xi) / 2, weight / 2
        at = np.stack([np.repeat(xi, len(xi)), np.tile(xi, len(xi))])
        rule = at, np.outer(weight, weight).ravel()
        facets = FacetBasis(mesh, self._basis.elem, facets=top, quadrature=rule)
        x, _, z = np.asarray(facets.global_coordinates())
        each = pressure(x, z) * facets.dx
        by_node = np.array([(np.asarray(b[0]) * each).sum(axis=1) for b in facets.basis])
        number = self._number[1, facets.element_dofs]
        out = np.zeros(self._n)
        np.add.at(out, number[number >= 0], -by_node[number >= 0])
        return out

    def increment(
        self, law: Law, before: BrickState, flows: Points, force: Array, given: Array
    ) -> BrickState:
        """Return the state after an increment of load, by Newton's method.

        Parameters
        ----------
        law : law of the points that may flow; all others are elastic
        before : their state before
        flows : (n,) their numbers
        force : change of the nodal forces [N]
        given : (6, n_points) change of plastic strain at all other points; 0 at those that flow
        """
        own = np.zeros_like(given)
        elastic = force + self.forces(self.double_shear * given)
        u = self.solve(elastic)
        for _ in range(_STEPS):
            strain = before.strain + self.strain(u)[:, flows]
            found = law.respond(strain, before.state)
            own[:, flows] = found.state.plastic_strain - before.state.plastic_strain
            missing = self.solve(elastic + self.forces(self.double_shear * own)) - u
            error = np.linalg.norm(deviator(self.strain(missing)[:, flows]), axis=0).max()
            if self.double_shear * error < _TOLERANCE * law.yield_stress:
                return BrickState(found.state, strain)
            u += missing + self._softened(flows, found, self.strain(missing))
        raise AssertionError("the bricks have found no equilibrium")

    def _softened(self, flows: Points, found: Response, strain: Array) -> Array:
        """Return what the flow of points adds to an elastic change of displacements.

        Newton's equation is solved on the points that flow: the change of strain e there is the
        elastic one and that by the loss of stress (C - tangent) e, by `found`.
        """
        soft = np.flatnonzero(found.yielding)
        if not len(soft):
            return np.zeros(self._n)
        rows = (np.arange(6)[:, None] * len(self.weights) + flows[soft]).ravel()
        strain_there, force_there = self._strain[rows], self._force[:, rows]
        loss = self._C[..., None] - found.tangent[..., soft]

        def by(e: Array) -> Array:
            stress = np.einsum("ijp,jp->ip", loss, e.reshape(6, -1))
            return self.solve(force_there @ stress.ravel())

        equation = LinearOperator(
            (len(rows), len(rows)), lambda e: e - strain_there @ by(e), dtype=float
        )
        e, _ = gmres(equation, strain[:, flows[soft]].ravel(), rtol=_FORCING, restart=60, maxiter=1)
        return by(e)
