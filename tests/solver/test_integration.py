"""The error that the length of increments makes: estimated, kept small, limited."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

from solver import (
    Amplitude,
    Body,
    ContactPair,
    Link,
    Material,
    Model,
    PathControl,
    Solution,
    Stage,
    solve,
)
from solver.materials import ArmstrongFrederick, Chaboche, Elasticity, Law, Layered
from solver.materials.curves import Voce
from solver.mesh import grid
from solver.model.loads import Displacement, Load, Temperature, Traction
from solver.model.rigid import RigidBody, RigidSurface
from tests.solver.back_stress_rules import BurletCailletaud, OhnoWang, Plain, Threshold

ELASTIC = Elasticity(youngs_modulus=2e5, poisson_ratio=0.3)
PLAIN = Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=300.0)
LINEAR = replace(PLAIN, yield_stress=200.0, hardening="kinematic", hardening_ratio=0.024)
pytestmark = [pytest.mark.solves, pytest.mark.divides]
GIVEN = PathControl(increment_error=np.inf)
"""Takes increments as they are given."""


def bar(material: Law, *loads: Load, kinematics: str = "plane_stress") -> Model:
    """Return one element that is pulled along y, its lower side held along y."""
    body = Body(
        name="bar",
        mesh=grid(np.array([0.0, 1.0]), np.array([0.0, 1.0])),
        material=material,
        kinematics=kinematics,
        supports={"bottom": "xy"} if kinematics == "plane_strain" else {"left": "x", "bottom": "y"},
        loads=loads,
    )
    return Model(bodies=(body,))


def sheared(steps: int, control: PathControl | None = None) -> Solution:
    """Return an element that is stretched into plastic flow, and then sheared."""
    stretched = Amplitude([0, 1], [0, 1])
    loads = (
        Displacement(boundary="top", y=4e-3, amplitude=stretched),
        Displacement(boundary="top", x=1e-2, amplitude=Amplitude([1, 2], [0, 1])),
    )
    stages = (Stage(name="up", target=1.0, steps=steps), Stage(name="on", target=2.0, steps=steps))
    return solve(bar(PLAIN, *loads, kinematics="plane_strain"), stages=stages, control=control)


def stress(found: Solution) -> np.ndarray:
    """Return the Mandel stress of the bar at its end."""
    return found.system.state("bar", found.stages["on"]).stress


def test_the_estimate_is_of_the_size_of_the_error_and_falls_with_the_increments():
    wanted = stress(sheared(160, GIVEN))
    figures, errors = [], []
    for steps in (2, 4, 8):
        found = sheared(steps, GIVEN)
        figures.append(found.audit("on").figures["audit_increment_error"])
        off = stress(found) - wanted
        errors.append(np.sqrt(1.5 * (off**2).sum(axis=0).mean()) / PLAIN.yield_stress)
    ratios = np.array(figures) / errors
    assert (ratios > 0.5).all() and (ratios < 1.5).all()
    assert figures[0] > figures[1] > figures[2] > 0


def test_increments_too_long_for_the_turn_of_the_flow_are_divided_or_fail_the_audit():
    wanted = stress(sheared(160, GIVEN))
    given, divided = sheared(1, GIVEN), sheared(1)
    assert len(given.tally.iterations) == 2 < len(divided.tally.iterations)
    off = [np.abs(stress(each) - wanted).max() for each in (given, divided)]
    assert off[0] > 0.1 * PLAIN.yield_stress > 0.04 * PLAIN.yield_stress > off[1]
    assert "audit_increment_error" in given.audit("on").violations[0]
    assert divided.audit("on").passed


def test_proportional_flow_is_exact_in_one_increment_and_is_not_divided():
    load = Displacement(boundary="top", x=6e-3, y=0.0, amplitude=Amplitude([0, 1], [0, 1]))
    (body,) = bar(LINEAR, load, kinematics="plane_strain").bodies
    model = Model(bodies=(replace(body, element="quad4"),))  # it has no nodes on the free sides
    found = solve(model, stages=(Stage(name="up", target=1.0),))
    assert len(found.tally.iterations) == 1
    assert found.audit("up").figures["audit_increment_error"] < 1e-12


def test_first_flow_in_one_increment_has_the_error_of_a_path_that_turns():
    """The free sides of a sheared element move as it flows: its strain turns from the first on."""
    load = Displacement(boundary="top", x=6e-3, y=0.0, amplitude=Amplitude([0, 1], [0, 1]))
    model = bar(LINEAR, load, kinematics="plane_strain")
    fine, one, divided = (
        solve(model, stages=(Stage(name="up", target=1.0, steps=steps),), control=control)
        for steps, control in ((160, GIVEN), (1, GIVEN), (1, None))
    )
    wanted = fine.system.state("bar", fine.stages["up"]).stress
    errors = []
    for each in (one, divided):
        off = each.system.state("bar", each.stages["up"]).stress - wanted
        errors.append(np.sqrt(1.5 * (off**2).sum(axis=0).mean()) / LINEAR.yield_stress)
        figure = each.audit("up").figures["audit_increment_error"]
        assert 0.4 < figure / errors[-1] < 1.5
    assert len(one.tally.iterations) == 1 and errors[0] > 0.05
    assert errors[1] < 0.02


KINK = 40.0
RULES: dict[str, Any] = {
    "armstrong frederick": Plain(50_000.0, 300.0),
    "burlet cailletaud": BurletCailletaud(50_000.0, 300.0, 0.1),
    "ohno wang": OhnoWang(50_000.0, 160.0),
    "threshold": Threshold(50_000.0, 400.0, KINK),
}
NORMAL = np.array([[-0.5], [1.0], [-0.5], [0.0]])


def flow(rule: Any, start: float, end: float) -> float:
    """Return the plastic strain in tension over which a back stress goes from start to end."""

    def slope(X: float) -> float:
        return float(rule.modulus - (rule.recalled(2 / 3 * X * NORMAL, NORMAL) * NORMAL).sum())

    ways = pairwise([start, -KINK, KINK, end])
    return sum(quad(lambda X: 1 / slope(X), *way)[0] for way in ways)


@pytest.mark.parametrize(
    ("name", "steps"), [*((name, 1) for name in RULES), ("armstrong frederick", 5)]
)
def test_a_bar_ratchets_by_the_integrated_rate_in_any_number_of_increments(name: str, steps: int):
    """Back stress goes between Re above the lower and Re below the higher stress."""
    Re, high, low = 200.0, 320.0, -280.0
    rule = RULES[name]
    own = ArmstrongFrederick(rule.modulus, rule.recall) if type(rule) is Plain else rule
    law = Chaboche(elasticity=ELASTIC, curve=Voce(yield_stress=Re), back_stresses=(own,))
    times = np.arange(4)
    cycled = Amplitude(times, [0, high, low, high])
    stages = [Stage(name=f"{k}", target=float(k), steps=steps) for k in (1, 2, 3)]
    load = Traction(boundary="top", y=1.0, amplitude=cycled)
    found = solve(bar(law, load, kinematics="axisymmetric"), stages=stages)
    strains = [found.displacement("bar", stage)[1].max() for stage in ("1", "3")]
    wanted = flow(rule, low + Re, high - Re) - flow(rule, Re - high, -Re - low)
    assert found.audit("3").passed
    error = 1e-3 if type(rule) is Plain else 0.02  # the package's own rule is exact along the flow
    assert strains[1] - strains[0] == pytest.approx(wanted, rel=error)


TWO = Chaboche(
    elasticity=ELASTIC,
    curve=Voce(yield_stress=200.0),
    back_stresses=(ArmstrongFrederick(60_000.0, 600.0), ArmstrongFrederick(20_000.0, 200.0)),
)
LAYERS = Layered.of_curve(
    ELASTIC, strain=(0.001, 0.003, 0.01), stress=(200.0, 280.0, 340.0), slope=2000.0
)


@pytest.mark.parametrize("law", [TWO, LAYERS], ids=["fading", "layered"])
def test_tension_with_cyclic_shear_ratchets_as_with_many_increments(law: Law):
    times = np.arange(5)
    pulled = Amplitude(times, np.minimum(times, 1.0))
    cycled = Amplitude(times, [0, 0, 1, -1, 1])
    sides = ("top", "x", 1), ("bottom", "x", -1), ("right", "y", 1), ("left", "y", -1)
    body = Body(
        name="bar",
        mesh=grid(np.array([0.0, 1.0]), np.array([0.0, 1.0])),
        material=law,
        kinematics="plane_stress",
        supports={"bottom": "y"},
        loads=(
            Traction(boundary="top", y=100.0, amplitude=pulled),
            *(
                Traction(boundary=side, amplitude=cycled, **{axis: sign * 130.0})
                for side, axis, sign in sides
            ),
        ),
    )
    spring = Link(slave=("bar", "bottom"), components="x", stiffness=1e-2)

    def ratchet(steps: int, control: PathControl | None = None) -> float:
        stages = [Stage(name=f"{k}", target=float(k), steps=steps) for k in times[1:]]
        found = solve(Model(bodies=(body,), links=(spring,)), stages=stages, control=control)
        return float(np.diff([found.displacement("bar", k)[1].max() for k in "24"])[0])

    assert ratchet(1) == pytest.approx(ratchet(30, GIVEN), rel=0.02)


@pytest.mark.parametrize("law", [LINEAR, replace(LINEAR, hardening="isotropic")])
def test_shear_after_tension_under_given_stress_is_right_to_three_percent(law: Material):
    """Strain under given stress shows errors of stress, over a slope of 2 % of Young's modulus."""
    loads = (
        Traction(boundary="top", y=220.0, amplitude=Amplitude([0, 1], [0, 1])),
        *(
            Traction(boundary=boundary, amplitude=Amplitude([1, 2], [0, 1]), **{axis: sign * 80.0})
            for boundary, axis, sign in (("top", "x", 1), ("right", "y", 1), ("bottom", "x", -1))
        ),
    )

    def shear(steps: int, control: PathControl | None = None) -> float:
        stages = (Stage(name="up", target=1.0), Stage(name="on", target=2.0, steps=steps))
        model = bar(law, *loads)
        found = solve(model, stages=stages, control=control)
        return float(np.ptp(found.displacement("bar", "on")[0]))

    wanted = shear(160, GIVEN)
    assert abs(shear(2, GIVEN) / wanted - 1) > 0.04
    assert shear(2) == pytest.approx(wanted, rel=0.03)


