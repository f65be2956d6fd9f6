"""Material laws: what the contract asks of each, and closed forms of the package's own."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import cache

import numpy as np
import pytest

from solver.materials import Elasticity, Law, Layered, PlaneStress, PlasticState, Tresca, VonMises
from tests.solver.laws import HARDENING, LAWS, StoredCentre, steel

every_law = pytest.mark.parametrize(("law", "n_components"), LAWS.values(), ids=LAWS)


@cache
def random_history(law, n_components, n_points=150, seed=1):
    """A state after two random plastic steps, and a strain that yields it further.

    Once for all tests: no law changes what it is given, as one of them proves.
    """
    rng = np.random.default_rng(seed)
    state = law.initial(n_points, n_components)
    strain = np.zeros((n_components, n_points))
    for _ in range(2):
        strain = strain + 3e-3 * rng.standard_normal(strain.shape)
        state = law.respond(strain, state).state
    return strain + 2e-3 * rng.standard_normal(strain.shape), state


@cache
def answer(law, n_components):
    """The response to that strain."""
    return law.respond(*random_history(law, n_components))


def one_surface(law):
    """Whether a law has one yield surface, and not one for each layer."""
    return not isinstance(getattr(law, "law", law), Layered)


# -- the contract ------------------------------------------------------------------------------


@every_law
def test_tangent_matches_central_difference(law, n_components):
    strain, state = random_history(law, n_components)
    response = answer(law, n_components)
    assert response.yielding.sum() > 50
    h = 1e-8
    difference = np.empty_like(response.tangent)
    for j in range(n_components):
        step = np.zeros((n_components, 1))
        step[j] = h
        up = law.respond(strain + step, state).stress
        down = law.respond(strain - step, state).stress
        difference[:, j] = (up - down) / (2 * h)
    error = np.abs(difference - response.tangent).max(axis=(0, 1))
    # truncation h^2 and rounding eps * stress / h leave about 1e-5 of E
    assert np.quantile(error, 0.99) < 1e-5 * law.elasticity.youngs_modulus


@every_law
def test_seen_along_minus_x_a_law_responds_with_the_mirror_image(law, n_components):
    """Steady passes back over a track need it of all internal variables."""
    strain, state = random_history(law, n_components)
    turn = np.where(np.isin(np.arange(n_components), (3, 5)), -1.0, 1.0)[:, None]  # xy, zx
    here, there = answer(law, n_components), law.respond(turn * strain, state.mirrored)
    np.testing.assert_allclose(there.stress, turn * here.stress, atol=1e-6)
    np.testing.assert_allclose(there.state.mirrored.packed, here.state.packed, atol=1e-6)


@every_law
def test_internal_variables_come_out_of_one_array_as_they_went_in(law, n_components):
    _, state = random_history(law, n_components, n_points=5)
    other = law.initial(5, n_components).unpacked(state.packed)
    for name in (f.name for f in fields(state)):
        np.testing.assert_array_equal(getattr(other, name), getattr(state, name))
    square = state.packed[:, :4].reshape(-1, 2, 2)
    assert state.unpacked(square).accumulated.shape == (2, 2)
    np.testing.assert_array_equal(state.unpacked(square).packed, square)
    np.testing.assert_array_equal(state.packed[:n_components], state.plastic_strain)


@every_law
def test_a_tangent_is_symmetric_where_the_law_says_so(law, n_components):
    tangent = answer(law, n_components).tangent
    off = np.abs(tangent - tangent.swapaxes(0, 1)).max() / law.elasticity.youngs_modulus
    assert (off < 1e-12) == law.symmetric


@every_law
def test_tangent_is_the_elastic_stiffness_where_nothing_yields(law, n_components):
    response = answer(law, n_components)
    assert not response.yielding.all()
    off = response.tangent[:, :, ~response.yielding] - law.stiffness(n_components)[:, :, None]
    assert np.abs(off).max() < 1e-9


@every_law
def test_stress_is_on_or_inside_the_yield_surface(law, n_components):
    response = answer(law, n_components)
    f = law.yield_value(response.stress, response.state)
    assert f.max() < 1e-9 * law.yield_stress
    assert np.abs(f[response.yielding]).max() < 1e-9 * law.yield_stress
    assert f[~response.yielding].min() < -0.1 * law.yield_stress


@every_law
def test_state_given_is_never_changed(law, n_components):
    strain, state = random_history(law, n_components)
    given = {f.name: getattr(state, f.name).copy() for f in fields(state)}
    strain_given = strain.copy()
    response = law.respond(strain, state)
    assert response.yielding.any()
    assert type(response.state) is type(state)
    assert np.array_equal(strain_given, strain)
    for name, values in given.items():
        assert np.array_equal(values, getattr(state, name))


@every_law
def test_points_answer_one_by_one_as_together(law, n_components):
    strain, state = random_history(law, n_components, n_points=5)
    together = law.respond(strain, state)
    assert together.yielding.any()
    for k in range(5):
        alone = law.respond(strain[:, [k]], state.at(np.array([k])))
        assert alone.stress == pytest.approx(together.stress[:, [k]], rel=1e-12, abs=1e-9)
        assert alone.state.accumulated == pytest.approx(together.state.accumulated[k], rel=1e-12)
    nothing = law.respond(strain[:, :0], state.at(np.zeros(0, dtype=int)))
    assert nothing.tangent.shape == (n_components, n_components, 0)


@every_law
def test_plastic_flow_is_isochoric_and_dissipates(law, n_components):
    _, state = random_history(law, n_components)
    response = answer(law, n_components)
    flow = response.state.plastic_strain - state.plastic_strain
    assert np.abs(flow[:3].sum(axis=0)).max() < 1e-15
    dissipation = law.dissipation(state, response)
    assert dissipation.min() >= -1e-12
    dp = response.state.accumulated - state.accumulated
    if one_surface(law) and law.symmetric:  # stress less back stress does flow stress times dp
        assert dissipation == pytest.approx(law.flow_stress(response.state) * dp, rel=1e-9)
    else:
        assert dissipation[response.yielding].min() > 0


@every_law
def test_an_answer_fits_the_stated_law(law, n_components):
    strain, state = random_history(law, n_components)
    stress, _, after, yielding = answer(law, n_components)
    assert law.misfit(strain, stress, state, after).max() < 1e-8
    wrong = {
        "stress": law.misfit(strain, 1.001 * stress, state, after),
        "strain": law.misfit(1.001 * strain, stress, state, after),
        "too much flow": law.misfit(
            strain, stress, state, replace(after, accumulated=1.01 * after.accumulated)
        ),
        "flow taken back": law.misfit(
            strain, stress, replace(state, accumulated=after.accumulated + 1e-6), after
        ),
        "no flow": law.misfit(strain, stress, state, replace(after, accumulated=state.accumulated)),
        "flow aside": law.misfit(
            strain, stress, state, replace(after, plastic_strain=1.01 * after.plastic_strain)
        ),
    }
    assert min(found[yielding].min() for found in wrong.values()) > 1e-3
    spoilt = stress.copy()
    spoilt[0, 3] = np.nan
    assert np.isnan(law.misfit(strain, spoilt, state, after)[3])


def test_rounding_at_huge_strain_is_no_misfit_and_a_wrong_flow_is():
    law = steel("kinematic", ratio=1e-6, yield_stress=300.0)
    strain = np.array([[180.0], [-450.0], [270.0], [15.0]]) * np.linspace(0.5, 1.0, 50)
    before = law.initial(50, 4)
    stress, _, after, _ = law.respond(strain, before)
    direct = np.abs(
        after.plastic_strain
        - after.accumulated * law.surface.normal(stress - law.back_stress(after))
    ).max()
    G = law.elasticity.shear_modulus
    assert 2 * G * direct > 1e-4  # MPa: the rounding of stress turns the flow
    assert law.misfit(strain, stress, before, after).max() < 1e-6 * law.yield_stress
    wrong = replace(after, plastic_strain=(1 + 1e-9) * after.plastic_strain)
    assert law.misfit(strain, stress, before, wrong).min() > 1e-6 * law.yield_stress


@every_law
def test_strength_begins_at_the_yield_stress(law, n_components):
    virgin = law.initial(1, n_components)
    assert law.strength(virgin)[0] == law.yield_stress == 350.0
    known = {VonMises: math.sqrt(3), Tresca: 2.0}.get(type(law.surface))
    ratio = known or law.surface.over_shear
    assert law.surface.shear(law.strength(virgin))[0] == law.shear_yield_stress
    assert law.shear_yield_stress == pytest.approx(350.0 / ratio, rel=1e-14)
    assert not law.elastic


def test_a_law_that_never_yields_fits_whatever_its_stress():
    law = steel(yield_stress=math.inf)
    strain = np.random.default_rng(0).normal(size=(6, 50))
    found = law.respond(strain, law.initial(50, 6))
    assert law.elastic
    assert law.shear_yield_stress == math.inf
    assert law.misfit(strain, found.stress, found.state, found.state).max() < 1e-8
    assert law.misfit(strain, 1.001 * found.stress, found.state, found.state).min() > 1.0


@dataclass(frozen=True, kw_only=True)
class Rigidly(Law):
    """A law whose attributes are fields; it flows nowhere."""

    elasticity: Elasticity
    yield_stress: float
    hardens: bool = True

    def flow_stress(self, state):
        return np.full(state.accumulated.shape, self.yield_stress)

    def respond(self, strain, state):
        raise NotImplementedError


def test_attributes_of_a_law_may_be_fields():
    steel_like = Elasticity(youngs_modulus=2e5, poisson_ratio=0.3)
    with pytest.raises(TypeError, match="yield_stress"):
        Rigidly(elasticity=steel_like)
    law = Rigidly(elasticity=steel_like, yield_stress=70.0)
    assert law.elasticity is steel_like
    assert law.hardens
    assert law.shear_yield_stress == 70.0 / math.sqrt(3)
    assert law.stiffness(4) == pytest.approx(steel().stiffness(4))


def test_attributes_that_a_law_does_not_give_are_computed():
    class Least(Law):
        flow_stress = Rigidly.flow_stress
        respond = Rigidly.respond

    least = Least()
    assert not least.hardens
    with pytest.raises(NotImplementedError, match="Least must give its elasticity"):
        least.stiffness(4)
    assert StoredCentre(steel("kinematic")).yield_stress == 350.0


# -- the parts ---------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [4, 6])
def test_the_normal_is_the_derivative_of_the_equivalent_stress(n):
    surface = VonMises()
    stress = 100 * np.random.default_rng(4).standard_normal((n, 20))
    for j in range(n):
        step = np.zeros((n, 1))
        step[j] = 1e-4
        slope = (surface.equivalent(stress + step) - surface.equivalent(stress - step)) / 2e-4
        assert surface.normal(stress)[j] == pytest.approx(slope, abs=1e-8)
    assert np.array_equal(surface.normal(np.zeros((n, 1))), np.zeros((n, 1)))


@pytest.mark.parametrize("n", [4, 6])
def test_energy_is_half_of_stress_times_strain(n):
    elasticity = Elasticity(youngs_modulus=7e4, poisson_ratio=0.33)
    strain = np.random.default_rng(5).standard_normal((n, 20))
    stress = elasticity.stiffness(n) @ strain
    assert elasticity.energy_density(stress) == pytest.approx((stress * strain).sum(axis=0) / 2)


def test_biaxial_stress_leaves_none_across():
    elasticity = Elasticity(youngs_modulus=7e4, poisson_ratio=0.33)
    strain = np.array([[1e-3, 2e-3], [-3e-4, 1e-4]])
    across = -0.33 / (1 - 0.33) * strain.sum(axis=0)
    whole = np.stack([strain[0], across, strain[1], np.zeros(2)])
    stress = elasticity.stiffness(4) @ whole
    assert np.abs(stress[1]).max() < 1e-10
    assert stress[[0, 2]] == pytest.approx(elasticity.biaxial_stress(strain))


# -- closed forms ------------------------------------------------------------------------------


@pytest.mark.parametrize("hardening", HARDENING)
def test_uniaxial_tension_follows_the_bilinear_curve(hardening):
    material = steel(hardening)
    law = PlaneStress(material)
    E, Eu = material.youngs_modulus, 0.024 * material.youngs_modulus
    strain, state = np.zeros((4, 1)), law.initial(1, 4)
    for axial in np.linspace(0, 0.01, 11):
        strain[0] = axial
        for _ in range(30):  # free lateral contraction by Newton on yy
            response = law.respond(strain, state)
            strain[1] -= response.stress[1] / response.tangent[1, 1]
        state = response.state
    onset = material.yield_stress / E
    slope = 0.0 if hardening == "none" else Eu
    assert response.stress[0, 0] == pytest.approx(350 + slope * (0.01 - onset), rel=1e-9)
    assert law.strength(state)[0] == pytest.approx(response.stress[0, 0], rel=1e-9)


@pytest.mark.parametrize("hardening", HARDENING)
def test_shear_in_one_direction_follows_the_shear_strength(hardening):
    material = steel(hardening)
    pure_shear = np.zeros((6, 1))
    pure_shear[4] = 0.02
    found = material.respond(pure_shear, material.initial(1, 6))
    shear = material.surface.shear(material.strength(found.state))[0]
    assert found.stress[4, 0] / np.sqrt(2) == pytest.approx(shear, rel=1e-12)
    assert material.hardens == (shear > material.shear_yield_stress)


def test_reverse_yield_shows_the_bauschinger_effect_only_with_kinematic_hardening():
    reverse = {}
    for hardening in ("isotropic", "kinematic"):
        material = steel(hardening)
        pure_shear = np.zeros((4, 1))
        pure_shear[3] = 0.02
        forward = material.respond(pure_shear, material.initial(1, 4))
        sweep = np.zeros((4, 2001))
        sweep[3] = 0.02 - np.linspace(0, 0.02, 2001)
        state = PlasticState(
            np.repeat(forward.state.plastic_strain, 2001, axis=1),
            np.repeat(forward.state.accumulated, 2001),
        )
        first = np.argmax(material.respond(sweep, state).yielding[1:]) + 1
        elastic_range = 2 * material.elasticity.shear_modulus * (0.02 - sweep[3, first])
        reverse[hardening] = elastic_range / (np.sqrt(2 / 3) * material.yield_stress)
    assert reverse["kinematic"] == pytest.approx(2.0, rel=1e-2)
    assert reverse["isotropic"] > 2.2
