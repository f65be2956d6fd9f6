"""Material laws: tangents, invariants, uniaxial curves."""

from __future__ import annotations

import numpy as np
import pytest

from solver.materials import PlasticState, respond
from solver.materials.material import Material
from solver.materials.von_mises import radial_return, yield_function

HARDENING = ["none", "isotropic", "kinematic", "mixed"]
KINEMATICS = ["plane_strain", "plane_stress"]


def steel(hardening: str, ratio: float = 0.024) -> Material:
    return Material(
        youngs_modulus=2e5,
        poisson_ratio=0.3,
        yield_stress=350.0,
        hardening=hardening,
        hardening_ratio=ratio,
    )


def random_history(kinematics, material, n_points=200, n_components=4, seed=1):
    """A state after two random plastic steps, and a strain that yields it further."""
    rng = np.random.default_rng(seed)
    state = PlasticState.virgin(n_points, n_components)
    strain = np.zeros((n_components, n_points))
    for _ in range(2):
        strain = strain + 3e-3 * rng.standard_normal(strain.shape)
        state = respond(strain, state, material, kinematics).state
    return strain + 2e-3 * rng.standard_normal(strain.shape), state


@pytest.mark.parametrize("hardening", HARDENING)
@pytest.mark.parametrize("kinematics", KINEMATICS)
def test_tangent_matches_central_difference(kinematics, hardening):
    material = steel(hardening)
    strain, state = random_history(kinematics, material)
    response = respond(strain, state, material, kinematics)
    assert response.yielding.sum() > 50
    h = 1e-8
    difference = np.empty_like(response.tangent)
    for j in range(4):
        step = np.zeros((4, 1))
        step[j] = h
        up = respond(strain + step, state, material, kinematics).stress
        down = respond(strain - step, state, material, kinematics).stress
        difference[:, j] = (up - down) / (2 * h)
    error = np.abs(difference - response.tangent).max(axis=(0, 1))
    # truncation h^2 and rounding eps * stress / h leave about 1e-5 of E
    assert np.quantile(error, 0.99) < 1e-5 * material.youngs_modulus


@pytest.mark.parametrize("hardening", HARDENING)
def test_tangent_matches_central_difference_in_three_dimensions(hardening):
    material = steel(hardening)
    strain, state = random_history("plane_strain", material, n_components=6)
    response = radial_return(strain, state, material)
    h = 1e-8
    for j in range(6):
        step = np.zeros((6, 1))
        step[j] = h
        up = radial_return(strain + step, state, material).stress
        down = radial_return(strain - step, state, material).stress
        error = np.abs((up - down) / (2 * h) - response.tangent[:, j]).max(axis=0)
        assert np.quantile(error, 0.99) < 1e-5 * material.youngs_modulus


@pytest.mark.parametrize("hardening", HARDENING)
@pytest.mark.parametrize("kinematics", KINEMATICS)
def test_stress_is_on_or_inside_the_yield_surface(kinematics, hardening):
    material = steel(hardening)
    strain, state = random_history(kinematics, material)
    response = respond(strain, state, material, kinematics)
    f = yield_function(response.stress, response.state, material)
    assert f.max() < 1e-9 * material.yield_stress
    assert np.abs(f[response.yielding]).max() < 1e-9 * material.yield_stress


@pytest.mark.parametrize("hardening", HARDENING)
@pytest.mark.parametrize("kinematics", KINEMATICS)
def test_state_given_is_never_changed(kinematics, hardening):
    material = steel(hardening)
    strain, state = random_history(kinematics, material)
    before = (strain.copy(), state.plastic_strain.copy(), state.accumulated.copy())
    response = respond(strain, state, material, kinematics)
    assert response.yielding.any()
    assert np.array_equal(before[0], strain)
    assert np.array_equal(before[1], state.plastic_strain)
    assert np.array_equal(before[2], state.accumulated)


@pytest.mark.parametrize("kinematics", KINEMATICS)
def test_plastic_flow_is_isochoric_and_dissipates(kinematics):
    material = steel("mixed")
    strain, state = random_history(kinematics, material)
    response = respond(strain, state, material, kinematics)
    flow = response.state.plastic_strain - state.plastic_strain
    assert np.abs(flow[:3].sum(axis=0)).max() < 1e-15
    back = 2 / 3 * material.kinematic_modulus * response.state.plastic_strain
    dissipation = ((response.stress - back) * flow).sum(axis=0)
    assert dissipation.min() >= -1e-12
    assert dissipation.max() > 0


@pytest.mark.parametrize("hardening", HARDENING)
def test_uniaxial_tension_follows_the_bilinear_curve(hardening):
    material = steel(hardening)
    E, Eu = material.youngs_modulus, 0.024 * material.youngs_modulus
    strain, state = np.zeros((4, 1)), PlasticState.virgin(1)
    for axial in np.linspace(0, 0.01, 11):
        strain[0] = axial
        for _ in range(30):  # free lateral contraction by Newton on yy
            response = respond(strain, state, material, "plane_stress")
            strain[1] -= response.stress[1] / response.tangent[1, 1]
        state = response.state
    onset = material.yield_stress / E
    slope = 0.0 if hardening == "none" else Eu
    assert response.stress[0, 0] == pytest.approx(350 + slope * (0.01 - onset), rel=1e-9)


def test_reverse_yield_shows_the_bauschinger_effect_only_with_kinematic_hardening():
    reverse = {}
    for hardening in ("isotropic", "kinematic"):
        material = steel(hardening)
        pure_shear = np.zeros((4, 1))
        pure_shear[3] = 0.02
        forward = respond(pure_shear, PlasticState.virgin(1), material, "plane_strain")
        sweep = np.zeros((4, 2001))
        sweep[3] = 0.02 - np.linspace(0, 0.02, 2001)
        state = PlasticState(
            np.repeat(forward.state.plastic_strain, 2001, axis=1),
            np.repeat(forward.state.accumulated, 2001),
        )
        first = np.argmax(respond(sweep, state, material, "plane_strain").yielding[1:]) + 1
        elastic_range = 2 * material.shear_modulus * (0.02 - sweep[3, first])
        reverse[hardening] = elastic_range / (np.sqrt(2 / 3) * material.yield_stress)
    assert reverse["kinematic"] == pytest.approx(2.0, rel=1e-2)
    assert reverse["isotropic"] > 2.2
