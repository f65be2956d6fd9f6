"""The tube of one-dimensional elements against closed forms, refinement and its own claims."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest

from tests.reference.autofrettage import PlasticTube, State, Steel
from tests.reference.incompressible_tube import IncompressibleTube
from tests.reference.tube import Tube

E, NU, YIELD = 2e5, 0.3, 400.0
A, B = 1.0, 3.0
HARD = 0.024 * E


def steel(tangent_modulus: float = 0.0, share: float = 1.0, nu: float = NU) -> Steel:
    return Steel(
        youngs_modulus=E,
        poisson_ratio=nu,
        yield_stress=YIELD,
        tangent_modulus=tangent_modulus,
        kinematic_share=share,
        expansion=1.2e-5,
    )


def tube(material: Steel, elements: int = 100) -> PlasticTube:
    return PlasticTube(inner=A, outer=B, steel=material, elements=elements)


def exact(tangent_modulus: float = 0.0, share: float = 1.0) -> IncompressibleTube:
    return IncompressibleTube(
        inner=A,
        outer=B,
        youngs_modulus=E,
        yield_stress=YIELD,
        plastic_modulus=steel(tangent_modulus).plastic_modulus,
        kinematic_share=share,
    )


MATERIALS = [(0.0, 1.0), (HARD, 1.0), (HARD, 0.5), (HARD, 0.0)]
PRESSURE = 0.95 * exact().collapse


def test_wall_without_hardening_is_hills() -> None:
    wall, k = exact().loaded(PRESSURE), YIELD / sqrt(3)
    c, r = wall.front, np.array([A, 1.3, 2.9])
    within = -k * (2 * np.log(c / r) + 1 - (c / B) ** 2)
    radial = np.where(r < c, within, k * (c / B) ** 2 * (1 - (B / r) ** 2))
    assert wall.radial(r) == pytest.approx(radial)
    assert wall.pressure == pytest.approx(PRESSURE)


@pytest.mark.parametrize(("tangent_modulus", "share"), MATERIALS)
def test_closed_form_is_balanced_and_flows_by_its_law(tangent_modulus: float, share: float) -> None:
    solution = exact(tangent_modulus, share)
    for wall in (solution.loaded(PRESSURE), solution.change(PRESSURE)):
        r, h = np.linspace(1.001, 2.99, 40), 1e-6
        r = r[np.abs(r - wall.front) > 1e-3]
        slope = (wall.radial(r + h) - wall.radial(r - h)) / (2 * h)
        assert slope == pytest.approx(wall.difference(r) / r, rel=1e-5, abs=1e-4)
        joint = wall.front * np.array([1 - 1e-12, 1 + 1e-12])
        assert np.ptp(wall.difference(joint)) < 1e-6
    # von Mises' stress of the loaded wall is yield stress and H times equivalent plastic strain
    wall, r = solution.loaded(PRESSURE), np.array([A, 1.5])
    strain = (wall.elastic / r**2 - wall.difference(r)) / (4 * E / 3)
    equivalent = 2 / sqrt(3) * strain
    mises = sqrt(3) / 2 * wall.difference(r)
    assert mises == pytest.approx(YIELD + solution.plastic_modulus * equivalent)


def test_closed_form_of_residual_stress_has_no_resultant() -> None:
    for tangent_modulus, share in MATERIALS:
        r = np.linspace(A, B, 200001)
        radial, hoop = exact(tangent_modulus, share).residual(PRESSURE, r)
        assert radial[[0, -1]] == pytest.approx([0, 0], abs=1e-9)
        assert abs(np.trapezoid(hoop, r)) < 1e-4 * YIELD


def test_elastic_tube_is_lames() -> None:
    pressure = 0.4 * YIELD
    found = tube(steel()).history([(pressure, 0.0)], steps=1)[0]
    wall = Tube(inner=A, outer=B, youngs_modulus=E, poisson_ratio=NU)
    assert np.all(found.state.equivalent == 0)
    assert found.stress == pytest.approx(wall.pressed(found.r, pressure), abs=2e-4 * pressure)
    assert found.bore_displacement == pytest.approx(wall.widening(A, pressure), rel=1e-7)


def test_elastic_tube_under_heat_is_timoshenkos() -> None:
    wall = Tube(inner=A, outer=B, youngs_modulus=E, poisson_ratio=NU)
    elastic = Steel(youngs_modulus=E, poisson_ratio=NU, yield_stress=1e6, expansion=1.2e-5)
    found = tube(elastic).history([(0.0, 1.0)], lambda r: wall.temperature(r, 100.0, 0.0), 1)[0]
    expected = wall.heated(found.r, 100.0, 0.0, 1.2e-5)
    assert found.stress == pytest.approx(expected, abs=2e-4 * np.abs(expected).max())


@pytest.mark.parametrize(("tangent_modulus", "share"), MATERIALS)
def test_incompressible_tube_is_the_closed_form_loaded_and_unloaded(
    tangent_modulus: float, share: float
) -> None:
    solution = exact(tangent_modulus, share)
    assert solution.change(PRESSURE).front > A * 1.02  # it yields in reverse
    found = tube(steel(tangent_modulus, share, nu=0.4999), 200)
    loaded, unloaded = found.history([(PRESSURE, 0.0), (0.0, 0.0)])
    wall = solution.loaded(PRESSURE)
    assert loaded.stress[0] == pytest.approx(wall.radial(loaded.r), abs=5e-5 * YIELD)
    assert loaded.stress[1] == pytest.approx(wall.hoop(loaded.r), abs=5e-5 * YIELD)
    radial, hoop = solution.residual(PRESSURE, unloaded.r)
    assert unloaded.stress[0] == pytest.approx(radial, abs=5e-5 * YIELD)
    assert unloaded.stress[1] == pytest.approx(hoop, abs=5e-5 * YIELD)
    bore = solution.residual(PRESSURE, np.array([A]))[1]
    assert unloaded.at_bore()[1] == pytest.approx(bore[0], abs=5e-5 * YIELD)


def test_residual_stress_at_the_bore_converges_with_the_square_of_elements() -> None:
    bore = exact().residual(PRESSURE, np.array([A]))[1][0]
    path = [(PRESSURE, 0.0), (0.0, 0.0)]
    walls = [tube(steel(nu=0.49999), n) for n in (16, 32, 64)]  # fewer miss the reversed zone
    errors = [abs(wall.history(path)[-1].at_bore()[1] - bore) for wall in walls]
    assert errors[-1] < 5e-5 * YIELD
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx([2, 2], abs=0.1)


def test_tube_without_hardening_bears_no_more_than_its_limit() -> None:
    weak = tube(steel())
    assert len(weak.history([(0.999 * exact().collapse, 0.0)])) == 1
    with pytest.raises(RuntimeError, match="does not bear"):
        weak.history([(1.001 * exact().collapse, 0.0)])


@pytest.mark.parametrize(("tangent_modulus", "share"), MATERIALS)
def test_residual_stress_converges_with_elements_and_steps(
    tangent_modulus: float, share: float
) -> None:
    def residual(elements: int, steps: int) -> float:
        path = [(PRESSURE, 0.0), (0.0, 0.0)]
        wall = tube(steel(tangent_modulus, share), elements)
        return float(wall.history(path, steps=steps)[-1].at_bore()[1])

    best = residual(400, 80)
    assert residual(200, 80) == pytest.approx(best, abs=1e-4 * YIELD)
    assert residual(400, 20) == pytest.approx(best, abs=3e-4 * YIELD)


def test_reversed_yield_begins_at_the_bore_beyond_its_pressure() -> None:
    # without hardening, incompressible: release yields the bore again above 2 k (1 - a^2/b^2)
    threshold = 2 * YIELD / sqrt(3) * (1 - (A / B) ** 2)
    wall = tube(steel(nu=0.4999))
    for factor, yields in ((0.98, False), (1.1, True)):
        loaded, unloaded = wall.history([(factor * threshold, 0.0), (0.0, 0.0)])
        growth = unloaded.state.equivalent - loaded.state.equivalent
        assert bool(np.any(growth > 1e-9)) == yields
        assert not yields or np.argmax(growth) == 0


def test_bauschinger_effect_spares_the_bore_compression() -> None:
    path = [(PRESSURE, 0.0), (0.0, 0.0)]
    kinematic, isotropic = (
        tube(steel(HARD, share)).history(path)[-1].at_bore()[1] for share in (1.0, 0.0)
    )
    assert isotropic < kinematic < 0
    assert kinematic > isotropic + 0.05 * YIELD


@pytest.mark.parametrize(("tangent_modulus", "share"), MATERIALS)
def test_tangent_is_the_slope_of_stress(tangent_modulus: float, share: float) -> None:
    law = steel(tangent_modulus, share)
    first = np.array([[-0.004], [0.006], [0.0]])
    state = law.respond(first, State.virgin(1))[2]
    strain = first + np.array([[0.006], [-0.011], [0.001]])
    tangent = law.respond(strain, state)[1][..., 0]
    h = 1e-8
    for j, unit in enumerate(np.eye(3)[:, :, None]):
        above, below = (law.respond(strain + sign * h * unit, state)[0] for sign in (1, -1))
        assert (above - below)[:, 0] / (2 * h) == pytest.approx(tangent[:, j], rel=1e-5)


@pytest.mark.parametrize(("tangent_modulus", "share"), MATERIALS)
def test_bar_of_the_law_follows_its_curve_of_tension(tangent_modulus: float, share: float) -> None:
    law, state = steel(tangent_modulus, share), State.virgin(1)
    strains = np.r_[np.linspace(0, 0.01, 30), np.linspace(0.01, -0.002, 50)]
    across, result = np.zeros(1), []
    for axial in strains:
        for _ in range(50):  # the stress across is zero
            stress, tangent, after = law.respond(np.array([across, across, [axial]]), state)
            across = across - stress[0] / (tangent[0, 0] + tangent[0, 1])
        state = after
        result.append(stress[2, 0])
    top = YIELD + tangent_modulus * (0.01 - YIELD / E)
    elastic_range = 2 * YIELD + (1 - share) * 2 * (top - YIELD)
    bottom = top - elastic_range - tangent_modulus * (0.012 - elastic_range / E)
    assert (result[29], result[-1]) == pytest.approx((top, bottom), rel=1e-9)
