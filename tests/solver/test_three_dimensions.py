"""The kernels that take the dimension from their arrays, on hexahedra."""

from __future__ import annotations

import numpy as np
import pytest
from skfem import CellBasis, ElementHex1, ElementHex2, MeshHex, MeshHex2

from solver.fem.deformation import mean_dilatation, rigid_motions, strain_operator
from solver.materials import Material
from solver.tensors import SQRT2, deviator, to_tensor, von_mises

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=300.0)
ELEMENTS = {"linear": ElementHex1(), "quadratic": ElementHex2()}
AXES = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))


class Block:
    """Two skewed hexahedra and their strain operator."""

    def __init__(self, element, averaged=False):
        mesh = MeshHex.init_tensor(
            np.array([0.0, 1.0, 2.5]), np.array([0.0, 1.0]), np.array([0.0, 1.3])
        )
        skew = np.array([[1.0, 0.2, 0.1], [0.0, 1.0, -0.1], [0.1, 0.0, 1.0]])
        mesh = MeshHex(skew @ mesh.p + 0.05 * np.sin(3 * mesh.p[[1, 2, 0]]), mesh.t)
        if element is ELEMENTS["quadratic"]:
            mesh = MeshHex2.from_mesh(mesh)
        basis = CellBasis(mesh, element, intorder=4)
        self.X = basis.doflocs
        self.n = self.X.size
        values = np.array([np.broadcast_to(np.asarray(b[0]), basis.dx.shape) for b in basis.basis])
        gradients = np.array([b[0].grad for b in basis.basis]).swapaxes(0, 1)
        self.weights = basis.dx
        self.B = strain_operator(values, gradients, basis.dx, "plane_strain")
        if averaged:
            self.B = mean_dilatation(self.B, basis.dx)
        nodes = basis.element_dofs
        self.dofs = np.stack([3 * nodes + k for k in range(3)], axis=1).transpose(2, 0, 1)
        self.dofs = self.dofs.reshape(nodes.shape[1], -1)

    def strain(self, u):
        """Mandel strain (6, n_points)."""
        found = np.einsum("epci,ei->cep", self.B, u[self.dofs])
        return found.reshape(6, -1)

    def stiffness(self):
        C = STEEL.stiffness(6)
        each = np.einsum("epai,ab,epbj,ep->eij", self.B, C, self.B, self.weights)
        K = np.zeros((self.n, self.n))
        for dofs, k in zip(self.dofs, each, strict=True):
            K[np.ix_(dofs, dofs)] += k
        return K


@pytest.mark.parametrize("averaged", [False, True])
@pytest.mark.parametrize("element", ELEMENTS.values(), ids=ELEMENTS)
def test_rigid_motions_strain_nothing(element, averaged):
    block = Block(element, averaged)
    motions = rigid_motions(block.X, "plane_strain")
    assert motions.shape == (block.n, 6)
    assert np.linalg.matrix_rank(motions) == 6
    for motion in motions.T:
        assert np.abs(motion).max() <= 1.0
        assert np.abs(block.strain(motion)).max() < 1e-14


@pytest.mark.parametrize("averaged", [False, True])
@pytest.mark.parametrize("element", ELEMENTS.values(), ids=ELEMENTS)
def test_a_linear_displacement_has_its_strain_everywhere(element, averaged):
    block = Block(element, averaged)
    F = 1e-3 * np.random.default_rng(2).standard_normal((3, 3))
    tensor = to_tensor(block.strain((F @ block.X).T.ravel()))
    expected = [(F[a, b] + F[b, a]) / 2 for a, b in AXES]
    assert tensor == pytest.approx(np.repeat(np.array(expected)[:, None], tensor.shape[1], 1))


@pytest.mark.parametrize("element", ELEMENTS.values(), ids=ELEMENTS)
def test_the_elastic_stiffness_has_six_zero_eigenvalues(element):
    values = np.linalg.eigvalsh(Block(element).stiffness())
    assert np.abs(values[:6]).max() < 1e-12 * values[-1]
    assert values[6] > 1e-5 * values[-1]


def test_mean_dilatation_has_one_change_of_volume_in_an_element():
    block = Block(ELEMENTS["linear"], averaged=True)
    u = np.random.default_rng(3).standard_normal(block.n)
    trace = block.strain(u)[:3].sum(axis=0).reshape(block.weights.shape)
    assert np.ptp(trace, axis=1) == pytest.approx(0.0, abs=1e-12)
    plain = Block(ELEMENTS["linear"])
    before = plain.strain(u)[:3].sum(axis=0).reshape(block.weights.shape)
    assert np.ptp(before, axis=1).max() > 0.1
    assert (trace * block.weights).sum() == pytest.approx((before * block.weights).sum())


def test_tensor_kernels_agree_with_three_by_three_matrices():
    matrix = np.random.default_rng(6).standard_normal((3, 3))
    matrix = matrix + matrix.T
    mandel = np.array([matrix[a, b] * (1.0 if a == b else SQRT2) for a, b in AXES])
    s = matrix - np.trace(matrix) / 3 * np.eye(3)
    assert to_tensor(mandel) == pytest.approx([matrix[a, b] for a, b in AXES])
    assert to_tensor(deviator(mandel)) == pytest.approx([s[a, b] for a, b in AXES])
    assert von_mises(mandel) == pytest.approx(np.sqrt(1.5 * (s * s).sum()))
