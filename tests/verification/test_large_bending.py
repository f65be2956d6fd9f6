"""Boundaries that rigid bodies turn by large angles: strips coiled, bent sheets, turned blocks."""

from __future__ import annotations

from typing import Any
from unittest import mock

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_bvp
from scipy.optimize import brentq

from solver import (
    Amplitude,
    Body,
    ContactPair,
    Displacement,
    Link,
    Material,
    Model,
    ModelError,
    Moved,
    PathControl,
    Pushed,
    RigidBody,
    Solution,
    Stage,
    solve,
)
from solver.derivatives.of_models import derive
from solver.fem.discretisation import choose_pins
from solver.mesh import grid
from solver.model.loads import Centrifugal, Load, Pressure, Temperature, Traction
from solver.model.rigid import line
from tests.verification.test_large_bodies import ELASTIC, block

pytestmark = pytest.mark.solves

Array = NDArray[np.float64]
STRIP, THIN = 20.0, 0.2
E = 2e5
TILTED = Link(slave=("b", "right"), rigid="end")


def coiled(rotation: Moved | Pushed, steps: int, link: Link = TILTED) -> Solution:
    """Return a strip clamped at its left end, the right one turned by a rigid body."""
    strip = block((0, STRIP), (-THIN / 2, THIN / 2), (40, 1), element="quad8",
                  kinematics="plane_stress", supports={"left": "xy"},
                  material=Material(youngs_modulus=E, poisson_ratio=0.0))  # fmt: skip
    end = RigidBody(name="end", centre=(STRIP, 0.0), x=Pushed(), y=Pushed(), rotation=rotation)
    model = Model(bodies=(strip,), rigid=(end,), links=(link,))
    bent, released = (
        Stage(name=name, target=target, steps=steps)
        for name, target in (("bent", 1.0), ("released", 0.0))
    )
    return solve(model, stages=[bent, released])


@pytest.mark.parametrize("distributed", [False, True])
@pytest.mark.parametrize("by", ["rotation", "moment"])
def test_a_strip_is_coiled_into_a_circle(by: str, distributed: bool) -> None:
    """Its end is where a circle of the same length ends; the moment is E I angle / length."""
    angle = 3.0
    moment = E * THIN**3 / 12 * angle / STRIP
    rotation = Moved(value=angle) if by == "rotation" else Pushed(value=moment)
    link = Link(slave=("b", "right"), rigid="end", distributed=distributed)
    found = coiled(rotation, 10, link)
    motion = found.motion("end", "bent")
    assert motion.rotation == pytest.approx(angle, rel=1e-3)
    assert found.reaction("end", "bent")[2] == pytest.approx(moment, rel=1e-3)
    radius = STRIP / angle
    assert motion.x == pytest.approx(radius * np.sin(angle) - STRIP, abs=1e-3 * STRIP)
    assert motion.y == pytest.approx(radius * (1 - np.cos(angle)), abs=1e-3 * STRIP)
    audit = found.audit("bent")
    assert audit.passed
    assert not audit.outside
    assert audit.figures["audit_links"] < 1e-9
    assert np.abs(found.displacement("b", "released")).max() < 1e-6 * STRIP
    assert found.audit("released").passed


def test_springs_turn_with_the_body_that_holds_them() -> None:
    """Springs on the turned boundary bear the moment k I sin(angle between body and boundary)."""
    angle, stiffness = 2.0, 1e4
    link = Link(slave=("b", "right"), rigid="end", stiffness=stiffness)
    found = coiled(Moved(value=angle), 10, link)
    second = THIN**3 / 12
    back = brentq(lambda b: E / STRIP * (angle - b) - stiffness * np.sin(b), 0.0, 2.0)
    assert 0.5 < back < 1.5
    moment = found.reaction("end", "bent")[2]
    assert moment == pytest.approx(stiffness * second * np.sin(back), rel=5e-3)
    assert found.audit("bent").passed


# -- a sheet bent beyond yield -------------------------------------------------------------------


THICK, YIELD, BENT = 1.0, E / 500, 5.0
LENGTH = 0.5 * THICK


