"""Contact forces that turn with surfaces: derivatives, and Newton's method with them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from solver import (
    Body,
    ContactPair,
    Link,
    Material,
    Model,
    Pushed,
    RigidBody,
    Stage,
    Traction,
    solve,
)
from solver.contact.geometry import Pairing, pair
from solver.contact.state import ContactState
from solver.contact.system import System
from solver.contact.turning import turning
from solver.errors import NotConverged
from solver.fem.rigid import MovingFrame
from solver.mesh import grid
from solver.model.rigid import line
from solver.typing import Array


def standing(pressure: float, element: str = "quad4", **sides: Any) -> Model:
    """An elastic block on an elastic base, under a dead load that leans by 2 %."""
    law = Material(youngs_modulus=1e3, poisson_ratio=0.3)
    shared = {"material": law, "kinematics": "plane_strain", "strain": "large", "element": element}
    leaning = Traction(boundary="top", x=0.02 * pressure, y=-pressure)
    block = Body(name="block", mesh=grid(np.linspace(-1, 1, 7), np.linspace(0, 4, 13)),
                 loads=(leaning,), **shared)  # fmt: skip
    base = Body(name="base", mesh=grid(np.linspace(-4, 4, 17), np.linspace(-3, 0, 7)),
                supports={"bottom": "xy"}, **shared)  # fmt: skip
    pairs = {"slave": ("block", "bottom"), "master": ("base", "top")} | sides
    return Model(bodies=(block, base), contacts=(ContactPair(friction=0.5, **pairs),))


@pytest.mark.parametrize("along_master", [False, True])
@pytest.mark.parametrize("element", ["quad4", "quad8"])
def test_forces_turn_with_the_surfaces_as_their_differences_do(
    element: str, along_master: bool
) -> None:
    system, rng = System(standing(1.0, element)), np.random.default_rng(7)
    (interface,) = (replace(each, along_master=along_master) for each in system.interfaces)
    slave, master = interface.slave_surface, interface.master_surface
    n, cut = len(slave.vertices), slave.X.size
    at = 2e-3 * rng.standard_normal(cut + master.X.size)
    if along_master:  # a surface without kinks, where the forces would jump
        x = master.X[0]
        at[cut:] = np.stack([0 * x, 0.01 * x + 0.02 * x**2 * (element == "quad8")]).T.ravel()
    zero = ContactState.at_rest(np.zeros(n), np.ones(n, dtype=bool), finite=True, before=None)
    contact = replace(zero, normal=rng.random(n), tangential=rng.standard_normal(n))

    def forces(u: Array) -> tuple[Array, Pairing]:
        own, other = (of.reshape(-1, 2).T for of in np.split(u, [cut]))
        found = pair(slave, own, master, other, along_master=along_master)
        both = zip(found.normal, found.tangent, strict=True)
        each = [contact.normal @ normal + contact.tangential @ along for normal, along in both]
        return np.concatenate(each), found

    numbers, K = turning(forces(at)[1], interface, contact)
    for _ in range(3):
        way, change = rng.standard_normal(len(at)), np.zeros(len(at))
        change[numbers] = K @ way[numbers]
        once, twice = (
            (forces(at + h * way)[0] - forces(at - h * way)[0]) / (2 * h) for h in (1e-5, 2e-5)
        )
        expected = (4 * once - twice) / 3
        assert np.abs(expected).max() > 0.1
        assert change == pytest.approx(expected, abs=1e-7 * np.abs(expected).max())


def test_arms_swing_with_a_rigid_body() -> None:
    frame, q = MovingFrame(centre=np.array([1.0, 2.0]), radius=3.0), np.array([0.1, 0.2, 0.7])
    X, step = np.array([[0.0, 2.0], [1.0, 5.0]]), np.array([0.0, 0.0, 1e-3])
    ahead, here, back = (frame.displacements(at, X) for at in (q + step, q, q - step))
    expected = (ahead - 2 * here + back).T.ravel() / 1e-6
    assert frame.swinging(q, X) == pytest.approx(expected, abs=1e-6)


def test_forces_of_links_turn_with_their_frame_as_differences_do() -> None:
    law = Material(youngs_modulus=1e3, poisson_ratio=0.3)
    block = Body(name="block", mesh=grid(np.linspace(-1, 1, 3), np.linspace(0, 1, 3)),
                 material=law, strain="large", element="quad4", kinematics="plane_strain",
                 supports={"bottom": "xy"})  # fmt: skip
    hub = RigidBody(name="hub", centre=(0.3, 2.0), rotation=Pushed())
    links = (Link(slave=("block", "left"), rigid="hub", components="x", stiffness=10.0),
             Link(slave=("block", "top"), rigid="hub"))  # fmt: skip
    system = System(Model(bodies=(block,), rigid=(hub,), links=links))
    rng, sizes = np.random.default_rng(3), [part.n for part in system.parts]
    u = 0.3 * rng.standard_normal(sum(sizes))
    F, way = rng.standard_normal(len(system.links)), rng.standard_normal(len(u))

    def at(u: Array) -> Any:
        return system.links.at(each := np.split(u, [sizes[0]])), each

    def forces(u: Array) -> Array:
        return np.concatenate([at(u)[0].on_part(k, F, size) for k, size in enumerate(sizes)])

    change, (links_at, each) = np.zeros(len(u)), at(u)
    for dofs, K in links_at.turning(each, F):
        change[dofs] += K @ way[dofs]
    expected = (forces(u + 1e-5 * way) - forces(u - 1e-5 * way)) / 2e-5
    assert np.abs(expected).max() > 0.1
    assert change == pytest.approx(expected, abs=1e-8 * np.abs(expected).max())


@pytest.mark.solves
@pytest.mark.parametrize("slave", ["block", "base"])
def test_a_block_that_contact_alone_holds_upright_converges_quadratically(slave: str) -> None:
    """Without forces that turn the last increments take 13 and 14 iterations."""
    model = standing(20.0)
    pairs = model.contacts[0]
    if slave == "base":
        model = standing(20.0, slave=pairs.master, master=pairs.slave)
    found = solve(model, stages=(Stage(name="loaded", target=1.0, steps=10),))
    assert max(found.tally.iterations) <= 3
    assert np.ptp(found.displacement("block", "loaded")[0]) == pytest.approx(0.083, abs=0.001)


@pytest.mark.solves
def test_a_block_that_tips_over_is_no_limit_load() -> None:
    with pytest.raises(NotConverged, match="may buckle, tip over or neck") as error:
        solve(standing(40.0), stages=(Stage(name="loaded", target=1.0, steps=10),))
    assert type(error.value) is NotConverged
    assert 0.85 < error.value.reached < 0.92


@pytest.mark.solves
def test_a_rigid_body_that_rests_on_large_strain_converges_quadratically() -> None:
    """Its force acts high above the contact, so that its arm turns with it."""
    law = Material(youngs_modulus=1e3, poisson_ratio=0.3)
    base = Body(name="base", mesh=grid(np.linspace(-2, 2, 17), np.linspace(-2, 0, 9)), material=law,
                kinematics="plane_strain", strain="large", element="quad4",
                supports={"bottom": "xy"})  # fmt: skip
    plate = RigidBody(name="plate", surfaces={"face": line((-3.0, 0.0), (3.0, 0.0))},
                      centre=(0.0, 4.0), x=Pushed(value=6.0), y=Pushed(value=-120.0),
                      rotation=Pushed(value=8.0))  # fmt: skip
    pair = ContactPair(slave=("base", "top"), master=("plate", "face"), friction=0.4)
    model = Model(bodies=(base,), rigid=(plate,), contacts=(pair,))
    found = solve(model, stages=(Stage(name="loaded", target=1.0, steps=6),))
    assert max(found.tally.iterations) <= 3
    assert found.motion("plate", "loaded").rotation == pytest.approx(-0.04043 / 5.0, rel=1e-3)


@pytest.mark.solves
def test_tied_blocks_that_stand_on_a_base_converge() -> None:
    """Links hold the upper block, and contact the lower one."""
    model = standing(10.0)
    block, base = model.bodies
    lower = replace(block, mesh=grid(np.linspace(-1, 1, 7), np.linspace(0, 2, 7)), loads=())
    upper = replace(block, name="upper", mesh=grid(np.linspace(-1, 1, 6), np.linspace(2, 4, 7)))
    tie = Link(slave=("upper", "bottom"), master=("block", "top"))
    tied = replace(model, bodies=(lower, upper, base), links=(tie,))
    found = solve(tied, stages=(Stage(name="loaded", target=1.0, steps=4),))
    contact = found.contact()
    assert contact.pressure @ contact.area == pytest.approx(20.0, rel=2e-3)
    assert max(found.tally.iterations) <= 3
