"""Frictional contact of small models against what statics says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from solver import Body, ContactPair, Material, Model, NotConverged, System, solve
from solver.contact.problem import STICK
from solver.loading.increment import Increment
from solver.mesh import grid
from solver.model.friction import FrictionLaw
from tests.verification.flat_punches import press

pytestmark = pytest.mark.solves

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3)
PRESSURE = 100.0
LENGTH, HEIGHT = 10.0, 2.0


def pushed_block(push, friction, **fields):
    """A block on a wide base, pressed down by 100 and pushed sideways on one end.

    Nothing but friction holds it along the base: it has all three rigid motions.
    """
    block = Body(
        name="block",
        mesh=grid(np.linspace(-5.0, 5.0, 21), np.linspace(0.0, HEIGHT, 5)),
        material=STEEL,
        pressure={"top": PRESSURE, "left": push},
        **fields,
    )
    base = Body(
        name="base",
        mesh=grid(np.arange(-12.0, 12.1, 0.7), np.linspace(-6.0, 0.0, 7)),
        material=STEEL,
        supports={"bottom": "xy"},
        **fields,
    )
    pair = ContactPair(slave=("block", "bottom"), master=("base", "top"), friction=friction)
    return Model(bodies=(block, base), contacts=(pair,))


def test_friction_alone_holds_a_pushed_block():
    """Its resultant is exactly the push, and no vertex carries more than friction allows."""
    push, friction = 100.0, 0.3
    solution = solve(pushed_block(push, friction))
    contact = solution.loaded.state.contacts[0]
    assert contact.normal.sum() == pytest.approx(PRESSURE * LENGTH, rel=1e-8)
    # the shear on the slave opposes the push, which points to +x as the slave's tangent does
    assert contact.tangential.sum() == pytest.approx(-push * HEIGHT, rel=1e-8)
    bound = friction * contact.normal
    assert (np.abs(contact.tangential) <= bound + 1e-7 * bound.max()).all()
    assert solution.audit().passed


@pytest.mark.parametrize("condense", [False, True], ids=["meshed", "condensed"])
def test_a_block_slides_where_coulomb_says(condense):
    """Push x height = friction x pressure x length is the limit: bracketed by 1 %."""
    friction = 0.1
    limit = friction * PRESSURE * LENGTH / HEIGHT
    held = solve(pushed_block(0.99 * limit, friction, condense=condense))
    contact = held.loaded.state.contacts[0]
    assert contact.tangential.sum() == pytest.approx(-0.99 * limit * HEIGHT, rel=1e-7)
    with pytest.raises(NotConverged):
        solve(pushed_block(1.01 * limit, friction, condense=condense))


def test_without_friction_a_pushed_block_is_refused():
    with pytest.raises(ValueError, match="'block' can move freely"):
        solve(pushed_block(1.0, 0.0))


def two_blocks(friction, top):
    """Two blocks of equal quad4 grids, the upper one pressed on its top and, half, on its side."""
    x, y = np.linspace(0.0, 6.0, 13), np.linspace(0.0, 3.0, 7)
    upper = Body(
        name="upper",
        mesh=grid(x, y),
        material=STEEL,
        element="quad4",
        supports={"left": "x"},
        pressure={"top": top, "right": top / 2},
    )
    lower = Body(
        name="lower",
        mesh=grid(x, y - 3.0),
        material=STEEL,
        element="quad4",
        supports={"left": "x", "bottom": "y"},
    )
    pair = ContactPair(slave=("upper", "bottom"), master=("lower", "top"), friction=friction)
    return Model(bodies=(upper, lower), contacts=(pair,))


@dataclass(frozen=True)
class Rough(FrictionLaw):
    """Five times the largest coefficient of Coulomb's law."""

    proportional = True

    def bound(self, at):
        return [(50.0, 0.0)]


