"""A limit of contact shear, whatever the pressure: what a contact pair promises of it."""

from __future__ import annotations

from dataclasses import replace

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
    NotConverged,
    Pressure,
    Stage,
    Temperature,
    solve,
)
from solver.contact.problem import STICK
from solver.mesh import grid, mapped
from solver.model.friction import Coulomb
from solver.rolling.scenes.rolling import ROLLING, RollingParameters
from solver.rolling.scenes.rolling_model import model as rolling_model
from solver.scenes.punch import PunchParameters
from solver.scenes.punch_setup import model as punch_model

YIELD_STRESS, SHARE, PRESSURE = 300.0, 0.1, 100.0
STRENGTH = SHARE * YIELD_STRESS / np.sqrt(3)
LENGTH, HEIGHT = 10.0, 2.0
STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3)
WEAK, STRONG = (
    Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=factor * YIELD_STRESS)
    for factor in (1.0, 5.0)
)


def pushed_block(push, *, block=WEAK, base=STRONG, shear_limit=SHARE, thickness=1.0):
    """A block on a wide base, pressed down and pushed along it; friction could hold a tenfold."""
    bodies = (
        Body(
            name="block",
            mesh=grid(np.linspace(-5.0, 5.0, 21), np.linspace(0.0, HEIGHT, 5)),
            material=block,
            pressure={"top": PRESSURE, "left": push},
            thickness=thickness,
        ),
        Body(
            name="base",
            mesh=grid(np.arange(-12.0, 12.1, 0.7), np.linspace(-6.0, 0.0, 7)),
            material=base,
            supports={"bottom": "xy"},
            thickness=thickness,
        ),
    )
    law = Coulomb(friction=2.0, shear_limit=shear_limit)
    pair = ContactPair(slave=("block", "bottom"), master=("base", "top"), friction=law)
    return Model(bodies=bodies, contacts=(pair,))


FULL = STRENGTH * LENGTH / HEIGHT
"""The push at which the limit is reached everywhere."""


@pytest.mark.solves
@pytest.mark.parametrize("thickness", [1.0, 3.0])
def test_shear_reaches_the_limit_and_no_more(thickness):
    solution = solve(pushed_block(0.98 * FULL, thickness=thickness))
    (interface,), state = solution.system.interfaces, solution.loaded.state
    contact = state.contacts[0]
    shear = np.abs(contact.tangential) / interface.pairing(state.u).area
    assert shear.max() == pytest.approx(STRENGTH, rel=1e-6)
    # friction alone would let most of these points stick
    assert ((contact.status > STICK) & (shear > (1 - 1e-6) * STRENGTH)).sum() > 10
    assert contact.tangential.sum() == pytest.approx(-0.98 * FULL * HEIGHT * thickness, rel=1e-7)
    assert solution.audit().passed


def heated(model, hot, rise):
    """Return a model whose body ``hot`` loses 1e-3 of its yield stress with each kelvin."""
    heat = Temperature(rise=rise, expansion=0.0, yield_drop=1e-3)
    bodies = (replace(b, loads=(heat,) if b.name == hot else ()) for b in model.bodies)
    return Model(bodies=tuple(bodies), contacts=model.contacts)


@pytest.mark.solves
@pytest.mark.parametrize("hot", ["block", "base"])
def test_the_limit_falls_with_the_yield_stress_in_heat(hot):
    """Either body may be the hot one; 300 K take 0.3 of its strength, and of the limit."""
    bodies = {"block": WEAK, "base": STRONG} if hot == "block" else {"block": STRONG, "base": WEAK}
    full = 0.7 * FULL
    found = solve(heated(pushed_block(0.98 * full, **bodies), hot, 300.0))
    (interface,), state = found.system.interfaces, found.loaded.state
    contact = state.contacts[0]
    shear = np.abs(contact.tangential) / interface.pairing(state.u).area
    assert shear.max() == pytest.approx(0.7 * STRENGTH, rel=1e-6)
    assert contact.tangential.sum() == pytest.approx(-0.98 * full * HEIGHT, rel=1e-7)
    assert found.audit().passed
    with pytest.raises(NotConverged):
        solve(heated(pushed_block(1.02 * full, **bodies), hot, 300.0))


