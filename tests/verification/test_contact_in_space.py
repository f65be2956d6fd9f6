"""Contact that is narrow: which side bears it, and a run that knows how well it is resolved."""

from __future__ import annotations

import numpy as np
import pytest

from solver import (
    Body,
    ContactPair,
    Material,
    Model,
    Moved,
    Pushed,
    RigidBody,
    Solution,
    Stage,
    solve,
)
from solver.mesh import graded, grid, mapped
from solver.model.rigid import RigidSurface, arc, line

E, NU, RADIUS, HALF_WIDTH = 2e5, 0.3, 20.0, 0.5
STEEL = Material(youngs_modulus=E, poisson_ratio=NU)
MODULUS = E / (1 - NU**2)
FORCE = np.pi * HALF_WIDTH**2 * MODULUS / (4 * RADIUS)
PEAK = 2 * FORCE / (np.pi * HALF_WIDTH)
"""Line contact of Hertz: K.L. Johnson (1985), section 4.2(c)."""
ONCE = (Stage(name="loaded", target=1.0, steps=2),)


def both_sides(half: np.ndarray) -> np.ndarray:
    """Return the mirrored positions and those given, from 0 on."""
    return np.concatenate([-half[:0:-1], half])


def plane(size: float) -> Body:
    """A block, 40 mm wide, with elements of ``size`` along the middle of its top."""
    fine = np.arange(0.0, 1.5 * HALF_WIDTH + size / 2, size)
    half = np.concatenate([fine, fine[-1] + graded(20.0 - fine[-1], size, 1.3, 4.0)[1:]])
    y = -graded(20.0, min(size, HALF_WIDTH / 4), 1.3, 4.0)[::-1]
    return Body(name="plane", mesh=grid(both_sides(half), y), material=STEEL,
                supports={"bottom": "xy"})  # fmt: skip


def pressed(slave: str, edges: int, size: float) -> Solution:
    """Press a rigid cylinder, half a circle of so many edges, on the plane."""
    cylinder = RigidBody(
        name="cylinder",
        surfaces={"rim": arc((0.0, RADIUS), RADIUS, (-np.pi, 0.0), edges)},
        centre=(0.0, RADIUS),
        y=Pushed(value=-FORCE),
    )
    sides = {"plane": ("plane", "top"), "cylinder": ("cylinder", "rim")}
    master = sides["cylinder" if slave == "plane" else "plane"]
    pair = ContactPair(slave=sides[slave], master=master)
    return solve(Model(bodies=(plane(size),), rigid=(cylinder,), contacts=(pair,)), stages=ONCE)


def peak(solution: Solution) -> float:
    """Return the largest pressure / that of Hertz."""
    return float(solution.contact().pressure.max()) / PEAK


@pytest.mark.parametrize("edges", [4, 60, 1200])
@pytest.mark.parametrize("slave", ["plane", "cylinder"])
def test_hertz_holds_whichever_side_is_the_slave_and_however_it_is_divided(
    slave: str, edges: int
) -> None:
    """Elements of a tenth of the half-width tell the peak of Hertz to 0.6 %."""
    found = pressed(slave, edges, HALF_WIDTH / 10)
    assert peak(found) == pytest.approx(1.0, abs=0.006)
    assert found.audit("loaded").passed
    assert found.audit("loaded").figures["audit_contact_resolution"] < 0.06


CLAIMED = ((9, 0.01, 0.02), (5, 0.04, 0.1), (3, 0.1, 0.2))
"""Vertices across a contact, and the largest error of the peak of Hertz with so many: in line and
in point contact. Of three the outer two may hardly touch."""


def check_claims(found: Solution, vertices: int, exact: float, *, point: bool) -> None:
    """Check that a contact with so many vertices is as right as it claims, and warns, or fails."""
    audit = found.audit("loaded")
    assert audit.passed == (vertices >= 3)
    if audit.passed:
        error = abs(float(found.contact().pressure.max()) / exact - 1.0)
        assert error < next(claims[point] for least, *claims in CLAIMED if vertices >= least)
        estimated = audit.figures["audit_error_contact"]
        assert error < estimated
        warned = [text for text in audit.warnings if text.startswith("contact pressure has an")]
        assert len(warned) == (estimated > 0.1)
    else:
        assert [text.split()[0] for text in audit.violations] == ["audit_contact_resolution"]


