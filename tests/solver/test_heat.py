"""Young's modulus and yield stress that fall with temperature."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from solver import Body, Material, Model, ModelError, PathControl, Solution, Temperature, solve
from solver.materials import (
    ArmstrongFrederick,
    Chaboche,
    Elasticity,
    Heated,
    Law,
    Layered,
    PlaneStress,
    SmoothMaterial,
    TrescaMaterial,
    Voce,
)
from solver.mesh import grid
from tests.solver.back_stress_rules import BurletCailletaud, OhnoWang
from tests.solver.yield_surfaces import Hosford

E, RE, ALPHA = 2e5, 400.0, 1.2e-5
PAIRS = ((1.0, 1.0), (0.7, 0.7), (0.8, 0.5), (0.6, 0.9))
"""Factors of Young's modulus and of the yield stress."""


def linear(e: float, r: float, hardening: Any) -> Material:
    return Material(youngs_modulus=e * E, poisson_ratio=0.3, yield_stress=r * RE,
                    hardening=hardening, hardening_ratio=0.05)  # fmt: skip


def elastic(e: float) -> Elasticity:
    return Elasticity(youngs_modulus=e * E, poisson_ratio=0.3)


def curve(e: float, r: float) -> Voce:
    return Voce(yield_stress=r * RE, saturation=r * 150.0, rate=300.0 * e / r)


def fading(e: float, r: float) -> Chaboche:
    back = ArmstrongFrederick(e * 60_000.0, 600.0 * e / r), ArmstrongFrederick(e * 4000.0)
    return Chaboche(elasticity=elastic(e), curve=curve(e, r), back_stresses=back)


def own(e: float, r: float) -> Chaboche:
    back = BurletCailletaud(e * 60_000.0, 600.0 * e / r, 0.1), OhnoWang(e * 4000.0, r * 100.0)
    return Chaboche(elasticity=elastic(e), curve=curve(e, r), back_stresses=back)


LAWS: dict[str, Any] = {
    **{h: lambda e, r, h=h: linear(e, r, h) for h in ("none", "isotropic", "kinematic", "mixed")},
    "plane stress": lambda e, r: PlaneStress(linear(e, r, "mixed")),
    "projected": lambda e, r: PlaneStress(linear(e, r, "mixed")),
    "tresca": lambda e, r: TrescaMaterial(elasticity=elastic(e), curve=curve(e, r)),
    "hosford": lambda e, r: SmoothMaterial(
        elasticity=elastic(e), curve=curve(e, r), surface=Hosford(8.0)
    ),
    "fading": fading,
    "rules of one's own": own,
    "layers": lambda e, r: Layered(
        elasticity=elastic(e), weights=(0.4, 0.5), yields=(r * RE, r * 600.0)
    ),
}


def path(points: int, steps: int = 12) -> np.ndarray:
    """Return random strains (steps, 4, points) of some yield strains."""
    rng = np.random.default_rng(1995)
    return np.cumsum(rng.normal(0.0, RE / E, (steps, 4, points)), axis=0)


@pytest.mark.parametrize("name", LAWS)
def test_a_heated_law_is_the_law_of_its_constants(name: str) -> None:
    strains = path(len(PAIRS))
    stiff, strong = (np.array(each) for each in zip(*PAIRS, strict=True))
    heated: Law = Heated(law=LAWS[name](1.0, 1.0), stiff=stiff, strong=strong)
    state = heated.initial(len(PAIRS), 4)
    own = [LAWS[name](e, r) for e, r in PAIRS]
    states = [law.initial(1, 4) for law in own]
    for strain in strains:
        found, before = heated.respond(strain, state), state
        state = found.state
        for k, law in enumerate(own):
            wanted = law.respond(strain[:, [k]], states[k])
            assert found.stress[:, k] == pytest.approx(wanted.stress[:, 0], rel=1e-9, abs=1e-6)
            assert found.tangent[..., k] == pytest.approx(wanted.tangent[..., 0], abs=1e-9 * E)
            states[k] = wanted.state
            assert state.plastic_strain[:, k] == pytest.approx(states[k].plastic_strain[:, 0])
            spent = law.dissipation(law.initial(1, 4), wanted)
            assert heated.at(np.array([k])).dissipation(
                law.initial(1, 4), wanted._replace(state=state.at(np.array([k])))
            ) == pytest.approx(spent, rel=1e-7, abs=1e-9)
        assert heated.misfit(strain, found.stress, before, state).max() < 1e-6 * RE
        beyond = heated.yield_value(found.stress, state)
        assert beyond == pytest.approx(
            [law.yield_value(found.stress[:, [k]], states[k])[0] for k, law in enumerate(own)],
            rel=1e-6, abs=1e-5,
        )  # fmt: skip
    assert state.accumulated.min() > 3 * RE / E


