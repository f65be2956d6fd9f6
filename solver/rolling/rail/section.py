"""The cross-section of an elastic prism along x, for fields that are waves along x.

A wave of wavenumber k is ``u = (i U_x, U_y, U_z) e^{ikx}``. With u_x and the components xy and zx
of strain and stress divided by i, its strain is real for real U, and so is the stiffness:

    strain = (B0 + k B1) U,    K_k = K0 + k K1 + k^2 K2

    xx: -k U_x    yy: dU_y/dy    zz: dU_z/dz    sqrt(2) yz: (dU_y/dz + dU_z/dy) / sqrt(2)
    sqrt(2) xy: (dU_x/dy + k U_y) / sqrt(2)     sqrt(2) zx: (dU_x/dz + k U_z) / sqrt(2)

K_k is symmetric, and positive definite for k != 0. Real and imaginary parts of forces are two
right-hand sides.

O.C. Zienkiewicz, R.L. Taylor, The Finite Element Method, volume 2 (5th edition, 2000), chapter 9,
semi-analytical finite elements.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.linalg import null_space
from skfem import Mesh

from solver.errors import ModelError
from solver.fem.assembly import Assembly
from solver.fem.deformation import strain_operator
from solver.fem.nodes import Nodes
from solver.fem.surface import edges_of
from solver.materials import Material
from solver.materials.elasticity import Elasticity
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.model.body import Body
from solver.typing import Array, Ints

AXES = "xyz"
I_AXIS = 0
"""The axis of displacement that carries the factor i."""
I_COMPONENTS = (3, 5)
"""The Mandel components xy and zx, which carry the factor i."""
_EDGE_POINTS = 3
"""Number of points of an edge for springs: exact on straight edges."""
_LOOSE = 1e-9
"""The supports and springs leave a rigid motion free if the smallest singular value of its held
displacements is below this."""


class Section:
    """A cross-section of 8-node quadrilaterals with 2 x 2 points.

    Unknowns are numbered node by node, x, y, z: ``3 * node + axis``.

    Parameters
    ----------
    mesh : scikit-fem mesh of quadrilaterals; its first coordinate is z, its second y [mm]
    elasticity : elastic constants
    springs : boundary -> stiffness of its springs along x, y and z [N/mm3], the same for all waves
    supports : boundary -> displacement components that are held, letters of ``xyz``

    Attributes
    ----------
    plane : nodes and points in the plane, with the boundaries of the mesh; ``plane.X`` is (z, y)
    n : number of unknowns
    dofs : (n_elements, 24) unknowns of the elements
    springs : boundary -> stiffness (3,) along x, y and z [N/mm3]
    free : unknowns that no support holds
    points : (2, n_elements, 4) positions (z, y) of the points [mm]
    weights : (n_elements, 4) area of the points [mm2]
    B0, B1 : (n_elements, 4, 6, 24) Mandel strain operator and its derivative by k [1/mm, 1]

    Raises
    ------
    ModelError
        if the mesh is bad, a boundary unknown, a stiffness negative, or a motion of the whole prism
        is not held
    """

    def __init__(
        self,
        mesh: Mesh,
        elasticity: Elasticity,
        springs: Mapping[str, tuple[float, float, float]] | None = None,
        supports: Mapping[str, str] | None = None,
    ) -> None:
        self.elasticity = elasticity
        material = Material(
            youngs_modulus=elasticity.youngs_modulus, poisson_ratio=elasticity.poisson_ratio
        )
        self.plane = plane = Nodes(Body(name="section", mesh=mesh, material=material))
        basis = plane.basis
        self.points, self.weights = plane.points, np.asarray(basis.dx)
        nodes = basis.element_dofs.T
        self.n = 3 * plane.X.shape[1]
        self.dofs = (3 * nodes[..., None] + np.arange(3)).reshape(len(nodes), -1)
        shape = self.weights.shape
        N = np.array([np.broadcast_to(np.asarray(b[0]), shape) for b in basis.basis])
        along_z, along_y = np.array([b[0].grad for b in basis.basis]).swapaxes(0, 1)
        nothing = np.zeros_like(N)
        across = np.stack([nothing, along_y, along_z])
        self.B0 = strain_operator(N, across, self.weights, "")
        # d/dx is i k: of a component that carries i it makes -k
        self.B1 = strain_operator(N, np.stack([N, nothing, nothing]), self.weights, "")
        self.B1[:, :, 0] *= -1.0
        self.springs = {name: self._checked(name, each) for name, each in (springs or {}).items()}
        held = self._held(supports or {})
        self.free = np.setdiff1d(np.arange(self.n), held)
        self._check_held(held)

    def _held(self, supports: Mapping[str, str]) -> Ints:
        """Return the unknowns that supports hold."""
        held = [np.zeros(0, dtype=np.int64)]
        for boundary, axes in supports.items():
            self.plane.body.facets(boundary, "supports")
            if not axes or not set(axes) <= set(AXES):
                raise ModelError(f"supports.{boundary}", axes, "must be letters of xyz")
            nodes = self.plane.boundary_nodes(boundary)
            held += [3 * nodes + AXES.index(axis) for axis in axes]
        return np.unique(np.concatenate(held))

    def _checked(self, boundary: str, stiffness: tuple[float, float, float]) -> Array:
        """Return the stiffness (3,) of springs, or raise `ModelError`."""
        along = np.array(stiffness, dtype=float)
        if along.shape != (3,) or not (np.isfinite(along) & (along >= 0)).all():
            allowed = "must be three numbers, not negative: along x, y and z [N/mm3]"
            raise ModelError(f"springs.{boundary}", stiffness, allowed)
        self.plane.body.facets(boundary, "springs", outer=True)
        return along

    def _check_held(self, held: Ints) -> None:
        """Raise `ModelError` if neither supports nor springs hold a motion of the whole prism."""
        motions = self.rigid / np.abs(self.rigid).max(axis=0)
        rows = [motions[held]]
        for boundary, along in self.springs.items():
            nodes = self.plane.boundary_nodes(boundary)
            rows += [motions[3 * nodes + axis] for axis in range(3) if along[axis] > 0]
        if np.linalg.matrix_rank(np.concatenate(rows), tol=_LOOSE) < motions.shape[1]:
            allowed = "must hold the prism, with its supports: along x, y, z and about x"
            raise ModelError("springs", sorted(self.springs), allowed)

    @cached_property
    def rigid(self) -> Array:
        """Motions (n, 4) that strain nothing: by 1 mm along x, y, z, and by 1 rad about x [mm].

        The axis of the turn is in the middle of the nodes.
        """
        z, y = self.plane.X - self.plane.X.mean(axis=1, keepdims=True)
        motions = np.zeros((len(z), 3, 4))
        motions[:, 0, 0] = motions[:, 1, 1] = motions[:, 2, 2] = 1.0
        motions[:, 1, 3], motions[:, 2, 3] = -z, y
        return motions.reshape(self.n, 4)

    @cached_property
    def loose(self) -> Array:
        """Sums (n, q) of motions of `rigid` that springs alone hold, and no support."""
        motions = self.rigid / np.abs(self.rigid).max(axis=0)
        held = np.setdiff1d(np.arange(self.n), self.free)
        return np.asarray(motions @ null_space(np.vstack([motions[held], np.zeros(4)])))

    @cached_property
    def sprung(self) -> Array:
        """Forces (n, q) of the springs under the motions `loose`, per length [N/mm]."""
        each = np.zeros((*self.dofs.shape, self.dofs.shape[1]))
        for boundary, along in self.springs.items():
            self._add_springs(each, boundary, along)
        forces = np.zeros_like(self.loose)
        np.add.at(forces, self.dofs, each @ self.loose[self.dofs])
        return forces

    @cached_property
    def mean_motions(self) -> Array:
        """Mean motions (6, n) of the section by its displacements, weighted with the area.

        They are those of `rigid`, and the turns about z and y, by which x-displacement is linear in
        y and z. Their transpose are forces over the section with these resultants.
        """
        z, y = self.plane.X - self.plane.X.mean(axis=1, keepdims=True)
        motions = np.zeros((len(z), 3, 6))
        motions[..., :4] = self.rigid.reshape(-1, 3, 4)
        motions[:, I_AXIS, 4], motions[:, I_AXIS, 5] = y, z
        basis = self.plane.basis
        each = [(np.asarray(b[0]) * self.weights).sum(axis=1) for b in basis.basis]
        area = np.bincount(basis.element_dofs.ravel(), np.concatenate(each), len(z))
        weighted = (motions * area[:, None, None]).reshape(self.n, -1).T
        return np.asarray(np.linalg.solve(weighted @ motions.reshape(self.n, -1), weighted))

    @cached_property
    def _elements(self) -> tuple[Array, Array, Array]:
        """The matrices (n_elements, 24, 24) of the elements that make K0, K1 and K2 [N/mm ...]."""
        C = self.elasticity.stiffness(6)
        flat = len(self.weights), -1, self.B0.shape[-1]

        def product(B: Array, other: Array) -> Array:
            stress = np.matmul(C, other) * self.weights[..., None, None]
            return np.matmul(B.reshape(flat).swapaxes(1, 2), stress.reshape(flat))

        K0, K1, K2 = (
            product(*both) for both in ((self.B0, self.B0), (self.B0, self.B1), (self.B1, self.B1))
        )
        for boundary, along in self.springs.items():
            self._add_springs(K0, boundary, along)
        return K0, K1 + K1.swapaxes(1, 2), K2

    def _add_springs(self, K0: Array, boundary: str, along: Array) -> None:
        """Add the springs of a boundary to the matrices (n_elements, 24, 24) of the elements."""
        plane = self.plane
        elements = plane.body.mesh.f2t[0, plane.body.facets(boundary)]
        edges = edges_of(plane, boundary)
        at = (plane.basis.element_dofs[:, elements, None] == edges[None]).argmax(axis=0)
        X = plane.X[:, edges]
        for xi, weight in zip(*np.polynomial.legendre.leggauss(_EDGE_POINTS), strict=True):
            N = shape_functions(np.array(xi), 3)
            size = weight * np.linalg.norm(X @ shape_derivatives(np.array(xi), 3), axis=0)
            for axis, spring in enumerate(along):
                own = 3 * at + axis
                each = spring * size[:, None, None] * np.outer(N, N)
                np.add.at(K0, (elements[:, None, None], own[:, :, None], own[:, None, :]), each)

    def stiffness(self, unknowns: Ints) -> Stiffness:
        """Return the stiffness on some unknowns, numbered in their order, for any wavenumber."""
        assembly = Assembly(self.dofs, unknowns, self.n)
        terms = [assembly.values(slice(None), each) for each in self._elements]
        return Stiffness(assembly.pattern, np.stack(terms))

    def strain_matrices(
        self, elements: Ints, unknowns: Ints
    ) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Return B0 and B1 of all points of some elements as sparse matrices on some unknowns.

        Rows (6 n_points) are component by component, columns in the order of the unknowns.
        """
        place = np.full(self.n, len(unknowns))
        place[unknowns] = np.arange(len(unknowns))
        columns = place[self.dofs[elements]]

        def matrix(B: Array) -> sparse.csr_array:
            flat = B[elements].transpose(2, 0, 1, 3)
            at = np.broadcast_to(columns[None, :, None, :], flat.shape)
            rows = flat.shape[0] * flat.shape[1] * flat.shape[2]
            indptr = np.arange(rows + 1) * flat.shape[3]
            whole = sparse.csr_array(
                (flat.ravel(), at.ravel(), indptr), shape=(rows, len(unknowns) + 1)
            )
            own = sparse.csr_array(whole[:, : len(unknowns)])
            own.eliminate_zeros()
            return own

        return matrix(self.B0), matrix(self.B1)


