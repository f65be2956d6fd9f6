"""Another measure of strain takes the place of small strain: `Deformation.at`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest

from solver import Body, Material, Model, PathControl, System, Walker
from solver.fem.deformation import Deformation
from solver.fem.discretisation import Discretisation
from solver.fem.nodes import vectors
from solver.mesh import grid
from solver.model.loads import Displacement
from solver.tensors import SQRT2, to_tensor

ELASTIC = Material(youngs_modulus=2e5, poisson_ratio=0.3)
STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=300.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class Curved(Deformation):
    measure: Any
    linear: ClassVar[bool] = False

    def at(self, u):
        return self.measure.at(u)

    def stiffness(self, elements, tangent, stress=None):
        added = 0.0 if stress is None else self.measure.geometric(stress, elements)
        return super().stiffness(elements, tangent) + added

    def geometric_energy(self, step, stress):
        each = step[self.dofs]
        return np.einsum("ei,eij,ej", each, self.measure.geometric(stress, slice(None)), each)


class GreenLagrange:
    """E = (F'F - 1) / 2 in plane strain, with stress and volume before loading."""

    def __init__(self, part):
        self.part = part
        self.slopes = np.array([b[0].grad for b in part.basis.basis])  # (nodes, 2, elements, ...)

    def at(self, u):
        part, G = self.part, self.slopes
        moved = vectors(u, 2)[:, part.basis.element_dofs]
        F = np.eye(2)[:, :, None, None] + np.einsum("iae,ajep->ijep", moved, G)
        (xx, xy), (_, yy) = np.einsum("kiep,kjep->ijep", F, F) - np.eye(2)[:, :, None, None]
        strain = np.array([xx, yy, 0 * xx, SQRT2 * xy]).reshape(4, -1) / 2
        rows = [
            np.einsum("iep,aep->epai", F[:, 0], G[:, 0]),
            np.einsum("iep,aep->epai", F[:, 1], G[:, 1]),
            np.zeros((*F.shape[2:], len(G), 2)),
            (np.einsum("iep,aep->epai", F[:, 0], G[:, 1])
             + np.einsum("iep,aep->epai", F[:, 1], G[:, 0])) / SQRT2,
        ]  # fmt: skip
        B = np.stack(rows, axis=2).reshape(*F.shape[2:], 4, -1)
        return Curved(
            n=part.n, dofs=part.dofs, strain=strain, B=B, weights=part.weights,
            measure=self,
        )  # fmt: skip

    def geometric(self, stress, elements):
        xx, yy, _, xy = to_tensor(stress).reshape(4, *self.part.weights.shape)[:, elements]
        S, G = np.array([[xx, xy], [xy, yy]]), self.slopes[:, :, elements]
        each = np.einsum("aiep,ijep,bjep,ep->eab", G, S, G, self.part.weights[elements])
        whole = np.einsum("eab,ij->eaibj", each, np.eye(2))
        return whole.reshape(len(each), 2 * len(G), -1)


def bar(element="quad8", law=ELASTIC, **fields):
    mesh = grid(np.linspace(0.0, 2.0, 3), np.arange(2.0))
    return Body(name="bar", mesh=mesh, material=law, element=element, **fields)


@pytest.mark.parametrize("law", [ELASTIC, STEEL])
def test_tangent_of_a_nonlinear_strain_is_the_derivative_of_its_residual(law):
    part = Discretisation(bar(law=law, supports={"left": "xy"}))
    part.undeformed = GreenLagrange(part).at(np.zeros(part.n))
    random = np.random.default_rng(2)
    u, step = 0.05 * random.standard_normal(part.n), np.zeros(part.n)
    step[part.active] = random.standard_normal(len(part.active))
    response = part.respond(u, part.virgin(), 0.0)
    assert not response.linear.any()
    K = part.pattern.copy()
    K.data = part.tangent_data(response)
    K = (K + K.T).toarray() - np.diag(K.diagonal())
    h = 1e-7
    forces = [part.residual(0.0, at, part.respond(at, part.virgin(), 0.0))[part.active]
              for at in (u - h * step, u + h * step)]  # fmt: skip
    found, exact = K @ step[part.active], (forces[0] - forces[1]) / (2 * h)
    # truncation h^2 and rounding eps / h
    assert np.abs(found - exact).max() < 1e-7 * np.abs(exact).max()
    along, _ = part.stiffness_along(step, response)
    assert along == pytest.approx(step[part.active] @ found, rel=1e-12)


@pytest.mark.solves
def test_a_bar_of_nonlinear_strain_is_stretched_as_in_closed_form():
    """With its width held, S = M (stretch^2 - 1) / 2, and the force is stretch times S."""
    held = {"left": "xy", "right": "y", "bottom": "y", "top": "y"}
    pulled = Displacement(boundary="right", x=0.6)
    system = System(Model(bodies=(bar(supports=held, loads=(pulled,)),)))
    part = system.full("bar")
    part.undeformed = GreenLagrange(part).at(np.zeros(part.n))
    control = PathControl(load_step=0.5)
    (outcome,) = Walker(system, control).walk([control.program(1.0)])
    loaded = outcome.points["loaded"]
    M = ELASTIC.stiffness(4)[0, 0]
    stress = M * (1.3**2 - 1) / 2
    assert loaded.responses[0].stress[0] == pytest.approx(stress, rel=1e-10)
    right = vectors(loaded.forces[0], 2)[0, part.boundary_nodes("right")].sum()
    assert right == pytest.approx(1.3 * stress, rel=1e-10)
    assert np.abs(outcome.points["unloaded"].responses[0].stress).max() < 1e-6 * stress
