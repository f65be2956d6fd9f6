"""A steady pass that Newton's method does not find at once is approached by lighter loads."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from solver import LimitLoad
from solver.errors import NotConverged, WindowTooSmall
from solver.scenes.rolling_grids import wheel_nodes
from solver.scenes.rolling_parameters import RollingParameters
from solver.steady.search import _approached


class Weight:
    """A load that knows its size alone."""

    def __init__(self, size=1.0):
        self.size = size

    def lighter(self, share):
        return Weight(share * self.size)


def solver(steps, failures):
    """A pass that is found from one of at least 0.94 of its load, and fails as told otherwise."""

    def solve(load, guess=None):
        steps.append(load.size)
        if load.size in failures:
            raise failures[load.size]
        if load.size == 1.0 and (guess is None or guess < 0.94):
            raise LimitLoad("flows without bound")
        return SimpleNamespace(strain=load.size)

    return solve


LOST = LimitLoad("flows without bound")


def test_lighter_loads_lead_to_what_seemed_a_limit():
    steps = []
    assert _approached(solver(steps, {}), Weight(), LOST).strain == 1.0
    assert steps == [0.8, 0.9, 0.95, 1.0]


def test_it_is_a_limit_where_lighter_loads_do_not_lead_there():
    steps = []
    failures = {0.9: NotConverged("lost")}
    with pytest.raises(LimitLoad, match="flows without bound"):
        _approached(solver(steps, failures), Weight(), LOST)
    assert steps == [0.8, 0.9]


def test_a_window_that_is_too_small_for_a_lighter_load_is_told():
    with pytest.raises(WindowTooSmall):
        _approached(solver([], {0.9: WindowTooSmall("below")}), Weight(), LOST)


def test_rim_and_track_have_sides_of_one_length():
    """Rolling by one side is the same on both, however reach over side is rounded."""
    for number in range(300):
        radius = 33.492 * (1 + number / 97)
        a = RollingParameters(radius=radius, element_size=0.1).half_width
        p = RollingParameters(radius=radius, element_size=a / 5)
        angle, _ = wheel_nodes(radius, p.reach, p.element_size)
        sides = np.diff(angle[np.abs(angle) <= p.reach / radius * (1 + 1e-9)]) * radius
        np.testing.assert_allclose(sides, p.element_size, rtol=1e-9)