def sheet(parts: int, steps: int, back: float) -> Solution:
    """Return a wide sheet bent to a radius of 5 thicknesses, then turned back by an angle."""
    steel = Material(youngs_modulus=E, poisson_ratio=0.3, yield_stress=YIELD)
    body = block((0, LENGTH), (-THICK / 2, THICK / 2), (1, parts), material=steel,
                 element="quad8", supports={"left": "x"})  # fmt: skip
    turned = Moved(value=LENGTH / BENT)
    end = RigidBody(name="end", centre=(LENGTH, 0.0), x=Pushed(), rotation=turned)
    wall = RigidBody(name="wall")
    links = (
        Link(slave=("b", "right"), rigid="end", components="x"),
        Link(slave=("b", "left"), rigid="wall", components="y", distributed=True),
    )
    stages = [Stage(name="bent", target=1.0, steps=steps),
              Stage(name="released", target=1.0 - back, steps=2)]  # fmt: skip
    return solve(Model(bodies=(body,), rigid=(end, wall), links=links), stages=stages)


def curved(found: Solution, stage: str) -> tuple[Array, Array, Array]:
    """Return radii (n,), hoop and radial stress (n,) of the nodes on the left, where x is hoop."""
    system, converged = found.system, found.stages[stage]
    x = system.full("b").X + system.displacement("b", converged.state).reshape(-1, 2).T
    motion = found.motion("end", stage)
    centre = (LENGTH + motion.x) / np.tan(motion.rotation)
    at = np.flatnonzero(np.abs(system.full("b").X[0]) < 1e-9)
    at = at[np.argsort(-x[1, at])]
    stress = found.stress("b", stage)
    return centre - x[1, at], stress[0, at], stress[1, at]


def test_a_bent_sheet_has_the_stress_and_the_springback_of_closed_forms() -> None:
    """R. Hill, The Mathematical Theory of Plasticity (1950), chapter XI.3: rigid-plastic sheet.

    Its release is that of the elastic curved bar (S. Timoshenko, J.N. Goodier, Theory of
    Elasticity, 1951, article 27).
    """
    shear = YIELD / np.sqrt(3)
    a, b = BENT - THICK / 2, BENT + THICK / 2
    n = (b**2 - a**2) ** 2 - 4 * a**2 * b**2 * np.log(b / a) ** 2
    moment = shear * THICK**2 / 2
    back = 8 * moment * (b**2 - a**2) / n * (1 - 0.3**2) / E
    found = sheet(20, 10, back)
    r, hoop, radial = curved(found, "bent")
    a, b = r.min(), r.max()
    neutral = np.sqrt(a * b)
    assert found.reaction("end", "bent")[2] == pytest.approx(shear * (b - a) ** 2 / 2, rel=2e-3)
    stretched = r > neutral
    across = -2 * shear * np.where(stretched, np.log(b / r), np.log(r / a))
    along = across + np.where(stretched, 2 * shear, -2 * shear)
    plastic = np.abs(r - neutral) > 0.1 * THICK
    assert np.abs(radial - across)[plastic].max() < 0.01 * YIELD
    assert np.abs(hoop - along)[plastic].max() < 0.01 * YIELD
    # almost no moment is left, so that the stress differs from the plastic one by the elastic one
    left = found.reaction("end", "released")[2]
    assert abs(left) < 0.03 * moment
    released = found.reaction("end", "bent")[2] - left
    n = (b**2 - a**2) ** 2 - 4 * a**2 * b**2 * np.log(b / a) ** 2
    logs = b**2 * np.log(r / b) + a**2 * np.log(a / r)
    ring = a**2 * b**2 / r**2 * np.log(b / a)
    elastic = 4 * released / n * (-ring + logs + b**2 - a**2)
    _, remains, _ = curved(found, "released")
    assert np.abs(remains - hoop + elastic).max() < 0.01 * YIELD
    for stage in ("bent", "released"):
        assert found.audit(stage).passed


# -- a turned block ------------------------------------------------------------------------------