def test_two_blocks_that_stick_deform_like_one():
    """Matching linear edges, hats on their vertices: sticking ties the nodes exactly."""
    parts = solve(two_blocks(Rough(), PRESSURE))
    status = parts.loaded.state.contacts[0].status
    assert (status == STICK).all()
    mesh = grid(np.linspace(0.0, 6.0, 13), np.linspace(-3.0, 3.0, 13))
    mesh = mesh.with_boundaries({"side": lambda m: (m[0] > 6.0 - 1e-9) & (m[1] > 0.0)})
    whole = Body(
        name="one",
        mesh=mesh,
        material=STEEL,
        element="quad4",
        supports={"left": "x", "bottom": "y"},
        pressure={"top": PRESSURE, "side": PRESSURE / 2},
    )
    one = solve(Model(bodies=(whole,)))
    where = {tuple(np.round(x, 6)): u for x, u in
             zip(one.nodes("one").T, one.displacement("one", "loaded").T, strict=True)}  # fmt: skip
    scale = np.abs(one.displacement("one", "loaded")).max()
    for body in ("upper", "lower"):
        for x, u in zip(parts.nodes(body).T, parts.displacement(body, "loaded").T, strict=True):
            assert u == pytest.approx(where[tuple(np.round(x, 6))], abs=1e-9 * scale)


def test_low_friction_lets_the_same_blocks_slip():
    """The tie above is friction's doing."""
    solution = solve(two_blocks(0.05, PRESSURE))
    assert (solution.loaded.state.contacts[0].status > STICK).any()


def test_a_body_that_is_lifted_has_no_contact_force_left():
    solution = solve(pushed_block(100.0, 0.3))
    contact = solution.unloaded.state.contacts[0]
    assert not contact.normal.any()
    assert not contact.tangential.any()


def punch_system(friction, yield_stress):
    """A punch 2 wide on a base, mean pressure 200 at load one; half of it."""
    material = Material(
        youngs_modulus=2e5,
        poisson_ratio=0.3,
        yield_stress=yield_stress,
        hardening="isotropic",
        hardening_ratio=0.05,
    )
    x = np.array([0.0, 0.4, 0.7, 0.85, 0.95, 1.0])
    punch = Body(
        name="punch",
        mesh=grid(x, np.linspace(0.0, 2.0, 7)),
        material=material,
        supports={"left": "x"},
        pressure={"top": 200.0},
    )
    base = Body(
        name="base",
        mesh=grid(np.concatenate([x, 1.0 + x[1:], np.linspace(2.5, 6.0, 6)]), -x[::-1] * 4.0),
        material=material,
        supports={"left": "x", "bottom": "y"},
    )
    pair = ContactPair(slave=("punch", "bottom"), master=("base", "top"), friction=friction)
    return System(Model(bodies=(punch, base), contacts=(pair,)))


def walk(system, loads):
    converged = None
    state = system.initial()
    for load in loads:
        converged = Increment(system, state, load).solve()
        state = converged.state
    return converged


UP, DOWN_AND_UP = np.linspace(0.2, 1.0, 5), [0.7, 0.4, 0.7, 1.0]


def test_unloading_and_reloading_a_frictionless_plastic_contact_is_elastic():
    """Back at the same load the same forces and stresses: isotropic hardening keeps the surface."""
    system = punch_system(0.0, 250.0)
    first = walk(system, UP)
    again = walk(system, [*UP, *DOWN_AND_UP])
    assert max(float(p.accumulated.max()) for p in first.state.plastic) > 1e-4
    for a, b in zip(first.state.plastic, again.state.plastic, strict=True):
        assert np.abs(a.accumulated - b.accumulated).max() < 1e-8
    for a, b in zip(first.responses, again.responses, strict=True):
        assert np.abs(a.stress - b.stress).max() < 1e-3


def test_unloading_leaves_friction_locked_in():
    """Halfway down, elastic bodies with friction are not where they were on the way up."""
    system = punch_system(0.2, np.inf)
    up = walk(system, [0.5]).state.contacts[0]
    down = walk(system, [0.5, 1.0, 0.5]).state.contacts[0]
    assert np.abs(down.tangential - up.tangential).max() > 0.02 * np.abs(up.tangential).max()
    assert down.normal.sum() == pytest.approx(up.normal.sum(), rel=1e-8)


@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_it_does_not_matter_which_body_is_the_slave(friction):
    """Pressure under an elastic punch, a fiftieth of a and more from the corner: within 1 %."""
    punch, plane = (
        press(5e-3, friction, size=8.0, slave=slave, growth=1.3)
        for slave in ("punch", "half_plane")
    )
    at = np.geomspace(0.02, 1.0, 15)
    for name in ("pressure", "shear"):
        ours, theirs = (np.interp(at, c.r, getattr(c, name)) for c in (punch, plane))
        assert theirs == pytest.approx(ours, rel=0.01, abs=0.01 * friction)
