"""Hertz point contact: a stiff ball, held by contact alone, deep in a soft half-space."""

from __future__ import annotations

import numpy as np
import pytest

from solver import Body, ContactPair, Material, Model, Solution, solve
from solver.loading.program import PathControl
from solver.mesh import graded, grid, mapped
from solver.results.contact import (
    CONTACT_PRESSURE,
    CONTACT_PRESSURE_DEFORMED,
    CONTACT_X,
    contacts,
)
from tests.verification.closed_forms import plane_strain_modulus

RADIUS = 10.0
SIZE = 40.0
"""Width and height of both bodies [mm]."""
BALL = Material(youngs_modulus=2e6, poisson_ratio=0.3)
SPACE = Material(youngs_modulus=2e5, poisson_ratio=0.0)
"""Without lateral contraction its surface shrinks by p / E in both directions of the plane."""
MODULUS = 1 / sum(1 / plane_strain_modulus(m.youngs_modulus, m.poisson_ratio)
                  for m in (BALL, SPACE))  # fmt: skip


def press(slave: str, radius: float, sliding: str = "auto") -> Solution:
    """Press the ball with the force that gives Hertz's contact radius ``radius`` [mm]."""
    force = 4 * MODULUS * radius**3 / (3 * RADIUS)  # K.L. Johnson (1985), eq. 4.22
    h = radius / 10
    fine = np.arange(0.0, 1.5 * radius + h / 2, h)
    x = np.concatenate([fine, fine[-1] + graded(SIZE - fine[-1], h, 1.3, 4.0)[1:]])
    depth = np.concatenate([fine[:5], fine[5] + graded(SIZE - fine[5], h, 1.3, 4.0)])
    # vertices of the two surfaces must not meet
    other = np.interp(np.linspace(0, 1, round(1.3 * len(x))), np.linspace(0, 1, len(x)), x)

    def bulge(p: np.ndarray) -> np.ndarray:
        profile = np.minimum(p[0] ** 2 / (2 * RADIUS), 5.0)
        return np.stack([p[0], profile + p[1] * (SIZE - profile) / SIZE])

    ball = Body(
        name="ball", material=BALL, kinematics="axisymmetric", supports={"left": "x"},
        mesh=mapped(grid(x if slave == "ball" else other, depth), bulge),
        pressure={"top": force / (np.pi * SIZE**2)},
    )  # fmt: skip
    space = Body(
        name="space", material=SPACE, kinematics="axisymmetric",
        mesh=grid(other if slave == "ball" else x, -depth[::-1]),
        supports={"left": "x", "bottom": "y"},
    )  # fmt: skip
    sides = {"ball": ("ball", "bottom"), "space": ("space", "top")}
    master = sides["space" if slave == "ball" else "ball"]
    pair = ContactPair(slave=sides[slave], master=master, sliding=sliding)
    model = Model(bodies=(ball, space), contacts=(pair,))
    return solve(model, control=PathControl(load_step=0.25))


def peak_over_hertz(solution: Solution, radius: float) -> float:
    """Return the pressure at the axis / Hertz's, 2 E* a / (pi R): Johnson, eq. 4.24."""
    acting = solution.contact()
    x, pressure = acting.X, acting.pressure_deformed
    return float(pressure[x[0].argmin()]) / (2 * MODULUS * radius / (np.pi * RADIUS))


def test_the_pressure_of_a_deep_contact_does_not_depend_on_which_body_is_the_slave() -> None:
    """At p0 = 0.058 E the soft surface shrinks under the ball; the area is what both share.

    Measured 1.0488 and 1.0499 of Hertz, who takes the undeformed area; 1.0448 and 0.9980 over the
    undeformed areas of the slaves.
    """
    found = {slave: press(slave, 1.0) for slave in ("ball", "space")}
    peaks = {slave: peak_over_hertz(solution, 1.0) for slave, solution in found.items()}
    assert peaks["ball"] == pytest.approx(peaks["space"], rel=5e-3)
    assert peaks["space"] == pytest.approx(1.0, abs=0.06)
    for solution in found.values():
        assert solution.audit().passed, solution.audit().violations
    (soft,) = found["space"].system.interfaces
    at = found["space"].contact().X[0].argmin()
    pairing = soft.pairing(found["space"].loaded.state.u)
    assert pairing.deformed[at] / pairing.area[at] < 0.96  # the areas do differ


def test_a_shallow_contact_has_the_pressure_of_hertz_from_either_side() -> None:
    """What a deep contact differs from Hertz falls with the depth, to a quarter here."""
    for slave in ("ball", "space"):
        peak = peak_over_hertz(press(slave, 0.25), 0.25)
        assert peak == pytest.approx(1.0, abs=0.02)


def test_small_sliding_keeps_the_area_before_loading() -> None:
    solution = press("space", 1.0, sliding="small")
    (interface,) = solution.system.interfaces
    pairing = interface.pairing(solution.loaded.state.u)
    assert pairing.area.any()
    assert (pairing.deformed == pairing.area).all()


def test_the_resultant_of_the_pressure_is_the_force_on_the_deformed_area() -> None:
    solution = press("space", 1.0)
    (interface,) = solution.system.interfaces
    pressure = solution.contact().pressure_deformed
    area = interface.pairing(solution.loaded.state.u).deformed
    force = solution.loaded.state.contacts[0].normal.sum()
    assert pressure @ area == pytest.approx(force, rel=1e-9)


def test_pressure_and_stress_of_a_deep_contact_mean_the_same() -> None:
    """The pressure balances the stress under it, recovered at the pole to 1 %; both are Hertz's."""
    solution = press("space", 1.0)
    acting = solution.contact()
    x, pressure = acting.X, acting.pressure
    pole = float(pressure[x[0].argmin()])
    below = solution.at("space", [[0.0], [0.0]], "loaded")["stress"][1, 0]
    assert -below == pytest.approx(pole, rel=0.01)
    assert pole == pytest.approx(2 * MODULUS / (np.pi * RADIUS), rel=0.01)
    shared = acting.pressure_deformed[x[0].argmin()]
    assert shared > 1.04 * pole
    stored = contacts([[acting]], ["c"], samples=11)
    at = stored[CONTACT_X][0].argmin()
    for variable, value in ((CONTACT_PRESSURE, pole), (CONTACT_PRESSURE_DEFORMED, shared)):
        (values,) = (found for key, found in stored.items() if key.name == variable.name)
        assert values[0, 0, at] == pytest.approx(value, rel=1e-9)
