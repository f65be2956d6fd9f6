"""Plane stress of any law, and the projected return that is its special case."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.materials import Elasticity, Law, Material, PlaneStress, Response
from tests.solver.laws import HARDENING, Forwarded, StoredCentre, steel


def paths(seed, n_points=300, size=3e-3):
    """Strains of several steps: random ones, a reversal, a small one, one back to nothing."""
    rng = np.random.default_rng(seed)
    strain = np.zeros((4, n_points))
    for step in (size, size, "turn", 0.1 * size, size, "home", 3 * size):
        if step == "turn":
            strain = -strain
        elif step == "home":
            strain = np.zeros_like(strain)
        else:
            strain = strain + step * rng.standard_normal(strain.shape)
        yield strain


def difference(one, other):
    """Largest difference over the largest value."""
    return float(np.abs(one - other).max() / np.abs(other).max())


@pytest.mark.parametrize("poisson_ratio", [0.0, 0.3, 0.49])
@pytest.mark.parametrize("hardening", HARDENING)
def test_the_projected_return_equals_the_wrapped_law(hardening, poisson_ratio):
    material = steel(hardening, poisson_ratio=poisson_ratio)
    fast, general = PlaneStress(material), PlaneStress(Forwarded(material))
    assert difference(fast.stiffness(4), general.stiffness(4)) < 1e-14
    for seed in (1, 2):
        states = fast.initial(300, 4), general.initial(300, 4)
        flowed = 0
        for strain in paths(seed):
            one, other = fast.respond(strain, states[0]), general.respond(strain, states[1])
            flowed += int(one.yielding.sum())
            assert np.array_equal(one.yielding, other.yielding)
            assert difference(one.stress, other.stress) < 1e-10
            assert difference(one.tangent, other.tangent) < 1e-10
            assert difference(one.state.plastic_strain, other.state.plastic_strain) < 1e-10
            assert difference(one.state.accumulated, other.state.accumulated) < 1e-10
            states = one.state, other.state
        assert flowed > 1000


@pytest.mark.parametrize(
    "law", [PlaneStress(steel("mixed")), PlaneStress(Forwarded(steel("mixed")))]
)
def test_no_stress_and_no_stiffness_across_and_the_strain_across_is_not_read(law):
    state = law.initial(300, 4)
    for strain in paths(3):
        found = law.respond(strain, state)
        other = strain.copy()
        other[2] = 0.01
        assert not found.stress[2].any()
        assert not found.tangent[2].any()
        assert not found.tangent[:, 2].any()
        assert np.array_equal(law.respond(other, state).stress, found.stress)
        state = found.state


def test_a_law_with_its_own_state_is_wrapped():
    """Prager's back stress, stored as an internal variable, is the package's."""
    own, ours = PlaneStress(StoredCentre(steel("kinematic"))), PlaneStress(steel("kinematic"))
    states = own.initial(300, 4), ours.initial(300, 4)
    for strain in paths(4):
        one, other = own.respond(strain, states[0]), ours.respond(strain, states[1])
        assert difference(one.stress, other.stress) < 1e-10
        assert difference(one.tangent, other.tangent) < 1e-10
        assert difference(own.back_stress(one.state), ours.back_stress(other.state)) < 1e-9
        states = one.state, other.state


def test_youngs_modulus_resists_tension():
    C = PlaneStress(steel()).stiffness(4)
    assert C @ [1e-3, -0.3e-3, 0.0, 0.0] == pytest.approx([200.0, 0.0, 0.0, 0.0], abs=1e-10)


class Odd(Law):
    """A law whose stress zz is any function of strain zz alone; nothing else counts."""

    hardens = True
    elasticity = Elasticity(youngs_modulus=2e5, poisson_ratio=0.3)

    def __init__(self, stress, slope):
        self._stress, self._slope = stress, slope

    def flow_stress(self, state):
        return np.full(state.accumulated.shape, 350.0)

    def respond(self, strain, state):
        stress = np.zeros_like(strain)
        stress[2] = self._stress(strain[2])
        tangent = np.repeat(np.eye(len(strain))[:, :, None], strain.shape[1], axis=2)
        tangent[2, 2] = self._slope(strain[2])
        return Response(stress, tangent, state, np.ones(strain.shape[1], dtype=bool))


def test_the_bracket_holds_where_newton_alone_runs_away():
    law = Odd(
        lambda e: 500 * np.arctan(1e4 * (e - 0.02)), lambda e: 5e6 / (1 + (1e4 * (e - 0.02)) ** 2)
    )
    strain = np.array([[0.0, 0.1], [0.0, 0.1], [0.0, 0.0], [0.0, 0.0]])
    found = PlaneStress(law).respond(strain, law.initial(2, 4))
    assert np.isfinite(found.stress).all()
    assert not found.stress[2].any()


def test_stress_is_nan_where_no_thickness_strain_is_found():
    law = Odd(np.ones_like, np.zeros_like)
    found = PlaneStress(law).respond(np.full((4, 2), 1e-3), law.initial(2, 4))
    assert np.isnan(found.stress).all()


def test_the_wrapper_is_a_law_like_the_one_it_wraps():
    material: Material = steel("mixed")
    wrapped = PlaneStress(material)
    assert wrapped.yield_stress == material.yield_stress
    assert wrapped.shear_yield_stress == material.shear_yield_stress
    assert wrapped.hardens
    assert not wrapped.elastic
    assert PlaneStress(replace(material, yield_stress=np.inf)).elastic
