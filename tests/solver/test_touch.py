"""What acts between bodies, where nothing does."""

from __future__ import annotations

import numpy as np
import pytest

from solver import Body, Material, Model, System
from solver.mesh import grid
from solver.results.slave import Slave
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


@pytest.mark.parametrize("noise", [-1e-13, 0.0, 1e-13])
def test_a_contact_of_few_vertices_is_as_long_whatever_rounding_does(noise: float) -> None:
    """The third to fifth of seven from an end lie around the middle, where nothing falls."""
    s = np.arange(11.0)
    pressure = np.sqrt(np.maximum(1 - ((s - 5) / 3.5) ** 2, 0.0))
    pressure[4:7] *= 1 + noise * (s[4:7] - 5)
    none = np.zeros_like(s)
    slave = Slave(s, np.stack([s, none]), pressure, none, pressure, none, none, pressure > 0)
    assert slave.length == 6.0
