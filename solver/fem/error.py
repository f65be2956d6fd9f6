"""Estimate of the discretisation error of stress, by recovery in patches of elements.

The stress of an element is the polynomial through the stresses at its integration points; for
reduced integration (``quad8``, ``tri6``) it is (bi)linear. Stress at these points is one order more
accurate than between them, so an error measured at the points alone would be far too small.

1. Take the stress of every element at its superconvergent points: 2 x 2 in quadratic
   quadrilaterals, 3 in quadratic triangles, the middle of others.
2. Around each inner vertex fit a polynomial of the degree of the element to the elements of its
   patch, by least squares.
3. The recovered stress is the mean of the polynomials of an element's inner vertices, weighted with
   their linear shape functions. It is one order more accurate than the stress, and continuous
   except on edges between two vertices of the boundary. If an element has no inner vertex, its
   boundary vertices count instead; their patches include the neighbours of the elements around.
4. The energy of recovered minus computed stress, by full integration, estimates that of the error.

A patch lies in one body: stress may jump where bodies touch.

References
----------
O.C. Zienkiewicz, J.Z. Zhu, Int. J. Numer. Meth. Engng 33 (1992) 1331-1364: patches (step 2).
T. Blacker, T. Belytschko, Int. J. Numer. Meth. Engng 37 (1994) 517-536: step 3.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property

import numpy as np
from scipy import sparse
from skfem.quadrature import get_quadrature

from solver.fem.discretisation import Discretisation
from solver.mesh.elements import element_type
from solver.typing import Array, Bools, Ints

_INWARD = 1e-6
"""Shift of nodes towards the element's centre, over their distance from it, for the weights."""
_SMALL = 1e-9
"""Regularisation of the terms of highest degree: one row of elements does not determine them."""


def error_estimate(part: Discretisation, stress: Array) -> tuple[float, float]:
    """Return twice the elastic energy [N mm] of recovered minus computed stress, and of stress.

    The square root of their ratio estimates the relative error in the energy norm. Elements whose
    stress is NaN, and their neighbours, do not count.

    Parameters
    ----------
    stress : (4, n_points) Mandel [MPa]
    """
    points = ErrorPoints(part)
    computed = points.computed(stress)
    error, energy = points.energies(points.recovered(stress) - computed), points.energies(computed)
    known = np.isfinite(error)
    return float(error[known].sum()), float(energy[known].sum())


