"""Bodies of a material with a yield surface of one's own: closed forms, limit loads, the audit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from solver import Body, LimitLoad, Model, PathControl, solve
from solver.materials import (
    Chaboche,
    Elasticity,
    SmoothMaterial,
    SmoothSurface,
    TrescaMaterial,
    Voce,
)
from solver.materials.yield_surface import Returned
from solver.mesh import grid
from tests.solver.yield_surfaces import Hosford
from tests.verification import test_prandtl as prandtl
from tests.verification.thick_walls import CYLINDER, YIELD, errors, press

STEEL = Elasticity(youngs_modulus=2e5, poisson_ratio=0.3)
SHEAR = YIELD / np.sqrt(3)
"""Shear yield stress that the closed form of the cylinder holds for [MPa]."""


def ideal(a: float, poisson_ratio: float, shear: float = SHEAR) -> SmoothMaterial:
    """A material without hardening that yields at this shear stress."""
    return SmoothMaterial(
        elasticity=Elasticity(youngs_modulus=2e5, poisson_ratio=poisson_ratio),
        curve=Voce(yield_stress=shear * ((2 + 2**a) / 2) ** (1 / a)),
        surface=Hosford(a),
    )


@pytest.mark.parametrize("a", [8.0, 20.0])
def test_a_nearly_incompressible_cylinder_is_that_of_its_shear_stress(a: float) -> None:
    """Across the plane stress is the mean: pure shear, whatever the surface, as with von Mises.

    Measured 0.001 % where an element edge lies on the plastic front, 0.05 % elsewhere.
    """
    material = ideal(a, 0.4999)
    for n in (10, 12):
        body = press("plane_strain", CYLINDER.pressure, 0.4999, n, n, material=material)
        error = errors(body, CYLINDER)
        assert error["loaded"] < {10: 1e-4, 12: 1e-3}[n]
        assert error["unloaded"] < {10: 2e-4, 12: 1e-3}[n]
        assert body.audit().passed


@pytest.mark.long
def test_the_limit_load_of_a_strip_is_that_of_prandtl() -> None:
    """(2 + pi) k; measured 1.0047 to 1.0063, as of von Mises."""
    law = ideal(20.0, 0.45)
    with pytest.raises(LimitLoad, match="flows around") as outcome:
        prandtl.pressed(law, "plane_strain", (2 + np.pi) * law.shear_yield_stress)
    assert 0.99 < outcome.value.reached < outcome.value.attempted < 1.015


def test_the_section_of_plane_strain_is_between_those_of_von_mises_and_tresca() -> None:
    """A wall under pressure: it widens the less, the more shear stress it bears."""
    curve = Voce(yield_stress=YIELD, modulus=2000.0)

    def widened(law: Any) -> float:
        body = press("plane_strain", 0.95 * CYLINDER.pressure, 0.3, 8, 4, material=law)
        return float(np.linalg.norm(body.displacement("ring", "loaded"), axis=0).max())

    laws = [Chaboche(elasticity=STEEL, curve=curve)]
    laws += [SmoothMaterial(elasticity=STEEL, curve=curve, surface=Hosford(a)) for a in (2, 8, 40)]
    laws += [TrescaMaterial(elasticity=STEEL, curve=curve)]
    mises, two, eight, forty, tresca = map(widened, laws)
    assert two == pytest.approx(mises, rel=1e-9)
    assert 1.02 * mises < eight < forty < tresca
    assert tresca - forty < 0.2 * (tresca - mises)


def bent_bar() -> Any:
    """A bar that is bent and pulled: its flow lies between shear and tension."""
    law = SmoothMaterial(
        elasticity=STEEL, curve=Voce(yield_stress=YIELD, modulus=2000.0), surface=Hosford(8.0)
    )
    bar = Body(
        name="bar", mesh=grid(np.linspace(0.0, 4.0, 9), np.linspace(0.0, 1.0, 5)), material=law,
        kinematics="plane_stress", supports={"left": "xy"},
        pressure={"top": 12.0, "right": -200.0},
    )  # fmt: skip
    return solve(Model(bodies=(bar,)), control=PathControl(load_step=0.2))


def along_the_deviator(find: Any) -> Any:
    """A tenth of the mistake of one who returns as von Mises does: flow is not normal."""

    def returned(surface: Any, trial: Any, before: Any, G: float, curve: Any) -> Returned:
        found = find(surface, trial, before, G, curve)
        s = trial - trial.mean(axis=0)
        left = curve.flow_stress(before + found.growth) / surface.of_principal(trial)
        return found._replace(flow=0.9 * found.flow + 0.1 * (1 - left) * s / (2 * G))

    return returned


def slack(find: Any) -> Any:
    """A hundredth of the multiplier is lost."""

    def returned(*given: Any) -> Returned:
        found = find(*given)
        return found._replace(growth=0.99 * found.growth)

    return returned


@pytest.mark.parametrize("mistake", [None, along_the_deviator, slack])
def test_the_audit_finds_a_flow_that_is_not_that_of_the_surface(
    mistake: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    if mistake is not None:
        monkeypatch.setattr(SmoothSurface, "returned", mistake(SmoothSurface.returned))
    report = bent_bar().audit()
    assert report.passed == (mistake is None)
    assert any("law" in text for text in report.violations) == (mistake is not None)
