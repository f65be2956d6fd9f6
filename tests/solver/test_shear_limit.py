"""A limit of contact shear, whatever the pressure: what a contact pair promises of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver import Body, ContactPair, Material, Model, ModelError, NotConverged, Temperature, solve
from solver.contact.problem import STICK
from solver.mesh import grid
from solver.scenes.punch import PunchParameters
from solver.scenes.punch import model as punch_model
from solver.scenes.rolling import ROLLING
from solver.scenes.rolling_model import model as rolling_model
from solver.scenes.rolling_parameters import RollingParameters

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
    pair = ContactPair(
        slave=("block", "bottom"), master=("base", "top"), friction=2.0, shear_limit=shear_limit
    )
    return Model(bodies=bodies, contacts=(pair,))


@pytest.mark.parametrize("hot", ["block", "base"])
def test_a_share_of_the_cold_strength_is_no_limit_in_heat(hot):
    """Heat may make either body the weaker one."""
    model = pushed_block(0.5 * FULL)
    heat = Temperature(rise=300.0, expansion=0.0, yield_drop=1e-3)

    def heated(load, contacts):
        bodies = (replace(b, loads=(load,) if b.name == hot else ()) for b in model.bodies)
        return Model(bodies=tuple(bodies), contacts=contacts)

    with pytest.raises(ModelError, match=f"shear_limit = .*: must be inf where heat .* of '{hot}'"):
        heated(heat, model.contacts)
    heated(heat, tuple(replace(pair, shear_limit=np.inf) for pair in model.contacts))
    heated(replace(heat, yield_drop=0.0, modulus_drop=1e-3), model.contacts)


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


@pytest.mark.solves
def test_a_block_slides_where_the_limit_says():
    """Pressure could hold ten times this push."""
    with pytest.raises(NotConverged):
        solve(pushed_block(1.01 * FULL))
    free = solve(pushed_block(1.01 * FULL, shear_limit=np.inf))
    assert (free.loaded.state.contacts[0].status <= STICK).sum() > 10


@pytest.mark.solves
def test_the_weaker_body_sets_the_limit():
    """Which of the two it is does not matter, nor that the other never yields."""
    for block, base in ((WEAK, STEEL), (STRONG, WEAK)):
        (interface,) = solve(pushed_block(0.5 * FULL, block=block, base=base)).system.interfaces
        assert interface.shear_strength == pytest.approx(STRENGTH)


@pytest.mark.parametrize("shear_limit", [0.0, -1.0, np.nan])
def test_a_limit_that_is_not_positive_is_refused(shear_limit):
    with pytest.raises(ModelError, match="shear_limit"):
        pushed_block(1.0, shear_limit=shear_limit)


def test_a_limit_between_elastic_bodies_is_refused():
    with pytest.raises(ModelError, match=r"shear_limit .*elastic"):
        pushed_block(1.0, block=STEEL, base=STEEL)
    pushed_block(1.0, block=STEEL, base=STEEL, shear_limit=np.inf)


# -- in scenes ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parameters", "model", "fields"),
    [(PunchParameters, punch_model, {}), (RollingParameters, rolling_model, {"track": 50.0})],
    ids=["punch", "rolling"],
)
def test_scenes_take_a_limit_and_by_default_none(parameters, model, fields):
    (pair,) = model(parameters(shear_limit=0.9, friction=0.3, **fields)).contacts
    assert (pair.shear_limit, pair.friction) == (0.9, 0.3)
    (pair,) = model(parameters(friction=0.3, **fields)).contacts
    assert np.isinf(pair.shear_limit)


def test_a_prescribed_shear_has_no_limit():
    with pytest.raises(ModelError, match="shear_limit"):
        RollingParameters(load="hertz", shear_limit=0.9)


def locked_wheel(shear_limit, element_size):
    """Largest plastic strain of the surface under mid-track, the wheel having slid there."""
    parameters = RollingParameters(
        traction=1.0,
        track=16.0,
        element_size=element_size,
        advance_step=4.0,
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