@pytest.mark.parametrize("size", [0.1, 0.2, 0.3, 0.475, 0.5, 0.7, 1.0])
def test_of_line_contact_what_passes_is_as_right_as_it_claims(size: float) -> None:
    found = pressed("plane", 60, size)
    touching = int((found.loaded.state.contacts[0].normal > 0).sum())
    check_claims(found, touching, PEAK, point=False)


@pytest.mark.parametrize("size", [0.11, 0.2, 0.24, 0.3, 0.455, 0.55])
def test_of_point_contact_what_passes_is_as_right_as_it_claims(size: float) -> None:
    """The vertex on the axis is seen once, the others stand for both sides."""
    fine = np.arange(0.0, 1.2, size)
    x = np.append(fine, fine[-1] + graded(20.0 - fine[-1], size, 1.3, 4.0)[1:])
    space = Body(name="space", mesh=grid(x, -graded(20.0, 0.1, 1.3, 4.0)[::-1]), material=STEEL,
                 kinematics="axisymmetric", supports={"left": "x", "bottom": "xy"})  # fmt: skip
    force = 4 / 3 * MODULUS * HALF_WIDTH**3 / RADIUS
    cap = arc((0.0, RADIUS), RADIUS, (-np.pi / 2, -np.pi / 2 + 0.3), 40, (False, True))
    ball = RigidBody(name="ball", surfaces={"cap": cap}, y=Pushed(value=-force))
    pair = ContactPair(slave=("space", "top"), master=("ball", "cap"))
    found = solve(Model(bodies=(space,), rigid=(ball,), contacts=(pair,)), stages=ONCE)
    touching = int((found.loaded.state.contacts[0].normal > 0).sum())
    exact = 2 * MODULUS * HALF_WIDTH / (np.pi * RADIUS)
    check_claims(found, 2 * touching - 1, exact, point=True)


@pytest.mark.parametrize("half", ["ball", "plate"])
def test_of_half_a_contact_both_halves_count(half: str) -> None:
    """The axis, or a support, stands for the other half: two vertices are three across it."""
    on_axis = half == "ball"
    body = Body(
        name="plane",
        mesh=grid(np.append(np.arange(0.0, 2.0, 0.3), 20.0), -graded(20.0, 0.1, 1.3, 4.0)[::-1]),
        material=STEEL,
        kinematics="axisymmetric" if on_axis else "plane_strain",
        supports={"left": "x", "bottom": "xy"},
    )
    force = 4 / 3 * MODULUS * HALF_WIDTH**3 / RADIUS if on_axis else FORCE / 2
    ball = RigidBody(
        name="ball",
        surfaces={
            "cap": arc((0.0, RADIUS), RADIUS, (-np.pi / 2, -np.pi / 2 + 0.3), 40, (False, True))
        },
        y=Pushed(value=-force),
    )
    pair = ContactPair(slave=("plane", "top"), master=("ball", "cap"))
    found = solve(Model(bodies=(body,), rigid=(ball,), contacts=(pair,)), stages=ONCE)
    assert (found.loaded.state.contacts[0].normal > 0).sum() == 2
    figure = found.audit("loaded").figures["audit_contact_resolution"]
    assert figure == pytest.approx(1 / 3, rel=1e-6)


@pytest.mark.parametrize("fine", ["upper", "lower"])
def test_of_two_curved_bodies_the_finer_one_bears_the_forces(fine: str) -> None:
    """The slave asked for has edges of 1 mm, wider than the contact."""
    half = both_sides(graded(10.0, 0.05, 1.3, 3.0))
    coarse, y = np.linspace(-10.0, 10.0, 21), graded(10.0, 0.05, 1.3, 3.0)

    def bulge(p: np.ndarray) -> np.ndarray:
        profile = p[0] ** 2 / (2 * RADIUS)
        return np.stack([p[0], profile + p[1] * (10.0 - profile) / 10.0])

    upper = Body(name="upper", mesh=mapped(grid(half if fine == "upper" else coarse, y), bulge),
                 material=STEEL, supports={"top": "x"}, pressure={"top": 30.0})  # fmt: skip
    lower = Body(name="lower", mesh=grid(half if fine == "lower" else coarse, -y[::-1]),
                 material=STEEL, supports={"bottom": "xy"})  # fmt: skip
    sides = {"upper": ("upper", "bottom"), "lower": ("lower", "top")}
    other = "lower" if fine == "upper" else "upper"
    pair = ContactPair(slave=sides[other], master=sides[fine])
    found = solve(Model(bodies=(upper, lower), contacts=(pair,)), stages=ONCE)
    assert found.system.model.contacts[0].slave == sides[fine]
    assert "audit_contact_resolution" in " ".join(found.audit("loaded").violations)