@dataclass(frozen=True, slots=True, eq=False)
class Carried:
    """Motions of the whole section that only springs hold, separated from a solve for k = 0.

    On soft springs a section that is loaded every short length turns by radians. If the material is
    nearly incompressible, rounding of its stiffness times that motion gives forces that are not
    negligible. So the reactions of the springs balance the forces first: ``K u = f`` is solved with
    K R = G as

        u = R a + v,    R' G a = R' f,    K v = f - G a,    G' v = 0

    Attributes
    ----------
    motions : R (m, q), on the unknowns of the solve; see `Section.loose`
    reactions : G (m, q), forces of the springs under them, condensed to these unknowns [N/mm]
    """

    motions: Array
    reactions: Array

    def solved(self, solve: Callable[[Array], Array], forces: Array) -> Array:
        """Return u (m, ...) for forces (m, ...), by the solve with K."""
        stiffness = self.motions.T @ self.reactions
        by = np.linalg.solve(stiffness, self.motions.T @ forces)
        left = solve(forces - self.reactions @ by)
        by -= np.linalg.solve(stiffness, self.reactions.T @ left)  # by rounding alone
        return np.asarray(left + self.motions @ by)


class Stiffness:
    """K_k = K0 + k K1 + k^2 K2 on some unknowns of a section.

    Attributes
    ----------
    pattern : upper triangle of all K_k, values not set
    """

    def __init__(self, pattern: sparse.csr_array, terms: Array) -> None:
        self.pattern, self._terms = pattern, terms

    def at(self, k: float) -> Array:
        """Return the values of K_k on the pattern [N/mm2]."""
        K0, K1, K2 = self._terms
        return np.asarray(K0 + k * (K1 + k * K2))

    @property
    def terms(self) -> list[sparse.csr_array]:
        """The whole matrices K0, K1 and K2."""
        own, found = self.pattern, []
        for data in self._terms:
            upper = sparse.csr_array((data, own.indices, own.indptr), shape=own.shape)
            found.append(sparse.csr_array(upper + sparse.triu(upper, 1).T))
        return found