@pytest.mark.solves
@pytest.mark.parametrize("hot", ["block", "base"])
def test_the_limit_is_that_of_each_place(hot):
    """The temperature rises along the contact: the mean of the limit is that of its middle."""
    full, base = 0.7 * FULL, WEAK if hot == "base" else STRONG
    model = heated(pushed_block(0.995 * full, base=base), hot, lambda x: 300.0 + 50.0 * x[0] / 5.0)
    found = solve(model)
    (interface,), state = found.system.interfaces, found.loaded.state
    contact, pairing = state.contacts[0], interface.pairing(state.u)
    slides = contact.status > STICK
    x = interface.slave_surface.X[0, interface.slave_surface.vertices]
    inner = slides & (np.abs(x) < 4.9)
    shear = np.abs(contact.tangential) / pairing.area
    limit = SHARE * YIELD_STRESS / np.sqrt(3) * (0.7 - 0.05 * x / 5.0)
    assert inner.sum() > 5
    assert shear[inner] == pytest.approx(limit[inner], rel=1e-6)
    assert found.audit().passed


@pytest.mark.solves
def test_contact_that_is_heated_gives_way():
    """Pressed and pushed while cold, then heated: shear follows the limit down, and up no more."""
    first, then = Amplitude([0, 1], [0, 1]), Amplitude([1, 2, 3], [0, 1, 0])
    cold = pushed_block(0.0)
    push = (Pressure(boundary="top", value=PRESSURE, amplitude=first),
            Pressure(boundary="left", value=0.6 * FULL, amplitude=first))  # fmt: skip
    heat = Temperature(rise=300.0, expansion=0.0, yield_drop=1e-3, amplitude=then)
    loads = {"block": push, "base": (heat,)}
    bodies = tuple(replace(b, loads=loads[b.name], pressure={}) for b in cold.bodies)
    bodies = (bodies[0], replace(bodies[1], material=WEAK))
    stages = tuple(Stage(name=n, target=t, steps=4) for n, t in
                   (("pushed", 1.0), ("hot", 2.0), ("cold", 3.0)))  # fmt: skip
    found = solve(Model(bodies=bodies, contacts=cold.contacts), stages=stages)
    most = {}
    for name in ("pushed", "hot", "cold"):
        shear = found.contact(stage=name).shear
        most[name] = np.abs(shear).max()
        assert found.audit(name).passed, found.audit(name).violations
    assert most["pushed"] == pytest.approx(STRENGTH, rel=1e-6)
    assert most["hot"] == pytest.approx(0.7 * STRENGTH, rel=1e-6)
    assert most["cold"] < (1 - 1e-3) * STRENGTH


@pytest.mark.solves
@pytest.mark.parametrize("hot", ["wheel", "plane"])
def test_a_hot_wheel_that_is_dragged_keeps_the_limit(hot):
    """Surfaces are paired anew, and the heat is steep: the audit finds the same limit."""
    heat = Temperature(rise=lambda x: 200.0 * np.exp(-(x[0] ** 2) / 0.3), expansion=0.0,
                       yield_drop=2e-3)  # fmt: skip

    def ring(p):
        return np.stack([p[0] * np.cos(p[1]), 10.0 + p[0] * np.sin(p[1])])

    loads = {name: (heat,) if name == hot else () for name in ("wheel", "plane")}
    material = {name: WEAK if name == hot else STRONG for name in loads}
    moved = Displacement(boundary="left", x=0.02, y=-0.01)
    angles = np.linspace(-np.pi / 2 - 0.2, -np.pi / 2 + 0.2, 41)
    x, y = np.linspace(-2.0, 2.0, 45), np.linspace(-4.0, 0.0, 11)
    wheel = Body(
        name="wheel",
        mesh=mapped(grid(np.linspace(6.0, 10.0, 9), angles), ring),
        material=material["wheel"],
        loads=(*loads["wheel"], moved),
    )
    plane = Body(
        name="plane",
        mesh=grid(x, y),
        material=material["plane"],
        loads=loads["plane"],
        supports={"bottom": "xy"},
    )
    law = Coulomb(friction=0.4, shear_limit=0.5)
    pair = ContactPair(slave=("plane", "top"), master=("wheel", "right"), friction=law)
    found = solve(Model(bodies=(wheel, plane), contacts=(pair,)),
                  stages=(Stage(name="pressed", target=1.0, steps=8),))  # fmt: skip
    assert found.audit("pressed").passed, found.audit("pressed").violations
    contact = found.stages["pressed"].state.contacts[0]
    limited = (contact.status > STICK) & (np.abs(contact.tangential) < 0.39 * contact.normal)
    assert limited.sum() > 2