class ErrorPoints:
    """The points of full integration of a body, and stress at them.

    Attributes
    ----------
    x : (2, n_elements, n) their positions [mm]
    """

    def __init__(self, part: Discretisation) -> None:
        self._part, self._kind = part, element_type(part.body.element)
        self._corners = part.basis.mesh.t.shape[0]
        self._X, weights = get_quadrature(part.basis.elem.refdom, self._kind.full_order)
        mapping = part.basis.mapping
        self.x = np.asarray(mapping.F(self._X))
        self._volume = np.abs(mapping.detDF(self._X)) * weights * part.measure(self.x)

    def energies(self, stress: Array) -> Array:
        """Return twice the elastic energy of each element (n_elements,) [N mm].

        Parameters
        ----------
        stress : (4, n_elements, n) Mandel [MPa]
        """
        elasticity = self._part.body.law.elasticity
        density = elasticity.energy_density(stress.reshape(len(stress), -1))
        return 2 * (density.reshape(self._volume.shape) * self._volume).sum(axis=1)

    def computed(self, stress: Array) -> Array:
        """Return the stress of the elements (4, n_elements, n) from that of their points."""
        return self._within(stress, self._X)

    def recovered(self, stress: Array) -> Array:
        """Return the recovered stress (4, n_elements, n) from that of the elements' points."""
        return self._recovered(stress, self._X, self.x)

    def at_nodes(self, stress: Array) -> Array:
        """Return the recovered stress at the nodes (4, n_nodes): means over the elements there.

        At the boundary it is extrapolated from inner vertices, without values of the edge itself.
        """
        basis = self._part.basis
        local = np.asarray(basis.elem.doflocs, dtype=float).T
        # on a boundary edge the weights of inner vertices vanish, but their ratios have a limit
        within = local + _INWARD * ((1 / 2 if self._corners == 4 else 1 / 3) - local)
        values = self._recovered(stress, within, np.asarray(basis.mapping.F(local)))
        nodes = basis.element_dofs.T.ravel()
        count = self._part.X.shape[1]
        sums = np.stack([np.bincount(nodes, one.ravel(), count) for one in values])
        return np.asarray(sums / np.maximum(np.bincount(nodes, minlength=count), 1))

    def _recovered(self, stress: Array, local: Array, x: Array) -> Array:
        """Return the recovered stress at x (2, n_elements, n), weighted at local points."""
        out = np.zeros((len(stress), *x.shape[1:]))
        total = np.zeros(x.shape[1:])
        fitted, scale = self._fitted(stress)
        vertices, taken = self._vertices, self._taken
        for k, hat in enumerate(_hats(local, self._corners)):
            vertex = self._part.basis.mesh.t[k]
            away = (x - vertices[:, vertex, None]) / scale[:, vertex, None]
            share = hat * taken[k][:, None]
            value = np.einsum("keq,eck->ceq", _polynomial(away, self._degree), fitted[vertex])
            out += share * value
            total += share
        return out / total

    @cached_property
    def _inner(self) -> Bools:
        """Whether a vertex (n_vertices,) is inside the body."""
        mesh = self._part.basis.mesh
        inner = np.ones(mesh.t.max() + 1, dtype=bool)
        inner[mesh.facets[:, mesh.boundary_facets()]] = False
        return inner

    @cached_property
    def _taken(self) -> Bools:
        """Which vertices of an element (corners, n_elements) count in its recovered stress."""
        inner = self._inner[self._part.basis.mesh.t]
        return inner | ~inner.any(axis=0)

    @property
    def _degree(self) -> int:
        return 2 if self._kind.quadratic else 1

    @property
    def _exact(self) -> Array:
        """Local coordinates of the superconvergent points (2, n)."""
        if self._degree == 1:
            return np.full((2, 1), 0.5 if self._corners == 4 else 1 / 3)
        order = {4: 3, 3: 2}[self._corners]
        return np.asarray(get_quadrature(self._part.basis.elem.refdom, order)[0])

    @cached_property
    def _vertices(self) -> Array:
        """Positions of the vertices (2, n_vertices), as the mesh numbers them."""
        basis = self._part.basis
        out = np.zeros((2, basis.mesh.t.max() + 1))
        out[:, basis.mesh.t] = self._part.X[:, basis.element_dofs[: self._corners]]
        return out

    def _within(self, stress: Array, at: Array) -> Array:
        """Return the stress polynomial of each element (4, n_elements, n) at local points."""
        own = np.asarray(self._part.basis.X)
        terms = _terms(own.shape[1], self._corners)
        through = _powers(at, terms) @ np.linalg.inv(_powers(own, terms))
        points = stress.reshape(len(stress), *self._part.weights.shape)
        return np.asarray(points @ through.T)

    def _fitted(self, stress: Array) -> tuple[Array, Array]:
        """Return coefficients (n_vertices, 4, k) about each vertex, and their scale (2, ...)."""
        basis = self._part.basis
        at = self._exact
        values, x = self._within(stress, at), np.asarray(basis.mapping.F(at))
        vertices = self._vertices
        terms = len(_polynomial(np.zeros((2, 1)), self._degree))
        fitted = np.zeros((vertices.shape[1], len(stress), terms))
        scale = np.ones_like(vertices)
        for vertex, elements in self._patches():
            here = x[:, elements].reshape(2, len(vertex), -1) - vertices[:, vertex, None]
            size = np.abs(here).max(axis=2)
            P = _polynomial(here / size[:, :, None], self._degree)
            normal = np.einsum("kvp,lvp->vkl", P, P)
            normal += np.diag(
                np.where(np.arange(terms) < terms - self._degree - 1, 0.0, _SMALL * P.shape[2])
            )
            samples = values[:, elements].reshape(len(stress), len(vertex), -1)
            right = np.einsum("kvp,cvp->vkc", P, samples)
            fitted[vertex] = np.linalg.solve(normal, right).swapaxes(1, 2)
            scale[:, vertex] = size
        return fitted, scale

    def _patches(self) -> Iterator[tuple[Ints, Ints]]:
        """Yield vertices (m,) and their patches (m, n), for each number n of elements."""
        mesh = self._part.basis.mesh
        elements = np.broadcast_to(np.arange(mesh.t.shape[1]), mesh.t.shape)
        ones = np.ones(mesh.t.size)
        around = sparse.csr_array((ones, (mesh.t.ravel(), elements.ravel())))
        inner = np.flatnonzero(self._inner)
        edge = np.setdiff1d(mesh.t[self._taken], inner)
        wide = sparse.csr_array((around[edge] @ around.T) @ around)
        for vertices, rows in ((inner, sparse.csr_array(around[inner])), (edge, wide)):
            lengths = np.diff(rows.indptr)
            for length in np.unique(lengths):
                some = np.flatnonzero(lengths == length)
                within = rows.indptr[some][:, None] + np.arange(length)
                yield vertices[some], rows.indices[within]


def _polynomial(x: Array, degree: int) -> Array:
    """Return all monomials up to a degree of one or two at points (2, ...) as (k, ...)."""
    one, (a, b) = np.ones_like(x[0]), x
    return np.stack([one, a, b] + ([a * a, a * b, b * b] if degree == 2 else []))


def _terms(n_points: int, corners: int) -> list[tuple[int, int]]:
    """Return the powers of x and y of as many monomials as an element has points."""
    if corners == 4:
        side = math.isqrt(n_points)
        return [(i, j) for i in range(side) for j in range(side)]
    degree = math.isqrt(2 * n_points) - 1
    return [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]


def _powers(x: Array, terms: list[tuple[int, int]]) -> Array:
    """Return monomials at local points (2, n) as (n, terms)."""
    return np.stack([x[0] ** i * x[1] ** j for i, j in terms], axis=-1)


def _hats(local: Array, corners: int) -> Array:
    """Return the linear shape functions of the corners (corners, n) at local points."""
    x, y = local
    if corners == 3:
        return np.stack([1 - x - y, x, y])
    return np.stack([(1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y])