def test_stress_turns_with_a_block_whose_ends_are_turned() -> None:
    """Heated between its ends it flows; turned by 1 rad it has the same stress in its own axes."""
    steel = Material(youngs_modulus=E, poisson_ratio=0.3, yield_stress=200.0,
                     hardening="isotropic", hardening_ratio=0.01)  # fmt: skip
    first, later = (Amplitude([0, 1, 2], [0, middle, 1]) for middle in (1, 0))
    body = block((0, 2), (0, 1), (4, 2), material=steel,
                 loads=(Temperature(expansion=1e-5, rise=300.0, amplitude=first),))  # fmt: skip
    turned = RigidBody(name="frame", centre=(-1.0, 3.0), rotation=Moved(value=1.0, amplitude=later))
    links = tuple(Link(slave=("b", side), rigid="frame") for side in ("left", "right"))
    stages = [Stage(name="hot", target=1.0, steps=4), Stage(name="turned", target=2.0, steps=4)]
    found = solve(Model(bodies=(body,), rigid=(turned,), links=links), stages=stages)
    (xx, yy, zz, xy), after = (
        found.system.state("b", found.stages[stage]).stress for stage in ("hot", "turned")
    )
    assert found.plastic_strain("b", "hot").max() > 1e-3
    c, s = np.cos(1.0), np.sin(1.0)
    shear = xy / np.sqrt(2)
    exact = np.stack([
        c**2 * xx + s**2 * yy - 2 * c * s * shear, s**2 * xx + c**2 * yy + 2 * c * s * shear, zz,
        np.sqrt(2) * (c * s * (xx - yy) + (c**2 - s**2) * shear),
    ])  # fmt: skip
    assert np.abs(after - exact).max() < 1e-9 * E
    assert found.audit("turned").passed


@pytest.mark.parametrize("angle", [0.01, 1.0])
@pytest.mark.parametrize("sides", [{"left": "xy"}, {"left": "x", "bottom": "y"}])
@pytest.mark.parametrize("more", [{}, {"stiffness": 100.0}, {"distributed": True}])
def test_a_block_that_links_alone_hold_turns_without_stress(
    angle: float, sides: dict[str, Any], more: dict[str, Any]
) -> None:
    body = block((0, 2), (0, 1), (4, 2))
    turned = RigidBody(name="hub", centre=(0.0, 0.5), rotation=Moved(value=angle))
    links = tuple(
        Link(slave=("b", side), rigid="hub", components=own, **more) for side, own in sides.items()
    )
    stages = [Stage(name="turned", target=1.0, steps=4)]
    found = solve(Model(bodies=(body,), rigid=(turned,), links=links), stages=stages)
    assert np.abs(found.stress("b", "turned")).max() < 1e-12 * E
    X = found.system.full("b").X
    spin = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    centre = np.array([[0.0], [0.5]])
    exact = spin @ (X - centre) + centre - X
    assert np.abs(found.displacement("b", "turned") - exact).max() < 1e-9
    assert found.audit("turned").passed


def test_a_block_that_links_alone_hold_is_squeezed_and_bent_in_few_iterations() -> None:
    body = block((0, 4), (-0.5, 0.5), (10, 4))
    hubs = (
        RigidBody(name="left", rotation=Moved(value=-0.2)),
        RigidBody(name="right", centre=(4.0, 0.0), x=Moved(value=-0.45), rotation=Moved(value=0.2)),
    )
    links = tuple(Link(slave=("b", side), rigid=side) for side in ("left", "right"))
    stages = [Stage(name="bent", target=1.0, steps=10)]
    found = solve(Model(bodies=(body,), rigid=hubs, links=links), stages=stages)
    assert sum(found.tally.iterations) < 40
    assert not found.audit("bent").violations


PRESS, TURN = Amplitude([0, 1, 2], [0, 1, 1]), Amplitude([1, 2], [0, 1])


def squeezed(down: float, angle: float, held: str, **more: Any) -> Model:
    """Return a block squeezed by two rigid bodies that turn about one centre.

    Links or contact alone hold it.
    """
    body = block((-0.5, 0.5), (0, 1), (3, 3), **more)
    turned = {"rotation": Moved(value=angle, amplitude=TURN)}
    top = RigidBody(name="top", centre=(0.0, down), surfaces={"face": line((-3, 1), (3, 1))},
                    y=Moved(value=-down, amplitude=PRESS), **turned)  # fmt: skip
    bottom = RigidBody(name="bottom", surfaces={"face": line((3, 0), (-3, 0))}, **turned)
    sides: Any = [(("b", side), side) for side in ("top", "bottom")]
    fields: dict[str, Any] = {"links": tuple(Link(slave=s, rigid=to) for s, to in sides)}
    if held == "contact":
        fields = {"contacts": tuple(ContactPair(slave=s, master=(to, "face"), friction=1.0)
                                    for s, to in sides)}  # fmt: skip
    return Model(bodies=(body,), rigid=(top, bottom), **fields)


