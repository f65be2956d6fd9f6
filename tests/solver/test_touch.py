"""What acts between bodies, where nothing does."""

from __future__ import annotations

import numpy as np

from solver import Body, Material, Model, System
from solver.mesh import grid
from solver.results.touch import Nothing, touch_of

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3)


def test_bodies_that_nothing_joins_have_no_contact_pressure_and_no_contact_width() -> None:
    side = np.linspace(0.0, 1.0, 3)
    bodies = tuple(
        Body(name=name, mesh=grid(side, side), material=STEEL, supports={"bottom": "xy"})
        for name in ("one", "other")
    )
    system = System(Model(bodies=bodies))
    touch = touch_of(system, symmetric=False)
    assert isinstance(touch, Nothing)
    state = system.initial()
    for values in touch.along(state, side):
        assert values.shape == side.shape
        assert np.isnan(values).all()
    assert np.isnan([*touch.extent(state), touch.force(state)]).all()
    assert touch.centre(state) == 0.0
