"""Rigid bodies: an indenter or a plate pressed by a force, a moment or a displacement."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from solver import Amplitude, Body, ContactPair, Coulomb, Material, Model, ModelError, Stage, solve
from solver.loading.program import PathControl
from solver.mesh import graded, grid
from solver.model.rigid import Moved, Pushed, RigidBody, RigidSurface, arc, line
from solver.results.increments import curve

pytestmark = pytest.mark.solves

E, NU = 2.0e5, 0.3
MODULUS = E / (1 - NU**2)
ELASTIC = Material(youngs_modulus=E, poisson_ratio=NU)
SOFT = replace(ELASTIC, yield_stress=400.0, hardening="isotropic", hardening_ratio=0.024)


def half_plane(smallest: float = 0.02, size: float = 200.0, **own: Any) -> Body:
    """Return a block that reaches far around contact at |x| < 1."""
    inside = 1.0 - graded(1.0, smallest, 1.4, 0.1)[::-1]
    outside = 1.0 + graded(size - 1.0, smallest, 1.4, size / 4)
    right = np.concatenate([inside, outside[1:]])
    x = right if own.get("kinematics") == "axisymmetric" else np.append(-right[:0:-1], right)
    y = -graded(size, smallest, 1.4, size / 4)[::-1]
    symmetric = {"left": "x"} if own.get("kinematics") == "axisymmetric" else {}
    own = {"material": ELASTIC, "supports": {"bottom": "xy", **symmetric}} | own
    return Body(name="half_plane", mesh=grid(x, y), **own)


def punch(**motions: Any) -> RigidBody:
    return RigidBody(name="punch", surfaces={"base": line((-1.0, 0.0), (1.0, 0.0))}, **motions)


def pressed(body: Body, rigid: RigidBody, surface: str = "base", **own: Any) -> Any:
    sliding, steps = own.pop("sliding", "small"), own.pop("steps", 1)
    pair = ContactPair(slave=("half_plane", "top"), master=(rigid.name, surface),
                       sliding=sliding, **own)  # fmt: skip
    model = Model(bodies=(body,), rigid=(rigid,), contacts=(pair,))
    return solve(model, control=PathControl(load_step=1.0 / steps))


def test_a_flat_punch_has_the_pressure_of_the_closed_form() -> None:
    force = 100.0
    found = pressed(half_plane(), punch(y=Pushed(value=-force)))
    acting = found.contact()
    x, pressure = acting.X, acting.pressure
    inside = np.abs(x[0]) < 0.9
    exact = force / (np.pi * np.sqrt(1 - x[0][inside] ** 2))
    assert pressure[inside] == pytest.approx(exact, rel=0.01)
    assert found.loaded.state.contacts[0].normal.sum() == pytest.approx(force, rel=1e-9)
    assert found.audit().passed, found.audit().violations


def test_an_eccentric_force_turns_the_punch_as_the_closed_form() -> None:
    # K.L. Johnson, Contact Mechanics (1985), section 2.9: slope 4 M / (pi E* a^2)
    force, moment = 100.0, 20.0
    found = pressed(half_plane(), punch(y=Pushed(value=-force), rotation=Pushed(value=moment)))
    turned = found.motion("punch", "loaded").rotation
    assert turned == pytest.approx(4 * moment / (np.pi * MODULUS), rel=0.01)
    acting = found.contact()
    x, pressure = acting.X, acting.pressure
    inside = np.abs(x[0]) < 0.9
    at = x[0][inside]
    exact = (force - 2 * moment * at) / (np.pi * np.sqrt(1 - at**2))
    assert pressure[inside] == pytest.approx(exact, rel=0.015)
    assert found.audit().passed, found.audit().violations


@pytest.mark.parametrize("material", [ELASTIC, SOFT])
def test_the_same_displacement_needs_the_same_force(material: Material) -> None:
    body = half_plane(0.1, material=material)
    by_force = pressed(body, punch(y=Pushed(value=-1200.0)), friction=0.2, steps=5)
    depth = by_force.motion("punch", "loaded").y
    by_depth = pressed(body, punch(y=Moved(value=depth)), friction=0.2, steps=5)
    fx, fy, moment = by_depth.reaction("punch", "loaded")
    assert fy == pytest.approx(-1200.0, rel=1e-3 if material is SOFT else 1e-6)
    assert abs(fx) < 1e-3
    assert abs(moment) < 1e-3
    assert by_depth.motion("punch", "unloaded").y == 0.0
    time, _, y, *_, force, turning = curve(by_depth.history, "punch")
    assert time.max() == 1.0
    assert y == pytest.approx(depth * time)
    assert force[np.argmax(time)] == pytest.approx(fy)
    assert np.abs(turning).max() < 1e-3
    assert (np.diff(force[: np.argmax(time) + 1]) < 0).all()
    held = [o.reactions["half_plane"][1] for o in by_depth.history]
    assert held == pytest.approx(-force, abs=1e-4)
    if material is SOFT:
        assert by_depth.plastic_strain("half_plane").max() > 1e-3
    for found in (by_force, by_depth):
        assert found.audit().passed, found.audit().violations
    state = by_depth.loaded.state
    for k in range(len(state.u[-1])):  # all three motions are prescribed
        u = (*state.u[:-1], state.u[-1] + 1e-5 * abs(depth) * np.eye(3)[k])
        check = replace(by_depth, stages={**by_depth.stages, "loaded": replace(
            by_depth.loaded, state=replace(state, u=u))}).audit()  # fmt: skip
        assert any("audit_prescribed" in text for text in check.violations), check.violations


@pytest.mark.parametrize(
    ("friction", "cohesion", "limit"), [(0.3, 0.0, 0.0), (0.0, 15.0, 0.0), (0.3, 15.0, 0.1)]
)
def test_a_block_pushed_sideways_slides_at_its_friction_and_cohesion(
    friction: float, cohesion: float, limit: float
) -> None:
    pressure = 100.0
    block = Body(name="block", mesh=grid(np.linspace(-1, 1, 9), np.linspace(0, 0.2, 3)),
                 material=SOFT, supports={"top": "x"}, pressure={"top": pressure},
                 loads=())  # fmt: skip
    plate = RigidBody(name="plate", surfaces={"top": line((3.0, 0.0), (-3.0, 0.0))},
                      x=Moved(value=0.02))  # fmt: skip
    law = Coulomb(friction=friction, cohesion=cohesion, shear_limit=limit)
    pair = ContactPair(slave=("block", "bottom"), master=("plate", "top"), friction=law)
    found = solve(Model(bodies=(block,), rigid=(plate,), contacts=(pair,)),
                  control=PathControl(load_step=0.1))  # fmt: skip
    normal, shear = found.loaded.state.contacts[0].normal, found.loaded.state.contacts[0].tangential
    assert normal.sum() == pytest.approx(2.0 * pressure)
    bound = min(friction * pressure + cohesion, (limit or np.inf) * SOFT.shear_yield_stress)
    slides = found.reaction("plate", "loaded")[0]
    assert np.abs(shear).sum() == pytest.approx(abs(slides))
    assert slides == pytest.approx(2.0 * bound, rel=0.1 if limit else 1e-6)
    assert found.audit().passed, found.audit().violations


@pytest.mark.parametrize("rigid_is_slave", [False, True])
def test_a_rigid_ball_on_a_half_space_is_the_contact_of_hertz(rigid_is_slave: bool) -> None:
    radius, force = 100.0, 2500.0
    a = (3 * force * radius / (4 * MODULUS)) ** (1 / 3)
    body = half_plane(0.03, size=100.0, kinematics="axisymmetric")
    edges = 25 if rigid_is_slave else 80
    ball = RigidBody(
        name="ball",
        # a slave finer than its master could not be followed by it
        surfaces={"cap": arc((0.0, radius), radius, (-np.pi / 2, 0.03 - np.pi / 2), edges)},
        y=Pushed(value=-force),
    )
    sides = [("half_plane", "top"), ("ball", "cap")]
    slave, master = sides[::-1] if rigid_is_slave else sides
    pair = ContactPair(slave=slave, master=master, sliding="finite")
    found = solve(Model(bodies=(body,), rigid=(ball,), contacts=(pair,)),
                  control=PathControl(load_step=0.5))  # fmt: skip
    acting = found.contact()
    x, pressure = acting.X, acting.pressure
    touching = found.loaded.state.contacts[0].normal > 0
    assert pressure.max() == pytest.approx(3 * force / (2 * np.pi * a**2), rel=0.01)
    assert x[0][touching].max() == pytest.approx(a, abs=0.12)  # an edge
    assert -found.motion("ball", "loaded").y == pytest.approx(a**2 / radius, rel=0.01)


def test_a_rotation_larger_than_small_moves_points_on_circles() -> None:
    body = half_plane(0.1, size=20.0)
    lever = RigidBody(
        name="lever", surfaces={"base": line((5.0, 0.0), (7.0, 0.0))}, centre=(0.0, 0.0),
        rotation=Moved(value=0.5), y=Moved(value=-0.5),
    )  # fmt: skip
    found = pressed(body, lever, sliding="finite")
    part, u = found.system.parts[1], found.loaded.state.u[1]
    chain = part.chain("base")
    at = chain.X + part.motion(chain, u)
    angle = 0.5
    assert at[:, 0] == pytest.approx([5 * np.cos(angle), 5 * np.sin(angle) - 0.5])


@pytest.mark.parametrize("turn", [0.6, -2.5])
def test_a_turn_in_one_increment_is_divided(turn: float) -> None:
    """A roller turned on a block drags it: as much in one increment of the program as in many."""
    block = Body(name="block", mesh=grid(np.linspace(-2.0, 2.0, 17), np.linspace(-2.0, 0.0, 9)),
                 material=Material(youngs_modulus=E, poisson_ratio=NU),
                 supports={"bottom": "xy"})  # fmt: skip
    first, then = Amplitude([0, 1], [0, 1]), Amplitude([1, 2], [0, 1])
    roller = RigidBody(
        name="roller",
        surfaces={"rim": arc((0.0, 5.0), 5.0, (-np.pi / 2 - 3.0, -np.pi / 2 + 3.0), 300)},
        centre=(0.0, 5.0),
        y=Moved(value=-0.02, amplitude=first),
        rotation=Moved(value=turn, amplitude=then),
    )
    pair = ContactPair(slave=("block", "top"), master=("roller", "rim"), friction=0.3)
    drags = []
    for steps in (1, 40):
        stages = (Stage(name="pressed", target=1.0, steps=4),
                  Stage(name="turned", target=2.0, steps=steps))  # fmt: skip
        found = solve(Model(bodies=(block,), rigid=(roller,), contacts=(pair,)), stages=stages)
        contact = found.stages["turned"].state.contacts[0]
        drags.append(contact.tangential.sum() / contact.normal.sum())
        assert len(found.tally.iterations) >= 4 + abs(turn) / 0.1
    assert abs(drags[0]) == pytest.approx(0.3, rel=1e-3), "it slides all over"
    assert drags[0] == pytest.approx(drags[1], rel=1e-3)


@pytest.mark.parametrize(
    ("own", "message"),
    [
        (
            {"surfaces": {"base": RigidSurface(points=np.zeros((2, 1)))}},
            "surfaces.base .* two or more",
        ),
        ({"surfaces": {"base": RigidSurface(points=np.zeros((2, 2)))}}, "must be distinct points"),
        ({"surfaces": {"base": RigidSurface(points=np.full((2, 2), np.nan))}}, "must be finite"),
        (
            {"surfaces": {"base": RigidSurface(points=np.eye(2), quadratic=True)}},
            "surfaces.base = .*must be points",
        ),
        ({"y": -100.0}, "y = -100.0: must be Moved or Pushed"),
        ({"centre": (np.nan, 0.0)}, r"centre\[0\] = nan: must be a finite number"),
        ({"thickness": 0.0}, r"thickness = 0.0: must be greater than 0 \[mm\]"),
    ],
)
def test_bad_rigid_bodies_are_refused(own: dict[str, Any], message: str) -> None:
    with pytest.raises(ModelError, match=message):
        replace(punch(), **own)
    with pytest.raises(ModelError, match=r"pushed.value = inf: must be a finite number"):
        Pushed(value=np.inf)


def test_models_with_bad_rigid_bodies_are_refused() -> None:
    body, one = half_plane(0.1, size=10.0), punch()
    with pytest.raises(ModelError, match="different names"):
        Model(bodies=(body,), rigid=(replace(one, name="half_plane"),))
    with pytest.raises(ModelError, match="must name a surface of the rigid body: base"):
        pressed(body, one, surface="side")
    with pytest.raises(ModelError, match="must not be two rigid bodies"):
        pair = ContactPair(slave=("punch", "base"), master=("other", "base"))
        Model(bodies=(body,), rigid=(one, replace(one, name="other")), contacts=(pair,))
    with pytest.raises(ModelError, match="must have x and rotation Moved"):
        ring = half_plane(0.1, size=10.0, kinematics="axisymmetric")
        Model(bodies=(ring,), rigid=(replace(one, x=Pushed(value=1.0)),))
    with pytest.raises(ModelError, match="'punch' can move freely"):
        pressed(body, replace(one, x=Pushed(value=1.0), y=Pushed(value=-1.0)))


@pytest.mark.divides
@pytest.mark.parametrize("steps", [1, 10])
def test_a_ball_that_is_moved_comes_and_goes_in_any_number_of_increments(steps: int) -> None:
    x = graded(20.0, 0.2, 1.5, 5.0)
    block = Body(name="block", mesh=grid(x, -x[::-1]), kinematics="axisymmetric",
                 material=Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=400.0),
                 supports={"left": "x", "bottom": "xy"})  # fmt: skip
    cap = arc((0.0, 10.0), 10.0, (-np.pi / 2, -np.pi / 2 + 0.3), 40)
    ball = RigidBody(name="ball", surfaces={"cap": cap}, y=Moved(value=-0.1))
    pair = ContactPair(slave=("block", "top"), master=("ball", "cap"))
    found = solve(Model(bodies=(block,), rigid=(ball,), contacts=(pair,)),
                  control=PathControl(load_step=1 / steps))  # fmt: skip
    assert found.tally.cuts == 0
    assert found.plastic_strain("block").max() > 0.05
    assert found.audit().passed, found.audit().violations


@pytest.mark.parametrize(
    ("down", "turning", "centre"),
    [
        (Moved(value=-2e-3), Moved(value=1e-4), 0.0),
        (Pushed(value=-200.0), Moved(value=1e-4), 0.0),
        (Pushed(value=-5000.0), Moved(value=1e-2), 0.0),
        (Pushed(value=-5000.0), Pushed(value=0.0), 2.0),
    ],
    ids=["moved", "pushed", "far", "free"],
)
def test_the_work_of_a_plate_that_turns_is_found_again(
    down: Moved | Pushed, turning: Moved | Pushed, centre: float
) -> None:
    """Under small sliding contact forces keep their directions: the balance is exact."""
    x = np.linspace(-5.0, 5.0, 11)
    block = Body(name="block", mesh=grid(x, x / 2 - 2.5), supports={"bottom": "xy"},
                 material=Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=800.0,
                                   hardening="isotropic", hardening_ratio=0.1))  # fmt: skip
    face = RigidSurface(points=np.array([[-6.0, 0.0], [6.0, 0.0]]).T)
    plate = RigidBody(name="plate", surfaces={"face": face}, centre=(centre, 0.0), y=down,
                      rotation=turning)  # fmt: skip
    pair = ContactPair(slave=("block", "top"), master=("plate", "face"), friction=0.3,
                       sliding="small")  # fmt: skip
    found = solve(Model(bodies=(block,), rigid=(plate,), contacts=(pair,)),
                  control=PathControl(load_step=0.25))  # fmt: skip
    assert abs(found.motion("plate").rotation) > 0.9e-4
    assert found.audit().figures["audit_energy"] < 1e-9


def test_the_work_of_an_elastic_plate_on_normals_that_turn_is_found_in_increments() -> None:
    """In one increment 1.7e-3 of it was missing."""
    x = np.linspace(-5.0, 5.0, 11)
    block = Body(name="block", mesh=grid(x, x / 2 - 2.5), supports={"bottom": "xy"},
                 material=ELASTIC)  # fmt: skip
    plate = RigidBody(name="plate", surfaces={"face": line((-6.0, 0.0), (6.0, 0.0))},
                      y=Pushed(value=-5000.0), rotation=Moved(value=1e-2))  # fmt: skip
    pair = ContactPair(slave=("block", "top"), master=("plate", "face"), friction=0.3,
                       sliding="finite")  # fmt: skip
    found = solve(Model(bodies=(block,), rigid=(plate,), contacts=(pair,)))
    assert found.audit().figures["audit_energy"] < 2e-5
