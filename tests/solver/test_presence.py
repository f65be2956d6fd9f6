"""Pairs that come and leave: forces, the state they leave behind, balance and energy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver import (
    Amplitude,
    Body,
    ContactPair,
    Material,
    Model,
    ModelError,
    Moved,
    PathControl,
    Pressure,
    Pushed,
    RigidBody,
    Stage,
    System,
    solve,
)
from solver.loading.checks import check_freed
from solver.mesh import grid
from solver.model.rigid import arc
from solver.rolling.scenes.rolling import ROLLING

pytestmark = pytest.mark.solves

PLATE = Material(
    youngs_modulus=2e5,
    poisson_ratio=0.3,
    yield_stress=300.0,
    hardening="isotropic",
    hardening_ratio=0.02,
)
MANDREL = Material(youngs_modulus=6e5, poisson_ratio=0.3)
RISE = Amplitude([0, 1], [0, 1])
IN, OUT = (
    Stage(name="in", target=1.0, steps=4),
    Stage(name="out", target=2.0, steps=4, turns=True),
)


def expanded(**pair):
    """A hole of radius 5 mm that a mandrel widens far into the plastic range."""
    y, held = np.linspace(0.0, 1.0, 3), {"bottom": "y", "top": "y"}
    plate = Body(name="plate", mesh=grid(np.geomspace(5.0, 25.0, 15), y), material=PLATE,
                 kinematics="axisymmetric", supports=held)  # fmt: skip
    pin = Body(name="pin", mesh=grid(np.linspace(1.0, 5.0, 5), y), material=MANDREL,
               kinematics="axisymmetric", supports=held)  # fmt: skip
    contact = ContactPair(slave=("plate", "left"), master=("pin", "right"), friction=0.1,
                          interference=0.06, amplitude=RISE, **pair)  # fmt: skip
    return Model(bodies=(plate, pin), contacts=(contact,))


def test_a_pair_that_leaves_leaves_the_state_of_bodies_that_are_separated():
    """Nothing yields on the way back: the way to the state without contact does not matter."""
    half = replace(OUT, name="half", target=1.5, steps=2)
    stages = (IN, half, replace(OUT, steps=2, turns=False))
    given = PathControl(increment_error=np.inf)
    found = solve(expanded(presence=Amplitude([1, 2], [1, 0])), stages=stages, control=given)
    parted = solve(expanded(), stages=(IN, replace(OUT, apart=True)), control=given)
    stress, reference = (each.stress("plate", "out") for each in (found, parted))
    assert np.abs(reference).max() > 200.0
    np.testing.assert_allclose(stress, reference, atol=1e-8)
    force = np.array([increment.contact[0][0] for increment in found.history])
    np.testing.assert_allclose(force[-5:], force[-5] * np.linspace(1, 0, 5), atol=1e-9)
    contact = found.contact(stage="out")
    assert np.isnan(contact.gap).all()
    assert not contact.pressure.any()
    for stage in ("in", "half", "out"):
        check = found.audit(stage)
        assert check.passed, check.violations
        assert check.figures["audit_energy"] < 1e-9


def test_a_tool_passes_through_before_it_comes_and_its_forces_follow_the_surface():
    """Under finite sliding it presses as it does alone; then it leaves, out of balance by nothing.

    The first two stages would press it 1 mm deep.
    """
    x = np.linspace(0.0, 6.0, 13)
    block = Body(name="block", mesh=grid(x, x - 6.0), material=PLATE,
                 supports={"left": "x", "bottom": "xy"})  # fmt: skip
    way = Amplitude([0, 1, 2, 3, 4], [0.0, -1.0, 0.0, -0.05, -0.05])

    def tool(position, presence=None):
        around = arc((0.0, 8.0), 8.0, (-np.pi / 2 - 0.2, -np.pi / 2 + 0.4), 48)
        roller = RigidBody(name="roller", surfaces={"face": around}, centre=(0.0, 8.0),
                           y=Moved(value=1.0, amplitude=position))  # fmt: skip
        pair = ContactPair(slave=("block", "top"), master=("roller", "face"), friction=0.2,
                           sliding="finite", presence=presence)  # fmt: skip
        return Model(bodies=(block,), rigid=(roller,), contacts=(pair,))

    press = Stage(name="press", target=3.0, steps=4)
    given = PathControl(increment_error=np.inf)
    rest = Stage(name="rest", target=2.0)
    alone = solve(tool(Amplitude([2, 3], [0, -0.05])), stages=(rest, press), control=given)
    through, back = Stage(name="through", target=1.0, steps=2), Stage(name="back", target=2.0)
    stages = (through, back, press, Stage(name="gone", target=4.0, steps=3))
    there = Amplitude([2, 3, 4], [0, 1, 0])
    found = solve(tool(way, there), stages=stages, control=given)
    assert not found.stages["through"].contact_forces[0].any()
    ours, own = (each.reaction("roller", "press")[1] for each in (found, alone))
    assert ours == pytest.approx(own, rel=1e-9)
    force = np.array([increment.contact[0][0] for increment in found.history])[-4:]
    np.testing.assert_allclose(force, force[0] * np.array([1, 2 / 3, 1 / 3, 0]), atol=1e-9)
    for stage in ("press", "gone"):
        check = found.audit(stage)
        assert check.passed, check.violations


PRESSED, GONE = Stage(name="pressed", steps=3, target=1.0), Stage(name="gone", steps=3, target=2.0)
ELASTIC, FORCE = Material(youngs_modulus=5e4, poisson_ratio=0.3), 5000.0


def pushed(force, presence=None):
    """An elastic block, and a roller that a force pushes on it, by its factors over time."""
    x = np.linspace(0.0, 6.0, 13)
    block = Body(name="block", mesh=grid(x, x - 6.0), material=ELASTIC,
                 supports={"left": "x", "bottom": "xy"})  # fmt: skip
    around = arc((2.0, 8.0), 8.0, (-np.pi / 2 - 0.2, -np.pi / 2 + 0.4), 48)
    roller = RigidBody(name="roller", surfaces={"face": around}, centre=(2.0, 8.0),
                       y=Pushed(value=-FORCE, amplitude=force))  # fmt: skip
    pair = ContactPair(slave=("block", "top"), master=("roller", "face"), friction=0.2,
                       sliding="finite", presence=presence)  # fmt: skip
    return Model(bodies=(block,), rigid=(roller,), contacts=(pair,))


FALLS = Amplitude([0, 1, 2], [0, 1, 0]), Amplitude([0, 1, 1.2, 1.6, 2], [0, 1, 1.1, 0.3, 0])


@pytest.mark.parametrize("falls", FALLS)
def test_a_tool_that_a_force_pushes_stays_where_it_is_while_its_pair_leaves(falls):
    """However its force falls: forces of the pair are given, and nothing else holds the tool."""
    stages = (PRESSED, GONE)
    found = solve(pushed(falls, Amplitude([1, 2], [1, 0])), stages=stages)
    assert found.reaction("roller", "pressed")[1] == pytest.approx(-FORCE, rel=1e-6)
    before, after = (found.motion("roller", stage) for stage in ("pressed", "gone"))
    assert before.y < -0.003
    assert after == before
    force = np.array([increment.contact[0][0] for increment in found.history])[-4:]
    np.testing.assert_allclose(force, force[0] * np.array([1, 2 / 3, 1 / 3, 0]), atol=1e-9)
    assert np.abs(found.stress("block", "pressed")).max() > 300.0
    assert np.abs(found.stress("block", "gone")).max() < 1e-6
    for stage in ("pressed", "gone"):
        check = found.audit(stage)
        assert check.passed, check.violations


def test_a_body_of_elements_stays_where_it_is_while_its_pair_leaves():
    """Its pressure falls later than the forces of the pair, which follow turned surfaces."""
    x = np.linspace(0.0, 4.0, 5)
    falls = Amplitude([0, 1, 1.5, 2], [0, 1, 0.8, 0])
    upper = Body(name="upper", mesh=grid(x, x / 2), material=PLATE, supports={"left": "x"},
                 loads=(Pressure(boundary="top", value=280.0, amplitude=falls),))  # fmt: skip
    lower = Body(name="lower", mesh=grid(2 * x, x / 2 - 2), material=PLATE,
                 supports={"bottom": "xy"})  # fmt: skip
    pair = ContactPair(slave=("upper", "bottom"), master=("lower", "top"), friction=0.1,
                       sliding="finite", presence=Amplitude([1, 2], [1, 0]))  # fmt: skip
    found = solve(Model(bodies=(upper, lower), contacts=(pair,)), stages=(PRESSED, GONE))
    way = [found.at("upper", [[2.0], [1.0]], stage)["displacement"][1, 0]
           for stage in ("pressed", "gone")]  # fmt: skip
    assert -0.01 < way[0] < way[1] < 0.0
    check = found.audit("gone")
    assert check.passed, check.violations


def test_a_force_on_a_tool_that_nothing_holds_any_more_is_refused():
    allowed = r"'roller' is free to move along y at load factor 2, .* between block.top and roller"
    with pytest.raises(ModelError, match=allowed):
        solve(pushed(RISE, Amplitude([1, 2], [1, 0])), stages=(PRESSED, GONE))
    with pytest.raises(ModelError, match=r"'roller' is free .* bodies are separated"):
        solve(pushed(RISE), stages=(PRESSED, replace(GONE, apart=True)))


def test_a_load_on_a_lifted_wheel_is_refused():
    p = ROLLING.parameters(track=10.0, element_size=4.0, advance_step=2.0, press_steps=4)
    model, program = ROLLING.model(p), ROLLING.program(p)
    check_freed(System(model), program)
    wheel = model.body("wheel")
    heavy = replace(wheel, axle=replace(wheel.axle, force=Amplitude([0, 1], [1e3, 1e3])))
    bodies = tuple(heavy if body is wheel else body for body in model.bodies)
    with pytest.raises(ModelError, match=r"'wheel' is free to move along y .* separated"):
        check_freed(System(replace(model, bodies=bodies)), program)


def test_a_presence_below_zero_is_refused():
    with pytest.raises(ModelError, match="presence"):
        expanded(presence=Amplitude([0, 1], [1, -1]))


@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_bodies_that_were_separated_meet_again_where_they_are(friction):
    """The upper block has sprung back: to close its gap is work that its pressure does."""
    x = np.linspace(0.0, 4.0, 5)
    there = Amplitude([0, 1, 2, 3, 4], [0, 1, 0, 1, 0])
    upper = Body(name="upper", mesh=grid(x, x / 2), material=PLATE, supports={"left": "x"},
                 loads=(Pressure(boundary="top", value=280.0, amplitude=there),))  # fmt: skip
    lower = Body(name="lower", mesh=grid(x, x / 2 - 2), material=PLATE, supports={"bottom": "xy"})
    pair = ContactPair(slave=("upper", "bottom"), master=("lower", "top"), friction=friction)
    stages = [
        Stage(name=name, target=2.0 * k + time, steps=2, apart=name == "free", cycle=k + 1)
        for k in (0, 1)
        for time, name in ((1, "pressed"), (2, "free"))
    ]
    found = solve(Model(bodies=(upper, lower), contacts=(pair,)), stages=stages)
    check = found.audit("pressed")
    assert check.passed, check.violations
    assert check.figures["audit_energy"] < 1e-9
