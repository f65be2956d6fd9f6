"""Smooth yield surfaces of one's own: against known surfaces, closed forms and what is refused."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from solver import ModelError
from solver.materials import (
    Chaboche,
    PlaneStress,
    SmoothMaterial,
    SmoothSurface,
    TrescaMaterial,
    VonMises,
)
from tests.solver.laws import CURVES, STEEL, SURFACES, smooth
from tests.solver.yield_surfaces import Hosford, Odd, Quick

RE, E, G = 350.0, 2e5, STEEL.shear_modulus
ANY = [*SURFACES.values(), Hosford(100.0)]


def strained(n=1000, size=5e-3, components=6, seed=1):
    return size * np.random.default_rng(seed).standard_normal((components, n))


@pytest.mark.parametrize("a", [2.0, 4.0])
@pytest.mark.parametrize("curve", CURVES)
def test_with_an_exponent_of_two_or_four_hosford_is_von_mises(a, curve):
    own = smooth(Hosford(a), curve)
    mises = Chaboche(elasticity=STEEL, curve=CURVES[curve])
    strain, zero = strained(), (own.initial(1000, 6), mises.initial(1000, 6))
    for _ in range(2):
        found, wanted = own.respond(strain, zero[0]), mises.respond(strain, zero[1])
        assert (found.yielding == wanted.yielding).all()
        assert np.abs(found.stress - wanted.stress).max() < 1e-9 * RE
        assert np.abs(found.tangent - wanted.tangent).max() < 1e-9 * E
        assert found.state.accumulated == pytest.approx(wanted.state.accumulated, rel=1e-12)
        strain, zero = strain + strained(seed=2), (found.state, wanted.state)


def test_a_large_exponent_tends_to_tresca_as_one_over_itself():
    tresca = TrescaMaterial(elasticity=STEEL, curve=CURVES["none"])
    strain = strained()
    wanted = tresca.respond(strain, tresca.initial(1000, 6)).stress
    off = []
    for a in (25.0, 50.0, 100.0):
        law = smooth(Hosford(a), "none")
        found = law.respond(strain, law.initial(1000, 6)).stress
        # on the surface the largest difference d is the yield stress, or less by 2^(-1/a) at most:
        # d^a <= 2 Re^a, and both others are not larger than d
        d = tresca.surface.equivalent(found)
        assert d.max() <= RE * 2 ** (1 / a) * (1 + 1e-9)
        assert d[tresca.surface.equivalent(wanted) > RE * (1 - 1e-9)].min() >= RE * (1 - 1e-9)
        off.append(np.abs(found - wanted).max() / RE)
    assert off[2] < 0.06
    assert np.log2(off[0] / off[1]) > 0.5 < np.log2(off[1] / off[2])


@pytest.mark.parametrize("a", [2.0, 3.5, 8.0, 20.0, 100.0])
def test_shear_is_the_closed_form_of_hosford(a):
    # in pure shear k the differences are k, k and 2 k: 2 Re^a = (2 + 2^a) k^a
    k = RE * (2 / (2 + 2**a)) ** (1 / a)
    law = smooth(Hosford(a), "none")
    strain = np.zeros((4, 1))
    strain[3] = 0.02
    found = law.respond(strain, law.initial(1, 4))
    assert found.stress[3, 0] / np.sqrt(2) == pytest.approx(k, rel=1e-13)
    assert law.ultimate_shear_stress == law.shear_yield_stress == pytest.approx(k, rel=1e-14)


@pytest.mark.parametrize("surface", ANY)
def test_tension_yields_at_the_yield_stress(surface):
    """As equal compression across does, at each angle in the plane."""
    law = smooth(surface, "none")
    angle = np.linspace(0.0, np.pi, 13)
    pull = np.stack([np.cos(angle) ** 2, np.sin(angle) ** 2, 0 * angle, np.sin(2 * angle) / 2**0.5])
    assert law.surface.equivalent(RE * pull) == pytest.approx(RE, rel=1e-13)
    one = np.array([[1.0], [1.0], [1.0], [0.0]])
    assert law.surface.equivalent(RE * (pull - 3 * one)) == pytest.approx(RE, rel=1e-13)


@pytest.mark.parametrize("surface", ANY)
def test_the_normal_is_the_derivative_of_the_equivalent_stress(surface):
    stress, h = 300 * np.random.default_rng(3).standard_normal((6, 200)), 1e-4
    sharp = 1e-6 * surface.profile(np.linspace(0.0, np.pi / 3, 200)).bend.max() ** 2
    for j, row in enumerate(surface.normal(stress)):
        step = h * np.eye(6)[:, [j]]
        slope = (surface.equivalent(stress + step) - surface.equivalent(stress - step)) / (2 * h)
        assert row == pytest.approx(slope, abs=max(1e-8, 1e-2 * sharp))
    none = surface.normal(np.array([[5.0], [5.0], [5.0], [0.0]]))
    assert np.abs(none).max() == 0.0


@pytest.mark.parametrize("surface", ANY)
def test_no_stress_on_a_line_between_two_is_more_than_between_theirs(surface):
    one, other = np.random.default_rng(5).standard_normal((2, 6, 5000))
    ends = surface.equivalent(one) + surface.equivalent(other)
    assert (2 * surface.equivalent((one + other) / 2) <= ends * (1 + 1e-12)).all()


@pytest.mark.parametrize("surface", ANY)
@pytest.mark.parametrize("size", [2e-3, 5e-2, 1.0])
def test_the_return_is_the_nearest_point_however_far_the_trial_stress(surface, size):
    """No stress inside the surface does more work on the flow: that of maximum dissipation."""
    law, n = smooth(surface, "none"), 1000
    strain = strained(n, size)
    found = law.respond(strain, law.initial(n, 6))
    assert found.yielding.mean() > 0.9
    flow = found.state.plastic_strain
    work = (found.stress * flow).sum(axis=0)
    most = RE * surface.power(flow)
    scale = RE * found.state.accumulated.clip(1e-12)
    assert np.abs((work - most) / scale).max() < 1e-9
    rounding = 1e-15 * E * size * (1 + surface.profile(np.linspace(0, 1, 50)).bend.max())
    assert np.abs(law.yield_value(found.stress, found.state)[found.yielding]).max() < 50 * rounding
    assert (work >= 0).all()


@pytest.mark.parametrize("surface", ANY)
def test_many_small_steps_are_tended_to_at_first_order(surface):
    law, turn = smooth(surface, "linear"), strained(60, 4e-3)
    first = strained(60, 4e-3, seed=8)

    def after(steps):
        state = law.initial(60, 6)
        for share in np.linspace(0.0, 1.0, steps + 1)[1:]:
            found = law.respond(share * first, state)
            state = found.state
        for share in np.linspace(0.0, 1.0, steps + 1)[1:]:
            found = law.respond(first + share * turn, state)
            state = found.state
        return found.stress

    exact = after(64)
    off = [np.abs(after(n) - exact).mean() for n in (4, 16)]
    assert off[0] > 3 * off[1]
    assert off[1] < 0.01 * RE


@pytest.mark.parametrize(("a", "state"), [(8.0, 4), (8.0, 6), (20.0, 6), (100.0, 6)])
@pytest.mark.parametrize("strain", [(0.01, -0.005, -0.005), (0.005, 0.005, -0.01),
                                    (0.01, 0.0, -0.01), (0.01, -0.005 + 1e-9, -0.005)])  # fmt: skip
def test_the_tangent_is_right_where_trial_stresses_are_the_same(a, state, strain):
    law, at = smooth(Hosford(a), "linear"), np.zeros((state, 1))
    at[:3, 0] = strain
    before, h = law.initial(1, state), 1e-9
    steps = h * np.eye(state)[:, :, None]
    change = [law.respond(at + s, before).stress - law.respond(at - s, before).stress
              for s in steps]  # fmt: skip
    difference = np.stack([each[:, 0] for each in change], axis=1) / (2 * h)
    assert np.abs(difference - law.respond(at, before).tangent[:, :, 0]).max() < 1e-4 * E


@pytest.mark.parametrize("a", [2.5, 8.0, 20.0])
def test_complex_steps_give_the_profile_of_the_closed_form(a):
    angle = np.linspace(0.0, np.pi / 3, 101)
    found, wanted = Hosford(a).profile(angle), Quick(a).profile(angle)
    assert found.size == pytest.approx(wanted.size, rel=1e-14)
    assert found.slope == pytest.approx(wanted.slope, abs=1e-13)
    inside = slice(1, -1)  # with a = 2.5 the bend has a cusp at the ends
    assert found.bend[inside] == pytest.approx(wanted.bend[inside], abs=1e-7)


def test_plane_stress_yields_where_hosford_does():
    law = PlaneStress(smooth(Hosford(8.0), "none"))
    angles = np.linspace(0, 2 * np.pi, 37)[:-1] + 0.013
    strain, state = np.zeros((4, len(angles))), law.initial(len(angles), 4)
    for size in np.linspace(0.2, 3, 15):
        strain[:2] = size * RE / E * np.stack([np.cos(angles), np.sin(angles)])
        found = law.respond(strain, state)
        state = found.state
    x, y = found.stress[:2] / RE
    assert (np.abs(x) ** 8 + np.abs(y) ** 8 + np.abs(x - y) ** 8) / 2 == pytest.approx(
        np.ones_like(x), rel=1e-8
    )


def test_a_material_weaker_in_compression_yields_there_first():
    c = 0.08
    law = smooth(Odd(c), "none")
    push = -RE * np.array([[1.0], [0.0], [0.0], [0.0]])
    assert law.surface.equivalent(push)[0] == pytest.approx(RE * (1 + c) / (1 - c), rel=1e-13)
    values = np.random.default_rng(7).standard_normal((6, 5000))
    ratio = law.surface.equivalent(values) / VonMises().equivalent(values)
    assert ratio.max() <= law.surface.over_mises


@dataclass(frozen=True)
class Wrong(SmoothSurface):
    """A surface with one mistake."""

    of: Any

    def tension(self, s: Any) -> Any:
        return self.of(s)


def _mises(s: Any) -> Any:
    return np.sqrt(((s[0] - s[1]) ** 2 + (s[1] - s[2]) ** 2 + (s[0] - s[2]) ** 2) / 2)


@pytest.mark.parametrize(
    ("of", "words"),
    [
        (lambda s: 2 * _mises(s), "equal to the stress in tension"),
        (lambda s: _mises(s) ** 2, "proportional to the stress"),
        (lambda s: _mises(s) + 0.1 * s.sum(axis=0) - 0.1 * (s[0] - s[2]), "of the mean stress"),
        (lambda s: s[0] - s[2], "without a corner"),
        (
            lambda s: Hosford(8.0).tension(np.abs(s - s.mean(axis=0)) * [[1], [-1], [-1]]),
            "with complex numbers, without abs",
        ),
        (lambda s: Odd(0.2).tension(s), "convex"),
        (lambda s: np.nan * _mises(s), "equal to the stress in tension"),
    ],
)
def test_what_is_no_smooth_yield_surface_is_refused(of, words):
    with pytest.raises(ModelError, match=words) as refusal:
        SmoothMaterial(elasticity=STEEL, curve=CURVES["none"], surface=Wrong(of))
    assert refusal.value.field == "surface"
