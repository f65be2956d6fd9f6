"""Round walls under pressure, heat and interference, against references of their own.

The bodies are axisymmetric, x is the radius; supports hold their length.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from solver import (
    Amplitude,
    Body,
    ContactPair,
    Material,
    Model,
    PathControl,
    Program,
    Stage,
    System,
    Temperature,
    Walker,
    solve,
)
from solver.loading.program import Control, Lap
from solver.mesh import grid
from tests.reference.autofrettage import PlasticTube, Steel
from tests.reference.bar import ConstrainedBar
from tests.reference.tube import PressFit, Tube

E, NU, RE = 2.0e5, 0.3, 400.0
ELASTIC = Material(youngs_modulus=E, poisson_ratio=NU)
FIXED = {"bottom": "y", "top": "y"}
ALPHA = 1.2e-5


def wall(name: str, radii: Any, material: Any = ELASTIC, **own: Any) -> Body:
    own = {"supports": FIXED} | own
    mesh = grid(np.asarray(radii), np.array([0.0, 1.0]))
    return Body(name=name, mesh=mesh, material=material, kinematics="axisymmetric", **own)


def principal(solution: Any, name: str, stage: str) -> tuple[np.ndarray, np.ndarray]:
    """Return radii (n,), and radial, hoop and axial stress (3, n), at the points."""
    system = solution.system
    converged = getattr(solution, stage)
    return system.positions(name)[0], system.state(name, converged).stress[[0, 2, 1]]


def test_a_steady_flow_of_heat_stresses_a_tube_as_the_closed_form() -> None:
    tube = Tube(inner=1.0, outer=3.0, youngs_modulus=E, poisson_ratio=NU)
    heat = Temperature(rise=lambda x: tube.temperature(x[0], 80.0, 0.0), expansion=ALPHA)
    found = solve(Model(bodies=(wall("tube", np.geomspace(1.0, 3.0, 25), loads=(heat,)),)))
    r, stress = principal(found, "tube", "loaded")
    exact = tube.heated(r, 80.0, 0.0, ALPHA)
    assert stress[:2] == pytest.approx(exact[:2], abs=2e-3 * np.abs(exact).max())
    assert found.audit().passed, found.audit().violations


def test_a_press_fit_of_equal_lengths_has_the_pressure_of_lame() -> None:
    shaft = wall("shaft", np.linspace(0.0, 10.0, 9))
    hub = wall("hub", np.geomspace(10.0, 30.0, 17))
    pair = ContactPair(slave=("hub", "left"), master=("shaft", "right"), interference=0.01)
    found = solve(Model(bodies=(shaft, hub), contacts=(pair,)))
    inner, outer = (
        Tube(inner=a, outer=b, youngs_modulus=E, poisson_ratio=NU)
        for a, b in ((0.0, 10.0), (10.0, 30.0))
    )
    fit = PressFit(shaft=inner, hub=outer, interference=0.01)
    pressure = found.contact().pressure
    assert pressure == pytest.approx(fit.pressure, rel=2e-3)
    r, stress = principal(found, "hub", "loaded")
    assert stress[1] == pytest.approx(fit.hub_stress(r)[1], rel=5e-3)
    assert found.audit().passed, found.audit().violations
    assert np.abs(found.stress("hub")).max() < 1e-6


def test_bodies_apart_come_together_by_as_much_as_they_stand_apart() -> None:
    shaft, hub = wall("shaft", np.linspace(0.0, 10.0, 5)), wall("hub", np.linspace(10.0, 30.0, 9))

    def pressure(**own: Any) -> float:
        pair = ContactPair(slave=("hub", "left"), master=("shaft", "right"), **own)
        found = solve(Model(bodies=(shaft, hub), contacts=(pair,)))
        assert found.audit().passed, found.audit().violations
        return float(found.contact().pressure.max())

    half = pressure(interference=0.005)
    assert pressure(interference=0.01, gap=0.005) == pytest.approx(half, rel=1e-9)
    assert pressure(interference=0.005, gap=0.006) == 0.0


def test_a_fit_that_yields_is_no_limit_load_however_it_comes() -> None:
    steel = Material(youngs_modulus=E, poisson_ratio=NU, yield_stress=RE)
    shaft, hub = (
        wall("shaft", np.linspace(0.0, 10.0, 5)),
        wall("hub", np.geomspace(10.0, 20.0, 9), steel),
    )
    pair = ContactPair(slave=("hub", "left"), master=("shaft", "right"), interference=0.06)
    model = Model(bodies=(shaft, hub), contacts=(pair,))
    found = [solve(model, control=PathControl(load_step=1 / n)) for n in (1, 20)]
    both = [each.contact().pressure.max() for each in found]
    assert found[0].plastic_strain("hub").max() > 1e-3
    assert both[0] == pytest.approx(both[1], rel=2e-3)
    assert found[1].audit().passed, found[1].audit().violations


@pytest.mark.parametrize("hardening", ["none", "kinematic", "isotropic"])
def test_autofrettage_leaves_the_stress_of_a_tube_that_yields_back(hardening: Any) -> None:
    pressure = 0.95 * 2 * RE / np.sqrt(3) * np.log(3.0)
    ratio = 0.0 if hardening == "none" else 0.024
    material = Material(youngs_modulus=E, poisson_ratio=NU, yield_stress=RE, hardening=hardening,
                        hardening_ratio=ratio)  # fmt: skip
    tube = wall("tube", np.geomspace(1.0, 3.0, 41), material, pressure={"left": pressure})
    found = solve(Model(bodies=(tube,)), control=PathControl(load_step=1 / 40, unload_steps=40))
    steel = Steel(youngs_modulus=E, poisson_ratio=NU, yield_stress=RE, tangent_modulus=ratio * E,
                  kinematic_share=float(hardening != "isotropic"))  # fmt: skip
    reference = PlasticTube(inner=1.0, outer=3.0, steel=steel, elements=200)
    for stage, exact in zip(
        ("loaded", "unloaded"),
        reference.history([(pressure, 0.0), (0.0, 0.0)], steps=40), strict=True,
    ):  # fmt: skip
        r, stress = principal(found, "tube", stage)
        for mine, its in zip(stress, exact.stress, strict=True):
            assert mine == pytest.approx(np.interp(r, exact.r, its), abs=0.005 * RE)
    # the bore yields again when the pressure goes: without that its hoop stress would be lower
    loaded, unloaded = (c.responses[0].state.accumulated for c in (found.loaded, found.unloaded))
    assert (unloaded - loaded)[found.system.positions("tube")[0] < 1.02].min() > 1e-5
    assert found.audit().passed, found.audit().violations


def test_a_held_bar_follows_cycles_of_heat() -> None:
    turns = [300.0, -150.0, 300.0, 0.0]
    steel = Material(youngs_modulus=E, poisson_ratio=NU, yield_stress=RE, hardening="kinematic",
                     hardening_ratio=0.05)  # fmt: skip
    course = Amplitude(np.arange(5.0), np.array([0.0, *turns]))
    bar = Body(
        name="bar", mesh=grid(np.linspace(0.0, 4.0, 3), np.linspace(0.0, 1.0, 2)), material=steel,
        kinematics="plane_stress", supports={"left": "x", "right": "x", "bottom": "y"},
        loads=(Temperature(rise=1.0, expansion=ALPHA, amplitude=course),),
    )  # fmt: skip
    stages = tuple(Stage(name=f"turn {k}", target=k + 1.0, steps=3) for k in range(4))
    (outcome,) = Walker(System(Model(bodies=(bar,))), Control()).walk(
        [Program(laps=(Lap(stages),))]
    )
    exact = ConstrainedBar(
        youngs_modulus=E, expansion=ALPHA, yield_stress=RE, tangent_modulus=0.05 * E
    )
    for k, stress in enumerate(exact.stresses(turns)):
        assert outcome.points[f"turn {k}"].responses[0].stress[0] == pytest.approx(stress, rel=1e-6)