@pytest.mark.solves
def test_the_audit_asks_for_the_limit_of_the_hot_surface(monkeypatch):
    monkeypatch.setattr("solver.contact.interface._hot", lambda part, surface: None)
    found = solve(heated(pushed_block(0.9 * FULL), "block", 200.0))
    assert any(text.startswith("audit_friction_excess") for text in found.audit().violations)


@pytest.mark.solves
def test_a_block_slides_where_the_limit_says():
    """Pressure could hold ten times this push."""
    with pytest.raises(NotConverged):
        solve(pushed_block(1.01 * FULL))
    free = solve(pushed_block(1.01 * FULL, shear_limit=0.0))
    assert (free.loaded.state.contacts[0].status <= STICK).sum() > 10


@pytest.mark.solves
def test_the_weaker_body_sets_the_limit():
    """Which of the two it is does not matter, nor that the other never yields."""
    for block, base in ((WEAK, STEEL), (STRONG, WEAK)):
        found = solve(pushed_block(0.5 * FULL, block=block, base=base))
        (interface,), state = found.system.interfaces, found.loaded.state
        strength = interface.strength(interface.pairing(state.u), state.time)
        assert SHARE * strength == pytest.approx(STRENGTH)


@pytest.mark.parametrize("shear_limit", [-1.0, 99.0, np.inf, np.nan])
def test_a_limit_outside_of_its_range_is_refused(shear_limit):
    with pytest.raises(ModelError, match=r"^shear_limit = .*: must be (a finite number|at least)"):
        Coulomb(shear_limit=shear_limit)


def test_a_limit_between_elastic_bodies_is_refused():
    with pytest.raises(ModelError, match=r"shear_limit .*elastic"):
        pushed_block(1.0, block=STEEL, base=STEEL)
    pushed_block(1.0, block=STEEL, base=STEEL, shear_limit=0.0)


# -- in scenes ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parameters", "model", "fields"),
    [(PunchParameters, punch_model, {}), (RollingParameters, rolling_model, {"track": 50.0})],
    ids=["punch", "rolling"],
)
def test_scenes_take_a_limit_and_by_default_none(parameters, model, fields):
    (pair,) = model(parameters(shear_limit=0.9, friction=0.3, **fields)).contacts
    assert pair.law == Coulomb(friction=0.3, shear_limit=0.9)
    (pair,) = model(parameters(friction=0.3, **fields)).contacts
    assert pair.law == Coulomb(friction=0.3)


def test_a_prescribed_shear_has_no_limit():
    with pytest.raises(ModelError, match="shear_limit"):
        RollingParameters(load="hertz", shear_limit=0.9)


def locked_wheel(shear_limit, element_size):
    """Largest plastic strain of the surface under mid-track, the wheel having slid there."""
    parameters = RollingParameters(
        traction=1.0,
        track=6.0,
        growth=2.0,
        element_size=element_size,
        advance_step=3.0,
        press_steps=2,
        unload_steps=1,
        shear_limit=shear_limit,
    )
    (record,) = ROLLING.path(parameters, [1], lambda share: None)
    return record.scalars["surface_plastic_strain"]


@pytest.mark.solves
def test_a_limit_keeps_the_surface_under_a_locked_wheel_from_shearing():
    """Friction asks for 1.4 k: without a limit one row of elements shears, the finer the more."""
    coarse, fine = (locked_wheel(0.0, size) for size in (4.0, 2.0))
    assert fine > 2.0 * coarse
    limited_coarse, limited_fine = (locked_wheel(0.8, size) for size in (4.0, 2.0))
    assert limited_fine == pytest.approx(limited_coarse, rel=0.3)
    assert limited_fine < 0.1 * fine
