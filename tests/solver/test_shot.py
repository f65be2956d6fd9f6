"""A rigid ball pressed into a strip, far beyond yield: by a motion, so that increments begin in
balance, and with friction, so that steps may be far too long for their tangent."""

from __future__ import annotations

import numpy as np
import pytest

from solver import Body, ContactPair, Material, Model, Solution, solve
from solver.loading.program import PathControl
from solver.mesh import graded, grid
from solver.model.rigid import Moved, RigidBody, arc

pytestmark = pytest.mark.solves

STEEL = Material(youngs_modulus=2.1e5, poisson_ratio=0.3, yield_stress=600.0,
                 hardening="isotropic", hardening_ratio=0.01)  # fmt: skip
ALUMINIUM = Material(youngs_modulus=7e4, poisson_ratio=0.33)


def pressed(friction: float, depth: float, steps: int) -> Solution:
    """Return a strip that lies on an anvil, with a ball pressed into it."""
    along, down = graded(3.0, 0.02, 1.3, 0.4), graded(1.0, 0.02, 1.3, 0.3)
    strip = Body(name="strip", mesh=grid(along, -down[::-1]), material=STEEL,
                 kinematics="axisymmetric", supports={"left": "x"})  # fmt: skip
    anvil = Body(name="anvil", mesh=grid(np.linspace(0, 4, 9), np.linspace(-4, -1, 7)),
                 material=ALUMINIUM, kinematics="axisymmetric",
                 supports={"left": "x", "bottom": "y"})  # fmt: skip
    face = arc((0.0, 0.5), 0.5, (-np.pi / 2, 0.0), 200)
    ball = RigidBody(name="ball", surfaces={"face": face}, centre=(0.0, 0.5), y=Moved(value=-depth))
    dent = ContactPair(slave=("strip", "top"), master=("ball", "face"), friction=friction)
    seat = ContactPair(slave=("strip", "bottom"), master=("anvil", "top"), friction=0.3)
    model = Model(bodies=(strip, anvil), rigid=(ball,), contacts=(dent, seat))
    return solve(model, control=PathControl(load_step=1 / steps))


@pytest.mark.parametrize(
    ("friction", "depth", "steps"),
    [pytest.param(0.2, 0.02, 40, marks=pytest.mark.long), (0.5, 0.01, 20)],
)
def test_a_ball_is_pressed_in_without_an_increment_cut(
    friction: float, depth: float, steps: int
) -> None:
    found = pressed(friction, depth, steps)
    assert found.tally.cuts == 0
    assert found.audit().passed, found.audit().violations
    force = found.reaction("ball", "loaded")[1]
    # an error of first order differs by as much as with twice the steps, one of second by more
    coarser = pressed(friction, depth, 2 * steps // 3).reaction("ball", "loaded")[1]
    assert force == pytest.approx(coarser, rel=0.01)


def test_a_strip_that_nothing_holds_any_more_stays_where_it_is() -> None:
    """It came loose between the ball and the anvil in the first of five increments of release."""
    found = pressed(0.0, 0.02, 20)
    bottom = np.stack([np.linspace(0.1, 2.9, 8), np.full(8, -1.0)])
    lifted = found.at("strip", bottom, "unloaded")["displacement"][1]
    assert np.abs(lifted).max() < 0.02 / 5
    assert found.motion("ball", "unloaded").y == 0.0
    assert found.audit().passed, found.audit().violations
