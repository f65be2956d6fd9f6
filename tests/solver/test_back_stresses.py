"""Rules of back stresses that the package does not have, against rates and closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from solver.materials import ArmstrongFrederick, BackStress, Chaboche, Heated, Law
from tests.solver.back_stress_rules import BurletCailletaud, Plain
from tests.solver.laws import BACK_STRESSES, CURVES, STEEL, chaboche

RE, E, G = 350.0, 2e5, STEEL.shear_modulus
OWN = ("burlet cailletaud", "ohno wang")
TENSION = np.array([1.0, -0.5, -0.5, 0.0])
STIFF = 1e6
"""Stress at which nothing flows yet is below the yield surface by 1 / this of that of the path."""
SHEAR = np.array([0.0, 0.0, 0.0, np.sqrt(2.0)])
PATHS = {
    "tension": [0.02 * TENSION],
    "cyclic shear": [sign * 0.01 * SHEAR for sign in (1, -1, 1, -1)],
    "tension, then cyclic shear": [0.01 * TENSION + each * SHEAR for each in (0, 0.01, -0.01)],
}


def stepped(law: Law, path: list[np.ndarray], steps: int) -> np.ndarray:
    """Return the stress (4,) after a path of strains, each reached in equal increments."""
    state, now = law.initial(1, 4), np.zeros(4)
    for end in path:
        for share in np.arange(1, steps + 1) / steps:
            strain = (now + (end - now) * share)[:, None]
            found = law.respond(strain, state)
            assert law.misfit(strain, found.stress, state, found.state).max() < 1e-9 * RE
            state = found.state
        now = end
    return found.stress[:, 0]


def integrated(law: Chaboche, path: list[np.ndarray]) -> np.ndarray:
    """Return the same stress from the rates of stress and back stress.

    Stress is held to the yield surface by a rate of flow that is proportional to its distance.
    """
    rules = law.back_stresses
    y = np.zeros(4 * (1 + len(rules)) + 1)  # stress (a deviator), accumulated, back stresses

    def rates(_: float, y: np.ndarray, strain: np.ndarray) -> np.ndarray:
        s, p, X = y[:4], y[4], y[5:].reshape(-1, 4)
        xi = s - X.sum(axis=0)
        q = np.sqrt(1.5 * xi @ xi)
        N = 1.5 * xi / q
        grow = [
            2 / 3 * rule.modulus * N - rule.recalled(x[:, None], N[:, None])[:, 0]
            for rule, x in zip(rules, X, strict=True)
        ]
        slope = float(law.curve.slope(np.array([p]))[0])
        hard = 3 * G + slope + N @ sum(grow)
        size = float(law.curve.flow_stress(np.array([p]))[0])
        dp = max(2 * G * N @ strain + STIFF * (q - size), 0.0) / hard
        return np.concatenate([2 * G * (strain - dp * N), [dp], *(dp * each for each in grow)])

    now = np.zeros(4)
    for end in path:
        y[:4] += 1e-9 * (end - now)  # where there is no stress, flow has no direction
        y = solve_ivp(rates, (0, 1), y, "LSODA", args=(end - now,), rtol=1e-7, atol=1e-7).y[:, -1]
        now = end
    return y[:4]


TURNED = "tension, then cyclic shear"


@pytest.mark.parametrize(
    ("name", "path"),
    [
        *((name, "tension") for name in OWN),
        ("burlet cailletaud", TURNED),
        pytest.param("ohno wang", TURNED, marks=pytest.mark.long),
    ],
)
def test_a_rule_of_ones_own_follows_its_rates(name: str, path: str) -> None:
    law = chaboche(name)
    wanted = integrated(law, PATHS[path])
    errors = [np.abs(stepped(law, PATHS[path], n) - wanted).max() for n in (20, 40)]
    assert errors[1] < 1e-3 * RE
    exact = errors[1] < 1e-6 * RE  # exponentials, and a flow that does not turn
    assert exact or errors[0] / errors[1] > 1.7  # else of first order


@pytest.mark.parametrize("steps", [1, 3])
@pytest.mark.parametrize("rule", [ArmstrongFrederick, Plain])
def test_flow_that_does_not_turn_is_exact_in_any_number_of_steps(
    rule: type[BackStress], steps: int
) -> None:
    rules = rule(60_000.0, 600.0), rule(4000.0, 20.0)
    law = Chaboche(elasticity=STEEL, curve=CURVES["voce"], back_stresses=rules)
    for path in (PATHS["tension"], PATHS["cyclic shear"]):
        wanted = stepped(law, path, 50)
        assert stepped(law, path, steps) == pytest.approx(wanted, abs=1e-9 * RE)


def test_the_heat_of_a_fading_back_stress_converges_with_the_fourth_order() -> None:
    rule = ArmstrongFrederick(60_000.0, 600.0)
    N = TENSION[:, None]
    dp, start = np.array([2e-3]), -40.0 * N

    def heat(steps: int) -> float:
        """Return the heat of a flow that reverses the back stress."""
        X, total = start, 0.0
        for _ in range(steps):
            after = rule.evolve(X, dp / steps, N)
            total += float(rule.heat(X, after, dp / steps, dp / steps * N)[0])
            X = after
        return total

    wanted = heat(200)
    errors = [abs(heat(n) / wanted - 1) for n in (2, 4)]
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] > 12


def test_the_rule_of_the_package_written_out_is_that_of_the_package() -> None:
    constants = [(60_000.0, 600.0), (4000.0, 20.0)]
    laws = [
        Chaboche(elasticity=STEEL, curve=CURVES["voce"], back_stresses=rules)
        for rules in (
            tuple(ArmstrongFrederick(*each) for each in constants),
            tuple(Plain(*each) for each in constants),
            (ArmstrongFrederick(*constants[0]), Plain(*constants[1])),
        )
    ]
    rng = np.random.default_rng(1966)
    states, strain = [law.initial(200, 6) for law in laws], np.zeros((6, 200))
    for _ in range(5):
        strain = strain + 3e-3 * rng.standard_normal(strain.shape)
        known, *own = [law.respond(strain, state) for law, state in zip(laws, states, strict=True)]
        for each in own:
            assert np.abs(each.stress - known.stress).max() < 1e-9 * RE
            assert np.abs(each.tangent - known.tangent).max() < 1e-7 * E  # slopes by differences
            assert np.abs(each.state.back - known.state.back).max() < 1e-9 * RE
        for law, state, each in zip(laws, states, [known, *own], strict=True):
            heat, first = law.dissipation(state, each), laws[0].dissipation(states[0], known)
            assert heat == pytest.approx(first, rel=0.1)  # the default heat is of first order
        states = [known.state, *(each.state for each in own)]


def test_burlet_and_cailletauds_rule_is_armstrong_and_fredericks_on_a_straight_path() -> None:
    own, known = (
        Chaboche(elasticity=STEEL, curve=CURVES["none"], back_stresses=(rule,))
        for rule in (BurletCailletaud(60_000.0, 600.0, 0.1), ArmstrongFrederick(60_000.0, 600.0))
    )
    straight, turned = (PATHS[name] for name in ("cyclic shear", "tension, then cyclic shear"))
    assert stepped(own, straight, 50) == pytest.approx(stepped(known, straight, 50), abs=1e-9 * RE)
    assert np.abs(stepped(own, turned, 50) - stepped(known, turned, 50)).max() > 0.01 * RE


@pytest.mark.parametrize("name", OWN)
def test_tension_follows_the_strength_up_to_the_limit(name: str) -> None:
    law = chaboche(name, "none")
    stress = stepped(law, [0.01 * TENSION], 100)
    p = 0.01 - (stress[0] - stress[1]) / (2 * G) / 1.5
    state = replace(law.initial(1, 4), accumulated=np.array([p]))
    assert stress[0] - stress[1] == pytest.approx(law.strength(state)[0], rel=1e-3)
    far = replace(state, accumulated=np.array([10.0]))
    bound = law.ultimate_shear_stress
    assert law.surface.shear(law.strength(far))[0] == pytest.approx(bound, rel=1e-3)
    assert not (law.hardens or law.symmetric)


@pytest.mark.parametrize("name", BACK_STRESSES)
def test_a_wrong_back_stress_is_a_misfit(name: str) -> None:
    law = chaboche(name)
    strain = 0.005 * SHEAR[:, None]
    before = law.initial(1, 4)
    stress, _, after, _ = law.respond(strain, before)
    moved = after.back.copy()
    moved[0, 3] += 1.0
    assert law.misfit(strain, stress, before, after).max() < 1e-9 * RE
    assert law.misfit(strain, stress, before, replace(after, back=moved)).min() > 0.5


@pytest.mark.parametrize("name", OWN)
def test_heat_may_leave_a_back_stress_beyond_its_limit(name: str) -> None:
    law = chaboche(name)
    _, _, hot, _ = law.respond(0.05 * SHEAR[:, None], law.initial(1, 4))
    heated = Heated(law=law, stiff=np.array([1.0]), strong=np.array([0.3]))
    found = heated.respond(0.06 * SHEAR[:, None], hot)
    assert found.yielding.all()
    assert heated.misfit(0.06 * SHEAR[:, None], found.stress, hot, found.state).max() < 1e-9 * RE


def test_where_a_rule_gives_no_number_the_stress_is_none() -> None:
    class Lost(Plain):
        def evolve(self, old, growth, normal):
            return np.where(growth > 1e-3, np.nan, Plain.evolve(self, old, growth, normal))

    law = Chaboche(elasticity=STEEL, curve=CURVES["voce"], back_stresses=(Lost(6e4, 600.0),))
    strain = np.array([0.002, 0.02]) * SHEAR[:, None]
    stress = law.respond(strain, law.initial(2, 4)).stress
    assert np.isfinite(stress[:, 0]).all()
    assert np.isnan(stress[3, 1])