@pytest.mark.parametrize("name", LAWS)
def test_what_does_not_flow_keeps_every_bit_while_the_temperature_changes(name: str) -> None:
    """There and back again, rounding would look like flow: of a layer that is far from yielding."""
    cold, state = LAWS[name](1.0, 1.0), LAWS[name](1.0, 1.0).initial(40, 4)
    rng = np.random.default_rng(7)
    for strain in path(40):
        e, r = rng.uniform(0.5, 1.0, (2, 40))
        heated = Heated(law=cold, stiff=e, strong=r)
        found = heated.respond(strain, state)
        assert heated.misfit(strain, found.stress, state, found.state).max() < 1e-6 * RE
        still = ~(found.state.accumulated > state.accumulated)
        for field in fields(state):
            before, after = (getattr(s, field.name) for s in (state, found.state))
            assert np.array_equal(before[..., still], after[..., still])
        state = found.state


@pytest.mark.parametrize("plane", [False, True])
def test_prager_hardening_has_one_meaning_under_changing_temperature(plane: bool) -> None:
    """The back stress is 2/3 H(T) times the plastic strain: a function of state, in both laws."""
    prager = linear(1.0, 1.0, "kinematic")
    flat = Voce(yield_stress=RE, saturation=0.0, rate=1.0)
    unfading = Chaboche(elasticity=elastic(1.0), curve=flat,
                        back_stresses=(ArmstrongFrederick(prager.plastic_modulus),))  # fmt: skip
    laws: list[Law] = [prager, unfading]
    if plane:
        laws = [PlaneStress(law) for law in laws]
    rng, states = np.random.default_rng(11), [law.initial(30, 4) for law in laws]
    for strain in path(30):
        e, r = rng.uniform(0.5, 1.0, (2, 30))
        hot = [Heated(law=law, stiff=e, strong=r) for law in laws]
        found = [law.respond(strain, state) for law, state in zip(hot, states, strict=True)]
        assert found[1].stress == pytest.approx(found[0].stress, rel=1e-9, abs=1e-9 * RE)
        states = [one.state for one in found]
        for law, state in zip(hot, states, strict=True):
            X = 2 / 3 * e * prager.plastic_modulus * state.plastic_strain
            assert law.back_stress(state) == pytest.approx(X, rel=1e-9, abs=1e-9 * RE)
    assert states[0].accumulated.min() > 2 * RE / E


def bar(rise: Any, heat: dict[str, float], material: Any = None, **own: Any) -> Solution:
    """Heat a bar between two walls, and cool it again."""
    material = material or linear(1.0, 1.0, "none")
    load = Temperature(rise=rise, expansion=ALPHA, **heat)
    body = Body(name="bar", mesh=grid(np.linspace(0, 10, 6), np.linspace(0, 2, 3)),
                material=material, kinematics="plane_stress", loads=(load,),
                supports={"left": "x", "right": "x", "bottom": "y"})  # fmt: skip
    return solve(Model(bodies=(body,)), **own)


@pytest.mark.solves
@pytest.mark.parametrize("steps", [1, 20])
def test_a_heated_bar_yields_at_what_is_left_of_its_strength(steps: int) -> None:
    rise, heat = 400.0, {"modulus_drop": 5e-4, "yield_drop": 1e-3}
    e, r = 1 - 5e-4 * rise, 1 - 1e-3 * rise
    control = PathControl(load_step=1 / steps, unload_steps=steps)
    found = bar(rise, heat, control=control)
    assert found.stress("bar", "loaded")[0] == pytest.approx(-r * RE, rel=1e-5)
    # cold again it has its stiffness again, and the plastic strain of the heat
    plastic = ALPHA * rise - r * RE / (e * E)
    assert found.stress("bar")[0] == pytest.approx(min(E * plastic, RE), rel=1e-5)
    if steps > 1:
        assert found.audit().passed, found.audit().violations


@pytest.mark.solves
def test_an_elastic_body_softens_and_comes_back() -> None:
    """Its energy follows its stiffness: the balance of energy is exact."""
    soft = Material(youngs_modulus=E, poisson_ratio=0.3)
    rise = lambda x: 30.0 + 20.0 * x[0]  # noqa: E731
    found = bar(rise, {"modulus_drop": 1e-3}, soft, control=PathControl(load_step=0.25))
    exact = bar(rise, {}, soft)
    assert np.abs(found.stress("bar")).max() < 1e-8
    # a bar in series: one force, the mean strain of its softened parts is the mean expansion
    x = np.linspace(0, 10, 100_001)
    hot = rise(x[None])
    one = ALPHA * np.trapezoid(hot, x) / np.trapezoid(1 / (E * (1 - 1e-3 * hot)), x)
    assert -found.stress("bar", "loaded")[0].mean() == pytest.approx(one, rel=5e-3)
    assert -exact.stress("bar", "loaded")[0].mean() > 1.05 * one
    audit = found.audit()
    assert audit.passed, audit.violations
    assert audit.figures["audit_energy"] < 1e-9


@pytest.mark.solves
def test_a_temperature_that_leaves_no_stiffness_is_refused() -> None:
    with pytest.raises(ModelError, match=r"1 - modulus_drop \* rise = 0\.04: .* least 0\.05"):
        bar(960.0, {"modulus_drop": 1e-3})
    with pytest.raises(ModelError, match=r"temperature\.yield_drop = nan"):
        bar(1.0, {"yield_drop": np.nan})
