"""What friction holds, what it does not hold, and what no friction must hold."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from solver import (
    Amplitude,
    Body,
    ContactPair,
    LimitLoad,
    Material,
    Model,
    ModelError,
    Moved,
    Pushed,
    RigidBody,
    Solution,
    Stage,
    Traction,
    solve,
)
from solver.loading import stepper
from solver.loading.limit import spent
from solver.mesh import grid, mapped
from solver.model.friction import Coulomb, lines_of
from solver.model.rigid import arc

pytestmark = pytest.mark.solves

ELASTIC = Material(youngs_modulus=2e5, poisson_ratio=0.3)
AREA = np.pi * (25.0**2 - 10.0**2)
FIRST, THEN = Amplitude([0, 1], [0, 1]), Amplitude([1, 2], [0, 1])
STAGES = (Stage(name="fitted", target=1.0, steps=4), Stage(name="pushed", target=2.0, steps=16))


def pushed(push: float, stages: Any = STAGES, **own: Any) -> Solution:
    """Press a hub on a shaft, then push it along [MPa on its end]."""
    shaft = Body(name="shaft", mesh=grid(np.linspace(0, 10, 5), np.linspace(-5, 25, 13)),
                 material=ELASTIC, kinematics="axisymmetric",
                 supports={"left": "x", "bottom": "y"})  # fmt: skip
    hub = Body(name="hub", mesh=grid(np.geomspace(10, 25, 7), np.linspace(0, 20, 9)),
               material=ELASTIC, kinematics="axisymmetric",
               loads=(Traction(boundary="top", y=-push, amplitude=THEN),))  # fmt: skip
    pair = ContactPair(slave=("hub", "left"), master=("shaft", "right"), interference=0.01,
                       amplitude=FIRST, **own)  # fmt: skip
    return solve(Model(bodies=(shaft, hub), contacts=(pair,)), stages=stages)


@pytest.mark.parametrize(
    ("own", "sliding"),
    [({"friction": 0.1}, "small"), ({"friction": 0.05, "cohesion": 8.0}, "finite")],
)
def test_a_fit_is_pushed_off_by_as_much_as_friction_bears(
    own: dict[str, Any], sliding: str
) -> None:
    given = {"friction": Coulomb(**own), "sliding": sliding}
    held = pushed(2.0, **given)
    along = held.stages["pushed"].state.contacts[0].tangential.sum()
    tilt = 1e-3 if sliding == "finite" else 1e-6  # of the deformed surface
    assert along == pytest.approx(-2.0 * AREA, rel=tilt)
    assert held.audit("pushed").passed, held.audit("pushed").violations
    normal = held.stages["pushed"].state.contacts[0].normal.sum()
    borne = own["friction"] * normal + own.get("cohesion", 0.0) * 2 * np.pi * 10.0 * 20.0
    with pytest.raises(LimitLoad, match="body 'hub' slides on all its contacts") as caught:
        pushed(20.0, **given)
    error = caught.value
    reached, attempted = ((time - 1.0) * 20.0 * AREA for time in (error.reached, error.attempted))
    # pushed from one end the hub grows thicker, and friction bears a little more
    assert reached < 1.01 * borne
    assert attempted > 0.99 * borne


def test_a_drum_slides_in_its_belt_where_the_rope_formula_says() -> None:
    """A belt held at one end, pulled at the other, bears a moment F R (1 - exp(-mu angle))."""
    radius, thick, friction, pull, angle = 10.0, 0.2, 0.2, 50.0, 0.6 * np.pi
    turn = -np.pi / 2 + angle / 2

    def around(p: np.ndarray) -> np.ndarray:
        return (radius + p[1]) * np.stack([np.sin(p[0]), np.cos(p[0])])

    mesh = mapped(grid(np.linspace(-angle / 2, angle / 2, 15), np.array([0, thick / 2, thick])),
                  around)  # fmt: skip
    belt = Body(name="belt", mesh=mesh, material=ELASTIC, supports={"left": "xy"},
                loads=(Traction(boundary="right", x=-pull * np.sin(turn), y=-pull * np.cos(turn),
                                amplitude=FIRST),))  # fmt: skip
    face = arc((0.0, 0.0), radius, (0.1 * np.pi, 0.9 * np.pi), 60)
    largest = 2.0 * pull * thick * radius
    drum = RigidBody(name="drum", surfaces={"face": face}, centre=(0.0, 0.0),
                     rotation=Pushed(value=largest, amplitude=THEN))  # fmt: skip
    pair = ContactPair(slave=("belt", "bottom"), master=("drum", "face"), friction=friction,
                       sliding="finite")  # fmt: skip
    with pytest.raises(LimitLoad, match="body 'drum' slides on all its contacts") as caught:
        solve(Model(bodies=(belt,), rigid=(drum,), contacts=(pair,)), stages=STAGES)
    share = -np.expm1(-friction * angle) / 2.0
    # the belt has a thickness, and bends over the edges of its mesh
    assert caught.value.reached - 1.0 < 1.02 * share
    assert caught.value.attempted - 1.0 > 0.96 * share


def test_stages_have_names_of_their_own() -> None:
    twice = (Stage(name="on", target=1.0), Stage(name="on", target=2.0))
    with pytest.raises(ModelError, match=r"stages = .*different names"):
        pushed(2.0, stages=twice)
    with pytest.raises(ModelError, match="stage = 'loaded': must be one of fitted, pushed"):
        pushed(2.0, friction=0.3).contact()


def wheel(overlap: float, **own: Any) -> Solution:
    """Lay a piece of a wheel that contact alone holds on a block, push it down and sideways."""
    angles = np.linspace(-np.pi / 2 - 0.6, -np.pi / 2 + 0.6, 49)

    def to_ring(p: np.ndarray) -> np.ndarray:
        return np.stack([p[0] * np.cos(p[1]), 10.0 - overlap + p[0] * np.sin(p[1])])

    piece = Body(name="piece", mesh=mapped(grid(np.linspace(6.0, 10.0, 7), angles), to_ring),
                 material=ELASTIC, **own)  # fmt: skip
    block = Body(name="block", mesh=grid(np.linspace(-4.0, 4.0, 65), np.linspace(-4.0, 0.0, 17)),
                 material=ELASTIC, supports={"bottom": "xy"})  # fmt: skip
    pair = ContactPair(slave=("piece", "right"), master=("block", "top"), friction=0.3)
    return solve(Model(bodies=(piece, block), contacts=(pair,)))


@pytest.mark.parametrize("aside", [0.05, 0.2])
def test_friction_holds_a_body_from_its_first_contact(aside: float) -> None:
    """Both loads grow together: friction carries what pushes sideways in every increment."""
    found = wheel(0.0, loads=(Traction(boundary="left", x=-100.0 * aside, y=-100.0),))
    contact = found.loaded.state.contacts[0]
    for observed in found.history[1:-1]:
        across, up, _ = observed.reactions["block"]
        assert across == pytest.approx(aside * up, rel=1e-6)
    assert (np.abs(contact.tangential) <= 0.3 * contact.normal + 1e-6 * up).all()


def test_bodies_that_overlap_part_without_friction() -> None:
    """Nothing slid where they overlap before loading: no shear is left by pushing them apart."""
    found = wheel(0.02, supports={"left": "xy"})
    contact = found.loaded.state.contacts[0]
    assert contact.normal.sum() > 100.0
    assert np.abs(contact.tangential).max() == 0.0


def test_friction_that_is_almost_spent_is_told_with_its_bodies() -> None:
    area = np.array([1.0, 2.0, 1.0])
    interface = SimpleNamespace(slave=0, master=1)

    def found(law: Coulomb, share: float) -> str:
        normal = np.array([1.0, 3.0, 0.0])
        contact = SimpleNamespace(normal=normal, tangential=-0.3 * share * normal)
        at: Any = SimpleNamespace(n=3)
        system: Any = SimpleNamespace(
            interfaces=[interface], all_names=["pad", "plate"],
            pairing=lambda state, pair: SimpleNamespace(area=area),
            bound=lambda pair, pairing, start, time: lines_of(law, at),
        )  # fmt: skip
        state: Any = SimpleNamespace(contacts=[contact], time=1.0)
        return spent(system, state)

    told = "; just before, friction between pad and plate was at 97%"
    assert found(Coulomb(friction=0.3), 0.97).startswith(told)
    assert found(Coulomb(friction=0.3), 0.9) == ""
    assert found(Coulomb(friction=0.3, cohesion=0.1), 0.97) == ""
    assert found(Coulomb(), 0.97) == ""


@pytest.mark.parametrize("overlap", [1e-7, 1e-5, 1e-3])
@pytest.mark.parametrize("material", [ELASTIC, replace(ELASTIC, yield_stress=400.0)])
def test_a_block_that_friction_holds_may_be_meshed_a_little_too_deep(
    overlap: float, material: Material
) -> None:
    """Nothing but friction holds it, and before loading there is none: it is set on the base."""
    block = Body(name="block", mesh=grid(np.linspace(0, 10, 6), np.linspace(-overlap, 2, 3)),
                 material=ELASTIC, pressure={"top": 10.0},
                 loads=(Traction(boundary="right", x=5.0),))  # fmt: skip
    base = Body(name="base", mesh=grid(np.linspace(-4, 14, 13), np.linspace(-6, 0, 5)),
                material=material, supports={"bottom": "xy"})  # fmt: skip
    pair = ContactPair(slave=("block", "bottom"), master=("base", "top"), friction=0.3)
    found = solve(Model(bodies=(block, base), contacts=(pair,)))
    contact = found.loaded.state.contacts[0]
    assert contact.normal.sum() == pytest.approx(100.0)
    assert contact.tangential.sum() == pytest.approx(-10.0 - 5.0 * overlap, rel=1e-3)
    assert found.audit().passed, found.audit().violations


def test_a_taper_that_overlaps_stays_in_its_fit() -> None:
    """A slope of 0.05: to part the bodies, the hub would have to move by twenty overlaps."""

    def cone(p: np.ndarray) -> np.ndarray:
        return np.stack([p[0] + 0.05 * (20.0 - p[1]), p[1]])

    def tip(p: np.ndarray) -> np.ndarray:
        return np.stack([p[0] * (1 + 0.005 * (20.0 - p[1])), p[1]])

    inner = grid(np.linspace(0.0, 10.0, 6), np.linspace(-5.0, 25.0, 16))
    shaft = Body(name="shaft", mesh=mapped(inner, tip), material=ELASTIC,
                 kinematics="axisymmetric", supports={"left": "x", "bottom": "y"})  # fmt: skip
    outer = grid(np.linspace(9.99, 25.0, 8), np.linspace(0.0, 20.0, 11))
    hub = Body(name="hub", mesh=mapped(outer, cone), material=ELASTIC, kinematics="axisymmetric")
    pair = ContactPair(slave=("hub", "left"), master=("shaft", "right"), friction=0.3)
    found = solve(Model(bodies=(shaft, hub), contacts=(pair,)),
                  stages=(Stage(name="fitted", target=1.0),))  # fmt: skip
    assert found.stages["fitted"].state.contacts[0].normal.sum() > 1e4
    assert np.abs(found.displacement("hub", "fitted")).max() < 0.02


def test_a_fit_that_is_loaded_in_cycles_is_judged_by_its_last_touch(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What was not known of the friction of a contact that has opened since does not count.

    Increments are not divided: parts that end before the touch would leave nothing unknown.
    """
    monkeypatch.setattr(stepper, "_SHORTEST", 1.0)
    times = np.arange(9.0)
    load = Amplitude(times, times % 2)
    block = Body(name="block", mesh=grid(np.linspace(-4, 4, 17), np.linspace(-4, 0, 9)),
                 material=ELASTIC, supports={"bottom": "xy"})  # fmt: skip
    ball = RigidBody(name="ball", surfaces={"cap": arc((0.0, 20.0), 20.0, (-1.77, -1.37), 20)},
                     x=Moved(value=0.002, amplitude=load),
                     y=Moved(value=-0.02, amplitude=load))  # fmt: skip
    pair = ContactPair(slave=("block", "top"), master=("ball", "cap"), friction=0.3)
    stages = tuple(Stage(name=str(k), target=float(k), steps=2) for k in range(1, 8))
    found = solve(Model(bodies=(block,), rigid=(ball,), contacts=(pair,)), stages=stages)
    first, last = (found.audit(name).figures["audit_touch_time"] for name in ("1", "7"))
    assert 0 < last <= 1.01 * first


@pytest.mark.parametrize("solver", ["auto", "superlu"])
def test_a_surface_that_supports_hold_bears_contact(solver):
    """A rigid die: all unknowns of its contact surface are held."""
    die = Body(
        name="die",
        mesh=grid(np.linspace(0.0, 4.0, 5), np.linspace(-1.0, 0.0, 3)),
        material=ELASTIC,
        supports={"top": "xy", "bottom": "xy"},
        condense=False,
    )
    block = Body(
        name="block",
        mesh=grid(np.linspace(0.5, 3.5, 4), np.linspace(0.0, 1.0, 3)),
        material=ELASTIC,
        pressure={"top": 50.0},
        supports={"left": "x"},
    )
    pair = ContactPair(slave=("block", "bottom"), master=("die", "top"))
    solution = solve(Model(bodies=(die, block), contacts=(pair,)), linear_solver=solver)
    pressure = solution.contact().pressure
    assert pressure == pytest.approx(50.0, rel=1e-6)