ROUND = (Stage(name="squeezed", target=1.0, steps=5), Stage(name="turned", target=2.0, steps=20))


@pytest.mark.parametrize("held", ["links", "contact"])
@pytest.mark.parametrize("angle", [2 * np.pi, -4.0])
def test_a_squeezed_block_turns_once_around_as_it_turns_a_little(held: str, angle: float) -> None:
    """Its stress turns with it; the last increments take no more iterations than the first ones."""
    found = solve(squeezed(0.1, angle, held), stages=ROUND)
    before, after = (found.stress("b", stage.name) for stage in ROUND)
    c, s = np.cos(angle), np.sin(angle)
    R, plane = np.array([[c, -s], [s, c]]), np.array([[before[0], before[3]], before[[3, 1]]])
    turned = np.einsum("ik,kl...,jl->ij...", R, plane, R)
    assert np.abs(before).max() > 0.05 * E
    assert np.abs(turned[[0, 1, 0], [0, 1, 1]] - after[[0, 1, 3]]).max() < 1e-7 * E
    assert max(found.tally.iterations) <= 4
    assert max(found.tally.iterations[-20:]) <= 3
    assert found.audit("turned").passed


@pytest.mark.parametrize("held", ["links", "contact"])
def test_pins_elsewhere_give_the_same_steps(held: str) -> None:
    """Springs that hold its rigid motions while a step is solved strain in none."""
    model = squeezed(0.1, 2.0, held)
    stages = (*ROUND[:1], Stage(name="turned", target=2.0, steps=6))
    first = solve(model, stages=stages)

    def late(rigid: Array, free: Any) -> Any:
        cut = len(free) // 2
        return np.union1d(free[:cut], choose_pins(rigid, free[cut:]))

    with mock.patch("solver.fem.large.choose_pins", late):
        second = solve(model, stages=stages)
    assert first.tally.iterations == second.tally.iterations
    one, two = (found.displacement("b", "turned") for found in (first, second))
    assert np.abs(one - two).max() < 1e-9
    assert (one != two).any()


@pytest.mark.parametrize("held", ["links", "contact"])
def test_derivatives_of_a_turned_block_are_those_of_differences(held: str) -> None:
    given = {"down": 0.15, "angle": 4.0}
    stages = (*ROUND[:1], Stage(name="turned", target=2.0, steps=12))

    def forces(found: Solution) -> Array:
        return np.array(found.reaction("top", "turned")[:2])

    slopes = derive(lambda **at: squeezed(held=held, **at), given, forces, stages=stages)
    for name, value in given.items():
        high, low = (
            forces(solve(squeezed(**given | {name: value * (1 + step)}, held=held), stages=stages))
            for step in (3e-4, -3e-4)
        )
        exact = (high - low) / (6e-4 * value)
        assert np.abs(slopes[name] - exact).max() < 1e-5 * np.abs(exact).max()


def test_a_block_pulled_at_a_free_rigid_body_converges_quadratically() -> None:
    """Forces of links turn with the frame, and those within the block with the block."""
    body = block((0, 2), (0, 1), (8, 4))
    held = RigidBody(name="held", centre=(0.0, 0.5), rotation=Moved(value=1.0, amplitude=TURN))
    pulled = RigidBody(name="pulled", centre=(2.0, 0.5), x=Pushed(value=2e4, amplitude=PRESS),
                       y=Pushed(value=7e3), rotation=Pushed(value=4e3))  # fmt: skip
    links = tuple(
        Link(slave=("b", side), rigid=to) for side, to in (("left", "held"), ("right", "pulled"))
    )
    stages = [Stage(name="pulled", target=1.0, steps=4), Stage(name="turned", target=2.0, steps=8)]
    found = solve(Model(bodies=(body,), rigid=(held, pulled), links=links), stages=stages)
    assert max(found.tally.iterations) <= 5
    assert sum(found.tally.iterations) <= 55
    assert found.motion("pulled", "turned").rotation > 1.0
    assert found.audit("turned").passed


