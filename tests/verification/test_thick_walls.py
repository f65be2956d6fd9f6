"""Elastic-plastic spheres and cylinders under internal pressure, loaded and released."""

from __future__ import annotations

import numpy as np
import pytest

from solver.materials import Elasticity, TrescaMaterial, Voce
from tests.verification.bodies import polar_stress
from tests.verification.thick_walls import CYLINDER, SPHERE, YIELD, errors, press


@pytest.fixture(scope="module")
def spheres():
    return {n: press("axisymmetric", SPHERE.pressure, 0.3, n, n) for n in (32, 64)}


def test_sphere_matches_hill_loaded_and_released(spheres):
    """Within 0.2 % of the yield stress at every point of 64 x 64 elements.

    The largest error sits in the one layer of elements at the axis, where the reduced quad8 is
    of first order (measured: 0.37 % at 32, 0.19 % at 64, elastic or plastic).
    """
    error = errors(spheres[64], SPHERE)
    assert error["loaded"] < 2e-3
    assert error["unloaded"] < 2e-3


def test_sphere_converges_at_second_order_away_from_the_axis(spheres):
    def off_axis(n):
        stress = spheres[n].system.state("ring", spheres[n].loaded).stress
        r, radial, hoop = polar_stress(spheres[n].system, "ring", stress)
        x, y = spheres[n].system.full("ring").points.reshape(2, -1)
        kept = x > 0.1 * y
        difference = np.stack([radial, hoop, stress[2]]) - np.stack(
            [SPHERE.loaded(r)[k] for k in (0, 1, 1)]
        )
        return np.abs(difference[:, kept]).max() / YIELD

    coarse, fine = off_axis(32), off_axis(64)
    assert fine < 5e-4
    assert np.log2(coarse / fine) > 1.8


def test_sphere_of_quad9_matches_hill_without_a_weak_axis():
    error = errors(press("axisymmetric", SPHERE.pressure, 0.3, 32, 32, element="quad9"), SPHERE)
    assert error["loaded"] < 2e-3
    assert error["unloaded"] < 2e-3


@pytest.mark.parametrize("poisson_ratio", [0.0, 0.45])
def test_sphere_does_not_depend_on_poissons_ratio(poisson_ratio):
    error = errors(press("axisymmetric", SPHERE.pressure, poisson_ratio, 32, 32), SPHERE)
    assert error["loaded"] < 5e-3  # the layer at the axis, at twice the element size


def test_nearly_incompressible_cylinder_matches_hill():
    """Within 0.3 % of the yield stress everywhere.

    Measured: 0.001 % where an element edge lies on the plastic front (10 elements), 0.05 % where
    the front crosses elements (12). The reduced quad8 does not lock.
    """
    for n in (10, 12):
        error = errors(press("plane_strain", CYLINDER.pressure, 0.4999, n, n), CYLINDER)
        assert error["loaded"] < {10: 5e-5, 12: 1e-3}[n]
        assert error["unloaded"] < {10: 1e-4, 12: 1e-3}[n]


def test_compressible_cylinder_differs_from_hill_by_its_physics():
    """At Poisson 0.3 the axial stress is not the mean of the others: 0.7 % of the yield stress.

    The difference stays under refinement (0.62 % at 10, 0.68 % at 20, 0.72 % at 40 elements,
    sampled ever nearer to the front) and with smaller increments: Hill's solution is exact only
    in the incompressible limit.
    """
    steps = {1: None, 10: None}
    for n in steps:
        body = press("plane_strain", CYLINDER.pressure, 0.3, 20, 10, steps=n)
        steps[n] = errors(body, CYLINDER)["loaded"]
    assert 5e-3 < steps[10] < 9e-3
    assert steps[1] == pytest.approx(steps[10], rel=0.02)


def test_one_increment_gives_the_sphere_that_ten_give():
    """Flow keeps its direction in a sphere, so the return to the yield surface is exact."""
    one, ten = (
        press("axisymmetric", SPHERE.pressure, 0.3, 12, 12, steps=n).unloaded.responses[0].stress
        for n in (1, 10)
    )
    # the direction is only kept up to the discretisation error of 1 %
    assert np.abs(one - ten).max() < 5e-4 * YIELD


@pytest.mark.parametrize("poisson_ratio", [0.3, 0.45])
def test_tresca_cylinder_matches_its_closed_form_at_any_poissons_ratio(poisson_ratio):
    """Within 0.1 % of the yield stress everywhere.

    Radial and hoop stress differ by Re in the plastic zone, where von Mises' incompressible
    cylinder has 2 / sqrt(3) of its own. The axial stress lies between: no flow along the axis.
    """
    material = TrescaMaterial(
        elasticity=Elasticity(youngs_modulus=2e5, poisson_ratio=poisson_ratio),
        curve=Voce(yield_stress=2 / np.sqrt(3) * YIELD),
    )
    for n in (10, 20):
        body = press("plane_strain", CYLINDER.pressure, poisson_ratio, n, n, material=material)
        error = errors(body, CYLINDER)
        assert error["loaded"] < 1e-3
        assert error["unloaded"] < 1e-3
        flow = body.system.state("ring", body.loaded).plastic.plastic_strain
        assert np.abs(flow[2]).max() < 1e-12 < np.abs(flow[:2]).max()
