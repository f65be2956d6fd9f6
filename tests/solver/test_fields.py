"""From points to nodes, lines and grids."""

from __future__ import annotations

import numpy as np
import pytest

from solver import Body, Material
from solver.fem.discretisation import Discretisation
from solver.fem.error import ErrorPoints, error_estimate
from solver.fem.fields import Sampler, recovery
from solver.mesh import graded, grid, mapped
from solver.mesh.elements import known_elements
from solver.tensors import SQRT2, to_tensor, von_mises

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3)


def square(element="quad8", n=5, curved=False, **fields):
    cells = "tri" if element.startswith("tri") else "quad"
    mesh = grid(graded(2.0, 1.5 / n, 1.2, 1.0), np.linspace(-1.0, 0.0, n + 1), cells)
    if curved:
        mesh = mapped(mesh, lambda p: np.stack([p[0] + 0.1 * p[1] ** 2, p[1] + 0.05 * p[0] ** 2]))
    return Discretisation(Body(name="square", mesh=mesh, material=STEEL, element=element, **fields))


@pytest.mark.parametrize("element", known_elements(2))
def test_recovery_keeps_a_uniform_stress(element):
    part = square(element)
    assert recovery(part) @ np.ones(part.weights.size) == pytest.approx(np.ones(part.X.shape[1]))


@pytest.mark.parametrize("element", ["quad8", "quad9", "quad4", "tri6"])
def test_recovery_is_exact_for_a_linear_stress(element):
    """Three points or more determine a plane; the one point of tri3 does not."""
    part = square(element)

    def plane(x):
        return 3.0 - 2.0 * x[0] + 5.0 * x[1]

    nodal = recovery(part) @ plane(part.points.reshape(2, -1))
    assert nodal == pytest.approx(plane(part.X), abs=1e-10)


@pytest.mark.parametrize("element", ["quad8", "quad9", "tri6"])
def test_samples_of_a_quadratic_field_are_exact(element):
    part = square(element)
    rng = np.random.default_rng(1)
    x = np.stack([rng.uniform(0.0, 2.0, 200), rng.uniform(-1.0, 0.0, 200)])

    def field(p):
        return np.stack([p[0] ** 2 - p[0] * p[1], 1.0 + p[1] ** 2])

    sample = Sampler(part, x)
    assert sample.inside.all()
    assert sample(field(part.X)) == pytest.approx(field(x), abs=1e-10)


def test_samples_of_curved_elements_keep_the_field_of_positions():
    part = square(curved=True)
    nodes = part.X[:, ::3]
    assert Sampler(part, nodes)(part.X) == pytest.approx(nodes, abs=1e-9)


def test_points_outside_the_body_are_not_a_number():
    part = square()
    x = np.array([[1.0, 2.1, -1e-3, 1.0], [-0.5, -0.5, -0.5, 0.01]])
    sample = Sampler(part, x)
    assert sample.inside.tolist() == [True, False, False, False]
    assert np.isnan(sample(part.X)).tolist() == [[False, True, True, True]] * 2


def test_points_on_the_boundary_are_inside():
    part = square()
    x = np.array([[0.0, 2.0, 2.0, 0.7], [-1.0, 0.0, -1.0, 0.0]])
    assert Sampler(part, x).inside.all()


def test_a_single_field_may_have_any_leading_dimensions():
    part = square()
    sample = Sampler(part, np.array([[0.5, 1.5], [-0.5, -0.5]]))
    assert sample(part.X[0]) == pytest.approx([0.5, 1.5])
    assert sample(np.stack([[part.X[0]] * 3] * 2)).shape == (2, 3, 2)


def test_von_mises_of_known_states():
    uniaxial, hydrostatic = np.array([7.0, 0, 0, 0]), np.array([5.0, 5.0, 5.0, 0])
    shear = np.array([0, 0, 0, 4.0 * SQRT2])
    states = np.stack([uniaxial, hydrostatic, shear], axis=1)
    assert von_mises(states) == pytest.approx([7.0, 0.0, 4.0 * np.sqrt(3)])
    assert to_tensor(states)[3, 2] == pytest.approx(4.0)


def test_von_mises_does_not_change_the_stress_given():
    stress = np.arange(8.0).reshape(4, 2)
    before = stress.copy()
    von_mises(stress)
    to_tensor(stress)
    assert np.array_equal(stress, before)


def test_error_estimate_of_a_uniform_stress_is_zero_and_its_energy_exact():
    """2 W / volume = s:s (1 + nu) / E - nu (tr s)^2 / E; the volume is 2."""
    part = square()
    stress = np.tile(np.array([[100.0], [-50.0], [20.0], [30.0 * SQRT2]]), part.weights.size)
    error, energy = error_estimate(part, stress)
    density = (1.3 * (100.0**2 + 50.0**2 + 20.0**2 + 2 * 30.0**2) - 0.3 * 70.0**2) / 2e5
    assert energy == pytest.approx(2.0 * density, rel=1e-12)
    assert error < 1e-20 * energy


@pytest.mark.parametrize(("element", "degree"), [
    ("quad8", 2), ("quad9", 2), ("tri6", 2), ("quad4", 1), ("tri3", 1),
])  # fmt: skip
@pytest.mark.parametrize("deep", [1, 3])
def test_recovered_stress_is_exact_for_a_polynomial_of_the_degree_of_the_element(
    element, degree, deep
):
    """One row of elements tells nothing of the highest derivative across it: then of x alone."""
    kind = "tri" if element.startswith("tri") else "quad"
    mesh = grid(np.linspace(0.0, 2.0, 6), np.linspace(-1.0, 0.0, deep + 1), kind)
    part = Discretisation(Body(name="square", mesh=mesh, material=STEEL, element=element))
    across = 0.0 if deep == 1 else 1.0

    def field(x, y):
        return 3.0 + 2 * x - across * y + (degree - 1) * (x**2 - x * y + across * y**2)

    at = part.points
    if degree == 1:  # what the elements have is a constant, exact in their middle
        at = np.broadcast_to(at.mean(axis=2, keepdims=True), at.shape)
    found = ErrorPoints(part)
    values = found.recovered(np.stack([field(*at).ravel()] * 4))[1]
    assert values == pytest.approx(field(*found.x), abs=1e-6)


def test_error_estimate_falls_with_the_square_of_the_element():
    """Of a stress sin(pi x): its root falls as h², as the bilinear recovery does."""

    def share(n):
        mesh = grid(np.linspace(0.0, 2.0, 2 * n + 1), np.linspace(-1.0, 0.0, n + 1))
        part = Discretisation(Body(name="square", mesh=mesh, material=STEEL))
        stress = np.zeros((4, part.weights.size))
        stress[0] = np.sin(np.pi * part.points.reshape(2, -1)[0])
        error, energy = error_estimate(part, stress)
        return np.sqrt(error / energy)

    assert np.log2(share(10) / share(20)) > 1.7
