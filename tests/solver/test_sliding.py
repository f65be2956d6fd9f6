"""Which sliding a contact pair has, and when small sliding is warned of."""

from __future__ import annotations

import numpy as np
import pytest

from solver import (
    Amplitude,
    Body,
    ContactPair,
    Displacement,
    Material,
    Model,
    ModelError,
    Moved,
    Pressure,
    Pushed,
    RigidBody,
    Solution,
    Stage,
    System,
    solve,
)
from solver.mesh import grid, mapped
from solver.model.rigid import RigidSurface, arc, line
from tests.verification.test_hertz_point import press

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3)
PAIR = {"slave": ("block", "top"), "master": ("plate", "base")}


def block(bend: float = 0.0, element: str = "quad8") -> Body:
    """A block of width 8 whose top is bent to y = bend x²."""

    def arch(p: np.ndarray) -> np.ndarray:
        return np.stack([p[0], p[1] + bend * p[0] ** 2 * (p[1] + 4) / 4])

    mesh = mapped(grid(np.linspace(-4, 4, 17), np.linspace(-4, 0, 9)), arch)
    return Body(name="block", mesh=mesh, element=element, material=STEEL,
                supports={"bottom": "xy"})  # fmt: skip


def plate(surface: RigidSurface, way: float = 0.0) -> RigidBody:
    return RigidBody(name="plate", surfaces={"base": surface}, x=Moved(value=way),
                     y=Pushed(value=-100.0))  # fmt: skip


STRAIGHT = line((-2.0, 0.0), (2.0, 0.0))
ROUND = arc((0.0, 50.0), 50.0, (-np.pi / 2 - 0.05, -np.pi / 2 + 0.05), 20)
KINKED = RigidSurface(points=np.array([[-2.0, 0.0, 2.0], [0.1, 0.0, 0.1]]))


def finite(body: Body, surface: RigidSurface, sliding: str = "auto") -> bool:
    pair = ContactPair(**PAIR, sliding=sliding)
    (interface,) = System(
        Model(bodies=(body,), rigid=(plate(surface),), contacts=(pair,))
    ).interfaces
    return interface.finite


@pytest.mark.parametrize("element", ["quad8", "quad4"])
def test_auto_is_small_where_both_surfaces_are_straight_and_else_finite(element: str) -> None:
    assert ContactPair(**PAIR).sliding == "auto"
    assert not finite(block(element=element), STRAIGHT)
    assert finite(block(-1e-3, element), STRAIGHT)
    assert finite(block(element=element), ROUND)
    assert finite(block(element=element), KINKED)


def test_a_slope_is_straight() -> None:
    """Rounding of inclined positions does not count as a turn of the normals."""
    slope = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    mesh = mapped(grid(np.linspace(-4, 4, 17), np.linspace(-4, 0, 9)), lambda p: slope @ p)
    body = Body(name="block", mesh=mesh, material=STEEL, supports={"bottom": "xy"})
    ends = slope @ np.array([[-2.0, 2.0], [0.0, 0.0]])
    assert not finite(body, line(tuple(ends[:, 0]), tuple(ends[:, 1])))


def test_what_is_asked_for_is_taken() -> None:
    assert finite(block(), STRAIGHT, "finite")
    assert not finite(block(-1e-3), ROUND, "small")
    with pytest.raises(ModelError, match="must be one of auto, small, finite"):
        ContactPair(**PAIR, sliding="large")


def slid(way: float, sliding: str = "auto") -> Solution:
    pair = ContactPair(**PAIR, sliding=sliding)
    return solve(Model(bodies=(block(),), rigid=(plate(STRAIGHT, way),), contacts=(pair,)))


@pytest.mark.solves
def test_surfaces_that_slide_by_more_than_an_element_are_outside_small_sliding() -> None:
    """Elements of 0.5 mm; the plate is from -2 to 2, and ends press most."""
    audit = slid(0.8, "small").audit()
    (text,) = audit.outside
    assert text.startswith("block.top moved 0.8 mm along plate.base, mostly at (")
    assert ": 1.6 sides of an element" in text
    assert text.endswith('in a scene file or a model, set sliding = "finite"')
    assert audit.figures["audit_small_sliding"] == pytest.approx(1.6, rel=0.05)
    assert audit.passed
    within = slid(0.1, "small").audit(), slid(0.8, "finite").audit()
    assert [each.outside for each in within] == [(), ()]
    for each in (audit, *within):  # the block is wider than the plate, with few elements
        about = ("beyond the end of plate.base", "contact pressure has an estimated error")
        assert all(any(words in text for words in about) for text in each.warnings)


@pytest.mark.solves
@pytest.mark.parametrize("way", [0.01, 0.8, 9.0])
def test_straight_surfaces_are_paired_anew_once_they_move_far(way: float) -> None:
    """Half an element is far. What is pressed under the block moves with it."""

    def moved(sliding: str) -> Solution:
        x = np.linspace(-2.0, 2.0, 9)
        loads = (
            Pressure(boundary="top", value=100.0, amplitude=Amplitude([0, 1, 2], [0, 1, 1])),
            Displacement(boundary="top", x=way, amplitude=Amplitude([0, 1, 2], [0, 0, 1])),
        )
        pad = Body(name="pad", mesh=grid(x, np.linspace(0.0, 3.0, 7)), material=STEEL, loads=loads)
        base = Body(name="base", mesh=grid(np.linspace(-4.0, 16.0, 41), np.linspace(-5.0, 0.0, 9)),
                    material=STEEL, supports={"bottom": "xy"})  # fmt: skip
        pair = ContactPair(
            slave=("pad", "bottom"), master=("base", "top"), friction=0.2, sliding=sliding
        )
        stages = (
            Stage(name="pressed", target=1.0, steps=2),
            Stage(name="loaded", target=2.0, steps=4),
        )
        return solve(Model(bodies=(pad, base), contacts=(pair,)), stages=stages)

    found, asked = moved("auto"), moved("finite")
    assert found.loaded.state.contacts[0].finite == (way > 0.25)
    assert found.audit().passed
    assert not found.audit().warnings
    for body in ("pad", "base"):
        stress = asked.stress(body, "loaded")
        assert np.linalg.norm(found.stress(body, "loaded") - stress) < 0.01 * np.linalg.norm(stress)


@pytest.mark.solves
@pytest.mark.parametrize("slave", ["ball", "space"])
def test_curved_surfaces_are_warned_of_where_small_sliding_changes_the_pressure(
    slave: str,
) -> None:
    """Deep in the half-space by 4 %, where they move by 1 % of the contact length."""
    (text,) = press(slave, 1.0, sliding="small").audit().warnings
    assert "of the length of contact" in text
    assert press(slave, 1.0).audit().warnings == ()
    assert press(slave, 0.25, sliding="small").audit().warnings == ()
