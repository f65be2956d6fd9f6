"""Prandtl's limit load: a strip of uniform pressure on a perfectly plastic half-plane."""

from __future__ import annotations

import numpy as np
import pytest

from solver import Body, LimitLoad, Model, PathControl, Tolerances, solve
from solver.mesh import graded, grid
from tests.verification.bodies import cells, steel
from tests.verification.closed_forms import prandtl_pressure

YIELD = 300.0
EXACT = prandtl_pressure(YIELD)


def collapse(per_half_width, element="quad8", full_integration=False):
    """Return the bracket of the limit load over Prandtl's, with this many elements a half strip.

    Half the strip is 1 wide on a half-plane 6 wide and 4 deep: the mechanism reaches 3 and 1.4.
    """
    h = 1.0 / per_half_width
    x = np.concatenate([np.arange(0.0, 2.0, h), 2.0 + graded(4.0, h, 1.2, 0.5)])
    y = -np.concatenate([np.arange(0.0, 1.0, h), 1.0 + graded(3.0, h, 1.2, 0.5)])[::-1]
    strip = {"strip": lambda m: (m[0] < 1.0) & (np.abs(m[1]) < 1e-9)}
    body = Body(
        name="half_plane",
        mesh=grid(x, y, cells(element)).with_boundaries(strip),
        element=element,
        material=steel(YIELD, 0.45),
        full_integration=full_integration,
        supports={"left": "x", "right": "x", "bottom": "xy"},
        pressure={"strip": EXACT},
    )
    control = PathControl(
        load_step=0.1, unload_steps=1, max_cuts=6, tolerances=Tolerances(iterations=30)
    )
    with pytest.raises(LimitLoad) as outcome:
        solve(Model(bodies=(body,)), load=2.0, control=control)
    return outcome.value.reached, outcome.value.attempted


@pytest.fixture(scope="module")
def brackets():
    return {n: collapse(n) for n in (2, 4, 8)}


def test_limit_load_is_prandtls(brackets):
    """Within 1.5 %; measured 1.0 %, 0.5 %, 0.2 % with 2, 4, 8 elements under half the strip."""
    reached, attempted = brackets[8]
    assert reached > 0.985
    assert attempted < 1.015


def test_limit_load_falls_monotonically_under_refinement(brackets):
    """Each bracket lies below the one before; the brackets are 0.16 % wide."""
    for n in (2, 4):
        assert brackets[2 * n][1] < brackets[n][0]


def test_full_integration_bounds_the_limit_load_from_above():
    """Displacements that are exact in the mean only beat the bound; exact integration keeps it."""
    reached = [collapse(n, full_integration=True)[0] for n in (2, 4, 8)]
    assert reached[0] > reached[1] > reached[2] > 1.0
    assert reached[2] < 1.015


@pytest.mark.parametrize("element", ["quad9", "quad4", "tri6"])
def test_every_element_but_the_locking_one_finds_the_limit_load(element):
    reached, attempted = collapse(8, element)
    assert reached > 0.995
    assert attempted < 1.015


def test_limit_load_is_reported_with_what_was_reached_and_tried(brackets):
    for reached, attempted in brackets.values():
        assert 0 < attempted - reached < 0.1 / 2**5
