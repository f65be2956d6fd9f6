"""Three values of residual stress at the surface of a rolled track, and how they settle.

Recovered at the nodes, at the first row of integration points, and by the conditions of a free
surface. On the default track, increments of 1 mm, elements of 4 / 2 / 1 / 0.5 mm that grow in depth
with their side, sigma_x in MPa:

                  free rolling               braking 75 %
    nodal         468 / 436 / 350 / 324      143 /  27 / -43 /  -54
    first row     256 / 304 / 318 / 320      100 /  32 / -14 /  -27
    free surface  253 / 310 / 320 / 321      394 / 148 /  67 / -100

A study affords those; here a shorter track and larger increments tell the same.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from solver import SCENES, Status
from solver.rolling.scenes.rolling import RollingParameters


@cache
def scalars(element_size, traction=0.0):
    """The figures of one pass over a short track."""
    parameters = RollingParameters(
        element_size=element_size, growth=1.15**element_size, advance_step=2.0, track=20.0,
        press_steps=4, unload_steps=1, traction=traction,
    )  # fmt: skip
    (record,) = SCENES["rolling"].path(parameters, [1], lambda share: None)
    assert record.status is Status.OK, record.message
    return record.scalars


def values(element_size, component, traction=0.0):
    """Residual stress at the surface: nodal, first row, free surface [MPa]."""
    found = scalars(element_size, traction)
    kinds = ("surface", "first_row", "free_surface")
    return np.array([found[f"{kind}_residual_{component}"] for kind in kinds])


def test_first_row_lies_where_two_gauss_points_put_it():
    """The first side is at most the element size: sides are scaled to fill their depth."""
    gauss = (1 - 1 / np.sqrt(3)) / 2
    assert 0.7 * gauss * 3.0 < scalars(3.0)["first_row_depth"] <= gauss * 3.0


def test_free_rolling_leaves_the_free_surface_what_the_first_row_has():
    """Little flows at the surface, and the nodal value is extrapolated beyond both."""
    nodal, row, free = values(2.0, "x")
    assert free == pytest.approx(row, rel=0.05)
    assert nodal > 1.15 * max(row, free)


def test_free_rolling_settles_at_first_row_and_free_surface_before_the_nodes():
    coarse_nodal, *coarse = values(3.0, "x")
    free = values(2.0, "x")[2]
    assert np.abs(np.array(coarse) - free).max() < 0.5 * (coarse_nodal - free)


@pytest.mark.parametrize("component", ["x", "z"])
def test_a_braked_surface_is_better_known_at_the_first_row(component):
    """Braking makes a thin layer flow: plastic strain of the row is not that of the surface."""
    (_, row, free), (_, finer_row, finer_free) = (values(h, component, 0.75) for h in (4.0, 3.0))
    assert abs(finer_row - row) < 0.25 * abs(finer_free - free)
