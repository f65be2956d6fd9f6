"""Bodies of large strain: derivatives, objectivity, equal stretches, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import sparse

from solver import (
    Body,
    ContactPair,
    Displacement,
    Link,
    Material,
    Model,
    ModelError,
    Moved,
    Pressure,
    RigidBody,
)
from solver.fem.kernels import NEAR, strains
from solver.fem.large import LargeDiscretisation
from solver.mesh import grid, marked
from solver.model.loads import Removal

E = 2e5
LAWS = {
    "elastic": Material(youngs_modulus=E, poisson_ratio=0.3),
    "perfect": Material(youngs_modulus=E, poisson_ratio=0.3, yield_stress=300.0),
    "kinematic": Material(youngs_modulus=E, poisson_ratio=0.3, yield_stress=300.0,
                          hardening="kinematic", hardening_ratio=0.05),
}  # fmt: skip


def body(element: str, kinematics: Any, law: str = "perfect", **fields: Any) -> Body:
    cells = "tri" if element.startswith("tri") else "quad"
    mesh = grid(np.linspace(1.0, 2.0, 3), np.linspace(0.0, 1.5, 3), cells)
    mesh = marked(mesh, "right", x=(1.5, 2.0))
    return Body(**{"name": "b", "mesh": mesh, "material": LAWS[law], "kinematics": kinematics,
                   "element": element, "strain": "large", **fields})  # fmt: skip


def bent(part: LargeDiscretisation, size: float, seed: int = 3) -> np.ndarray:
    """Return displacements with strain of about ``size`` that bend and shear."""
    rng = np.random.default_rng(seed)
    x, y = part.X
    smooth = np.array([size * x * y + size / 2 * y, -size * x**2 / 2 + size / 2 * y])
    return (smooth + size / 30 * rng.normal(size=smooth.shape)).T.ravel()


def four(function: Any, step: float) -> Any:
    """Return the derivative at zero by differences of fourth order."""
    one, two = function(step) - function(-step), function(2 * step) - function(-2 * step)
    return (8 * one - two) / (12 * step)


@pytest.mark.parametrize("region", ["", "right"])
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress", "axisymmetric"])
@pytest.mark.parametrize("element", ["quad8", "quad4", "quad9", "tri6", "tri3"])
def test_the_tangent_is_the_symmetric_derivative_of_the_forces(
    element: str, kinematics: Any, law: str, region: str
) -> None:
    """The differences, not the tangent, limit the agreement."""
    part = LargeDiscretisation(body(element, kinematics, law, large_region=region))
    u, state = bent(part, 0.2), part.virgin()
    state = part.respond(0.8 * u, state, 1.0).law.state
    response = part.respond(u, state, 1.0)
    step = bent(part, 0.1, seed=5)

    def force(share: float) -> np.ndarray:
        found = part.respond(u + share * step, state, 1.0)
        return found.deformation.internal_force(found.law.stress)

    D = response.law.tangent.reshape(4, 4, *part.weights.shape).transpose(2, 3, 0, 1)
    K = response.deformation.stiffness(slice(None), D, response.law.stress)
    assert np.abs(K - K.swapaxes(1, 2)).max() < 1e-13 * np.abs(K).max()
    product = np.einsum("eij,ej->ei", K, step[part.dofs])
    product = np.bincount(part.dofs.ravel(), product.ravel(), part.n)
    assert np.allclose(product, four(force, 1e-4), atol=2e-8 * np.abs(product).max())
    energy = part.stiffness_along(step, response)[0]
    assert energy == pytest.approx(float(step @ product), rel=1e-12)


@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress"])
@pytest.mark.parametrize("element", ["quad8", "quad4"])
def test_a_rotation_turns_the_forces_and_the_stress(element: str, kinematics: Any) -> None:
    part = LargeDiscretisation(body(element, kinematics))
    u, angle = bent(part, 0.2), 1.0
    Q = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    x = part.X + u.reshape(-1, 2).T
    turned = (Q @ x + [[3.0], [-7.0]] - part.X).T.ravel()
    before, after = (part.respond(each, part.virgin(), 1.0) for each in (u, turned))
    assert np.allclose(after.law.stress, before.law.stress, atol=1e-10)
    force, other = (each.deformation.internal_force(each.law.stress) for each in (before, after))
    assert np.allclose(other.reshape(-1, 2), force.reshape(-1, 2) @ Q.T, atol=1e-11 * E)
    own = np.zeros(part.weights.size)
    one, two = (r.deformation.cauchy(r.law.stress, own) for r in (before, after))
    full = [np.array([[s[0], s[3] / 2**0.5], [s[3] / 2**0.5, s[1]]]) for s in (one, two)]
    assert np.allclose(full[1], np.einsum("ik,klp,jl->ijp", Q, full[0], Q), atol=1e-9)


def at_point(H: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return strain and derivative (4, 5) by H: unknowns of an element whose first node rests."""
    g, E, B = np.zeros((1, 1, 5, 7)), np.empty((4, 1, 1)), np.empty((1, 1, 4, 7))
    g[0, 0, :, 2:] = np.eye(5)
    strains(g, np.append([0.0, 0.0], H)[None], np.ones((1, 1)), False, E, B)
    return E[:, 0, 0], B[0, 0, :, 2:]


