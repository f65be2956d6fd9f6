"""Friction between a usual one and none: rolling tends to rolling without friction."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from solver import ModelError, Status, System
from solver.contact.complementarity import solve_contact
from solver.contact.problem import OPEN, ContactProblem
from solver.model.friction import LEAST_FRICTION
from solver.rolling.scenes.rolling import ROLLING, RollingParameters
from solver.rolling.scenes.rolling_model import model
from tests.records import kept
from tests.solver.test_contact_problem import instance

COARSE = RollingParameters(
    friction=0.0, track=6.0, element_size=4.0, advance_step=2.0, press_steps=3, unload_steps=1,
    growth=1.4,
)  # fmt: skip


@cache
def rolled(friction, **fields):
    (record,) = ROLLING.path(replace(COARSE, friction=friction, **fields), [1], lambda *told: None)
    assert record.status is Status.OK, record.message
    return kept(record)


def residual(record):
    return record.fields["residual_profile"][1][0]


@pytest.mark.solves
@pytest.mark.parametrize("friction", [1e-3, 1e-5, 1e-9, 1e-13])
def test_a_free_wheel_rolls_however_small_friction_is(friction):
    """In as many increments as without; residual stress differs by some p0 times friction."""
    without, run = rolled(0.0), rolled(friction)
    assert run.scalars["cut_increments"] == 0
    assert run.scalars["iterations"] <= 1.2 * without.scalars["iterations"]
    difference = np.abs(residual(run) - residual(without)).max()
    # not to zero: without friction the wheel is turned to roll, without creepage, and the mesh of
    # its rim stands elsewhere by a thousandth of the advance
    assert difference < (3 * friction + 1e-6) * COARSE.peak_pressure


@pytest.mark.solves
@pytest.mark.parametrize(("traction", "friction"), [(-0.9, 1e-5), (0.5, 1e-9), (1.0, 1e-5)])
def test_a_driven_wheel_has_its_share_of_little_friction(traction, friction):
    run = rolled(friction, traction=traction)
    force = traction * friction * run.parameters.force
    # a moment acts on the radius less the approach of the bodies and the strain of the rim
    assert run.scalars["longitudinal_force"] == pytest.approx(force, rel=0.02)


@pytest.mark.solves
def test_the_creepage_of_a_free_wheel_tends_to_a_limit():
    """What turns it tends to nothing, but nothing else does."""
    creepage = [rolled(friction).scalars["creepage"] for friction in (1e-5, 1e-7, 1e-9)]
    assert creepage[1] == pytest.approx(creepage[2], rel=1e-4)
    assert creepage[0] == pytest.approx(creepage[2], rel=1e-2)


def test_pressure_has_no_moment_about_the_axle():
    """Material passes a rim at rest by the arc it turns, and changes no gap."""
    system = System(model(replace(COARSE, friction=0.3)))
    wheel, chain = system.parts[0], system.interfaces[0].master_surface
    u = wheel.start()
    pairing = system.interfaces[0].pairing((u, system.parts[1].start()))
    for block, gaps, expected in (
        (pairing.normal[1], len(pairing.area), 0.0),
        (pairing.tangent[1], 0, 1.0),
    ):
        _, rows = wheel.pull_back(chain, u, block, gaps)
        facing = pairing.area > 0
        # the slave is flat: slip along it is the cosine of the angle on the rim, 5 degrees at most
        assert np.abs(rows[facing, -1]) == pytest.approx(expected, abs=5e-3)


@pytest.mark.parametrize("friction", [1e-4, 1e-6, 1e-9])
def test_a_body_that_friction_alone_holds_is_solved_in_the_units_of_friction(friction):
    """Pressed and turned by half of what friction carries: one point or more sticks."""
    for seed in range(30):
        plain = instance(seed, friction, rigid=1)
        n = plain.n
        A = np.hstack([plain.A, np.concatenate([np.zeros(n), np.ones(n)])[:, None]])
        push = 0.5 * friction * plain.balance[0]
        problem = ContactProblem(
            W=plain.W,
            offset=plain.offset,
            lines=plain.lines,
            A=A,
            balance=np.append(plain.balance, push),
        )
        solution = solve_contact(problem, np.full(n, OPEN))
        assert solution is not None
        N, T = solution.forces[:n], solution.forces[n:]
        assert T.sum() == pytest.approx(-push, rel=1e-4)
        assert (np.abs(T) <= friction * N + 1e-4 * friction * N.max()).all()
        slip = (problem.offset + problem.W @ solution.forces + A @ solution.rigid)[n:]
        slides = (N > 0) & (np.abs(slip) > 1e-6)
        full = -np.sign(slip) * friction * N
        assert T[slides] == pytest.approx(full[slides], abs=1e-4 * friction * N.max())


def test_friction_within_rounding_is_none():
    for friction, solved in ((LEAST_FRICTION, 0.0), (2 * LEAST_FRICTION, 2 * LEAST_FRICTION)):
        parameters = replace(COARSE, friction=friction)
        (interface,) = System(model(parameters)).interfaces
        assert interface.rough == (solved > 0.0)
        assert parameters.frictionless == (solved == 0.0)
        turned = model(parameters).body("wheel").axle.rotation
        assert (turned is None) == (solved > 0.0)
    with pytest.raises(ModelError, match="traction"):
        replace(COARSE, friction=LEAST_FRICTION, traction=0.5)