def test_a_heated_block_between_plates_has_the_force_of_many_increments_with_one():
    block = Body(
        name="block",
        mesh=grid(np.linspace(-4, 4, 10), np.linspace(0, 5, 7)),
        material=replace(PLAIN, yield_stress=400.0, hardening="isotropic", hardening_ratio=0.02),
        kinematics="plane_stress",
        loads=(
            Temperature(rise=200.0, expansion=1.2e-5, amplitude=Amplitude([0, 1, 2], [0, 1, 0.3])),
        ),
    )
    plates = tuple(
        RigidBody(
            name=name,
            surfaces={"face": RigidSurface(points=np.array([[-x, x], [y, y]]))},
            centre=(0.0, y),
        )
        for name, x, y in (("top", 6.0, 5.0), ("bottom", -6.0, 0.0))
    )
    pairs = tuple(
        ContactPair(slave=("block", side), master=(side, "face"), friction=1.0)
        for side in ("top", "bottom")
    )
    model = Model(bodies=(block,), rigid=plates, contacts=pairs)

    def force(steps: int, control: PathControl | None = None) -> float:
        stages = [
            Stage(name=name, target=t, steps=steps) for name, t in (("hot", 1.0), ("cold", 2.0))
        ]
        state = solve(model, stages=stages, control=control).stages["cold"].state
        return float(state.contacts[0].normal.sum())

    wanted = force(40, GIVEN)
    assert force(2, GIVEN) < 0.98 * wanted
    assert force(1) == pytest.approx(wanted, rel=0.01)