def test_a_flat_element_has_no_strain() -> None:
    for each in at_point(np.array([-1.0, 0.0, 0.0, 0.0, 0.0])):
        assert np.isnan(each).all()


@pytest.mark.parametrize("apart", [0.0, 1e-12, 1e-6, 1e-2, 0.99, 1.01, 10.0])
def test_strain_is_exact_for_equal_and_nearly_equal_stretches(apart: float) -> None:
    """``apart`` is the ratio q over that at which the power series ends."""
    r = np.sqrt(apart * NEAR)
    C = 1.3 * np.array([[1 + 0.6 * r, 0.8 * r], [0.8 * r, 1 - 0.6 * r]])
    w, v = np.linalg.eigh(C)
    U = (v * np.sqrt(w)) @ v.T
    H = np.array([U[0, 0] - 1, U[0, 1], U[1, 0], U[1, 1] - 1, 0.0])
    along = np.array([0.3, 1.0, -0.4, 0.5, 0.2])

    def strain(share: float) -> tuple[np.ndarray, np.ndarray]:
        return at_point(H + share * along)

    (found, slopes), exact = strain(0.0), (v * np.log(w) / 2) @ v.T
    expected = [exact[0, 0], exact[1, 1], 0.0, 2**0.5 * exact[0, 1]]
    assert np.allclose(found, expected, atol=4e-16)

    assert np.allclose(slopes @ along, four(lambda share: strain(share)[0], 1e-3), atol=1e-11)


def test_an_inverted_element_has_no_stress() -> None:
    part = LargeDiscretisation(body("quad8", "plane_strain"))
    u = np.zeros(part.n)
    u[0::2] = -2 * part.X[0]  # mirrored: C is that of the undeformed body
    response = part.respond(u, part.virgin(), 1.0)
    assert np.isnan(response.law.stress).all()
    assert np.isnan(part.residual(1.0, u, response)).all()


@pytest.mark.parametrize("kinematics", ["plane_strain", "axisymmetric"])
def test_a_pressure_follows_the_boundary_with_its_stiffness(kinematics: Any) -> None:
    """All around the body its resultant is zero, and its stiffness symmetric."""
    pushed = tuple(Pressure(boundary=b, value=50.0) for b in ("top", "right", "bottom", "left"))
    part = LargeDiscretisation(body("quad8", kinematics, "elastic", loads=pushed))
    u, step = bent(part, 0.2), bent(part, 0.1, seed=5)
    step[np.setdiff1d(np.arange(part.n), part.active)] = 0.0  # pins
    assert np.abs(part.external(1.0, u)).max() > 20.0
    assert abs(part.external(1.0, u)[1::2].sum()) < 1e-9
    with_load, without = (part.tangent_data(part.respond(u, part.virgin(), t)) for t in (1.0, 0.0))
    K = part.pattern.copy()
    K.data = with_load - without
    whole = K + K.T - sparse.diags_array(K.diagonal())
    change = four(lambda share: part.external(1.0, u + share * step), 1e-3)[part.active]
    assert np.allclose(whole @ step[part.active], -change, atol=1e-6 * np.abs(change).max())


def test_what_large_strain_has_not_is_refused_by_name() -> None:
    mesh = grid(np.linspace(1.0, 2.0, 3), np.linspace(0.0, 1.0, 3)).with_subdomains({"r": [0]})
    with pytest.raises(ModelError, match="removal"):
        body("quad4", "plane_strain", mesh=mesh, loads=(Removal(region="r"),))
    one = body("quad4", "plane_strain", supports={"bottom": "xy"})
    other = Body(name="c", mesh=one.mesh, material=one.material, supports={"bottom": "xy"})
    pair = ContactPair(slave=("b", "right"), master=("c", "left"), sliding="small")
    with pytest.raises(ModelError, match=r"contacts\[0\].sliding"):
        Model(bodies=(one, other), contacts=(pair,))
    turning = RigidBody(name="plate", rotation=Moved(value=0.1))
    link = Link(slave=("b", "top"), rigid="plate", components="normal")
    with pytest.raises(ModelError, match=r"links\[0\]"):
        Model(bodies=(one,), rigid=(turning,), links=(link,))
    assert Displacement(boundary="top", y=1.0).follows is False