@pytest.mark.parametrize("stiffness", [np.inf, 1e4])
def test_work_is_balanced_while_a_pressed_block_turns(stiffness: float) -> None:
    """Turning does no work on it, in 10 increments as in many."""
    press, turn = Amplitude([0, 1, 2], [0, 1, 1]), Amplitude([0, 1, 2], [0, 0, 1])
    body = block((0, 2), (0, 1), (4, 2),
                 loads=(Pressure(boundary="right", value=100.0, amplitude=press),))  # fmt: skip
    hub = RigidBody(name="hub", centre=(-3.0, 3.0), rotation=Moved(value=1.4, amplitude=turn))
    link = Link(slave=("b", "left"), rigid="hub", stiffness=stiffness)
    stages = [
        Stage(name="pressed", target=1.0, steps=2),
        Stage(name="turned", target=2.0, steps=10),
    ]
    found = solve(Model(bodies=(body,), rigid=(hub,), links=(link,)), stages=stages)
    assert found.audit("turned").figures["audit_energy"] < 1e-4
    before, after = (found.stages[stage].energy.external for stage in ("pressed", "turned"))
    assert after == pytest.approx(before, rel=1e-6)


def test_the_moment_on_a_boundary_that_slides_has_the_present_arms() -> None:
    """Whether the rigid body may rotate or not."""
    body = block((0, 2), (0, 1), (4, 2), supports={"left": "xy"},
                 loads=(Traction(boundary="top", y=2e3),))  # fmt: skip
    link = Link(slave=("b", "right"), rigid="plate", components="x")
    moments = []
    for rotation in (0.0, 1e-9):
        plate = RigidBody(name="plate", centre=(2.0, 0.5), x=Moved(value=0.2),
                          rotation=Moved(value=rotation))  # fmt: skip
        found = solve(Model(bodies=(body,), rigid=(plate,), links=(link,)), load=1.0)
        assert found.audit().passed
        force, _, moment = found.reaction("plate", "loaded")
        moments.append(moment)
    at = np.abs(found.system.full("b").X[0] - 2.0) < 1e-9
    slid = found.displacement("b", "loaded")[1, at].mean()
    assert moments[0] == pytest.approx(moments[1], rel=1e-6)
    assert -moments[0] / force == pytest.approx(slid, abs=0.05)
    assert slid > 0.09


def test_two_blocks_tied_along_one_axis_are_audited() -> None:
    first = block((0, 2), (0, 1), (4, 2), supports={"left": "xy"})
    second = block((2, 4), (0, 1), (4, 3), name="c",
                   loads=(Displacement(boundary="right", x=0.2, y=0.3),))  # fmt: skip
    tie = Link(slave=("b", "right"), master=("c", "left"), components="x")
    found = solve(Model(bodies=(first, second), links=(tie,)), load=1.0)
    assert found.audit().passed


def test_derivatives_follow_springs_that_turn() -> None:
    """Along the path with the same increments, against central differences."""
    stages = [Stage(name="bent", target=1.0, steps=8)]

    def strip(angle: float, stiffness: float) -> Model:
        body = block((0, STRIP), (-THIN / 2, THIN / 2), (10, 1), element="quad8",
                     kinematics="plane_stress", supports={"left": "xy"})  # fmt: skip
        end = RigidBody(name="end", centre=(STRIP, 0.0), x=Pushed(), y=Pushed(),
                        rotation=Moved(value=angle))  # fmt: skip
        link = Link(slave=("b", "right"), rigid="end", stiffness=stiffness)
        return Model(bodies=(body,), rigid=(end,), links=(link,))

    def end(found: Solution) -> Array:
        return np.array([*found.motion("end", "bent")[:2], found.reaction("end", "bent")[2]])

    given = {"angle": 2.0, "stiffness": 1e4}
    slopes = derive(strip, given, end, stages=stages)
    for name, value in given.items():
        both = (
            solve(strip(**given | {name: value * (1 + s)}), stages=stages) for s in (1e-3, -1e-3)
        )
        high, low = (end(found) for found in both)
        exact = (high - low) / (2e-3 * value)
        assert np.abs(slopes[name] - exact).max() < 1e-4 * np.abs(exact).max()