@pytest.mark.parametrize("on_axis", [True, False])
@pytest.mark.parametrize("size", [0.6, 2.0, 4.0])
def test_a_way_that_ends_between_vertices_is_no_answer(on_axis: bool, size: float) -> None:
    """A ball that is moved into a plane meets force, although the mean gaps under hats are open."""
    x = np.arange(0.0, 20.0 + size / 2, size)
    body = Body(
        name="plane",
        mesh=grid(x if on_axis else both_sides(x), -graded(20.0, 0.1, 1.3, 4.0)[::-1]),
        material=STEEL,
        kinematics="axisymmetric" if on_axis else "plane_strain",
        supports={"bottom": "xy"} | ({"left": "x"} if on_axis else {}),
    )
    start, whole = (-np.pi / 2, (False, True)) if on_axis else (-np.pi / 2 - 0.5, (True, True))
    cap = arc((0.0, RADIUS), RADIUS, (start, -np.pi / 2 + 0.5), 40, whole)
    ball = RigidBody(name="ball", surfaces={"cap": cap}, y=Moved(value=-(HALF_WIDTH**2) / RADIUS))
    pair = ContactPair(slave=("plane", "top"), master=("ball", "cap"))
    found = solve(Model(bodies=(body,), rigid=(ball,), contacts=(pair,)), stages=ONCE)
    audit = found.audit("loaded")
    assert (found.loaded.state.contacts[0].normal > 0).any() == (size == 0.6)
    assert [text.split()[0] for text in audit.violations] == ["audit_contact_resolution"]


def test_a_flat_punch_stays_the_slave_on_a_finer_plane() -> None:
    """Its surface ends at a corner."""
    x = np.linspace(-2.0, 2.0, 5)
    punch = Body(name="punch", mesh=grid(x, np.linspace(0.0, 2.0, 3)), material=STEEL,
                 pressure={"top": 10.0}, supports={"top": "x"})  # fmt: skip
    wide = Body(name="plane", mesh=grid(np.linspace(-6.0, 6.0, 61), np.linspace(-4.0, 0.0, 9)),
                material=STEEL, supports={"bottom": "xy"})  # fmt: skip
    pair = ContactPair(slave=("punch", "bottom"), master=("plane", "top"))
    found = solve(Model(bodies=(punch, wide), contacts=(pair,)), stages=ONCE)
    assert found.system.model.contacts[0].slave == ("punch", "bottom")


@pytest.mark.parametrize("edges", [1, 2, 8, 48, 200])
def test_a_plate_under_an_eccentric_force_turns_by_as_much_however_it_is_divided(
    edges: int,
) -> None:
    def turned(slave: str, base: RigidSurface) -> float:
        block = Body(name="block", mesh=grid(np.linspace(-4.0, 4.0, 17), np.linspace(-4, 0, 9)),
                     material=STEEL, supports={"bottom": "xy"})  # fmt: skip
        plate = RigidBody(name="plate", surfaces={"base": base}, centre=(1.0, 0.0),
                          y=Pushed(value=-400.0), rotation=Pushed())  # fmt: skip
        sides = {"plate": ("plate", "base"), "block": ("block", "top")}
        master = sides["block" if slave == "plate" else "plate"]
        pair = ContactPair(slave=sides[slave], master=master, friction=0.2)
        found = solve(Model(bodies=(block,), rigid=(plate,), contacts=(pair,)))
        return found.motion("plate").rotation

    whole = turned("block", line((-6.0, 0.0), (6.0, 0.0)))
    assert turned("plate", line((-6.0, 0.0), (6.0, 0.0), edges)) == pytest.approx(whole, rel=1e-3)


def test_an_arc_is_round_however_few_edges_are_asked_for() -> None:
    points = np.asarray(arc((0.0, 0.0), 1.0, (0.0, np.pi), 4).points)
    first, middle, last = points[:, :3].T
    quarter = 3 / 8 * first + 6 / 8 * middle - 1 / 8 * last  # of the quadratic edge
    assert np.linalg.norm(quarter) == pytest.approx(1.0, abs=1e-6)