def test_what_cannot_turn_is_refused() -> None:
    body = block((0, 2), (0, 1), (4, 2))
    other = block((2, 4), (0, 1), (4, 2), name="c")
    end = RigidBody(name="end", rotation=Moved(value=1.0))
    fields: dict[str, Any]
    for fields in ({"components": "normal"}, {"master": ("c", "left")}):
        link = Link(slave=("b", "right"), rigid="end", **fields)
        with pytest.raises(ModelError, match=r"must not move along normals, nor relative to a mas"):
            Model(bodies=(body, other), rigid=(end,), links=(link,))


# -- a rotor -------------------------------------------------------------------------------------


@pytest.mark.parametrize("element", ["quad8", "quad4"])
def test_a_rod_that_spins_is_stretched_by_the_force_at_its_present_places(element: str) -> None:
    """The force per length is density x speed^2 x present radius: a boundary value problem."""
    modulus, pull, length = 1000.0, 2.2, 10.0
    rod = block((0, length), (0, 1), (10, 1), element=element, kinematics="plane_stress",
                material=Material(youngs_modulus=modulus, poisson_ratio=0.0),
                supports={"left": "x", "bottom": "y"},
                loads=(Centrifugal(density=1e-6, speed=np.sqrt(pull / 1e-6)),))  # fmt: skip
    found = solve(Model(bodies=(rod,)), load=1.0, control=PathControl(load_step=0.25))

    def stretched(nominal: Array) -> Array:
        stretch = np.ones_like(nominal)
        for _ in range(30):
            slope = modulus * (1 - np.log(stretch)) / stretch**2
            stretch = stretch - (modulus * np.log(stretch) / stretch - nominal) / slope
        return stretch

    at = np.linspace(0, length, 21)
    exact = solve_bvp(
        lambda _, y: np.stack([stretched(y[1]), -pull * y[0]]),
        lambda left, right: np.array([left[0], right[1]]),
        at, np.stack([at, np.zeros(21)]), tol=1e-9,
    )  # fmt: skip
    tip = exact.y[0][-1] - length
    assert found.displacement("b", "loaded")[0].max() == pytest.approx(tip, rel=1e-3)
    assert tip > 0.09 * length
    audit = found.audit()
    assert not audit.violations


class Swirl(Load):
    """A user's force that turns about the origin, or that is not linear in the position."""

    follows = True

    def __init__(self, power: int) -> None:
        object.__setattr__(self, "amplitude", None)
        object.__setattr__(self, "power", power)

    def body_force(self, x: Array) -> Array:
        """Return the force per volume (2, n)."""
        return 5.0 * np.stack([-x[1], x[0] ** self.power])  # type: ignore[attr-defined]


def test_a_force_of_a_user_follows_if_it_is_linear() -> None:
    found = solve(
        Model(bodies=(block((0, 2), (0, 1), (4, 2), supports={"left": "xy"}, loads=(Swirl(1),)),)),
        load=1.0, control=PathControl(load_step=0.5),
    )  # fmt: skip
    audit = found.audit()
    assert not audit.violations
    with pytest.raises(ModelError, match="must be linear in the position: it follows"):
        solve(Model(bodies=(block((0, 2), (0, 1), (4, 2), supports={"left": "xy"},
                                  loads=(Swirl(3),)),)), load=1.0)  # fmt: skip


def test_a_rotor_spins_as_a_whole() -> None:
    body: dict[str, Any] = {"loads": (Centrifugal(density=1e-8, speed=10.0),),
                            "material": ELASTIC, "element": "quad4", "strain": "large"}  # fmt: skip
    mesh = grid(np.linspace(0, 2, 5), np.linspace(0, 1, 3)).with_subdomains({"near": np.arange(2)})
    with pytest.raises(ModelError, match="must be left out, or large_region: it acts on all of"):
        Body(name="b", mesh=mesh, large_region="near", **body)
