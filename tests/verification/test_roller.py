"""The rigid roller of the scene file against Hertz."""

from __future__ import annotations

from math import pi, sqrt
from pathlib import Path

import pytest

from solver import Status
from studies.scenes.scene import read_scene

FILE = Path(__file__).parents[2] / "data/scenes/roller.toml"


def test_the_pressure_under_a_rigid_roller_is_that_of_hertz() -> None:
    scene = read_scene(FILE)
    (record,) = scene.path(scene.parameters(), [1.0], lambda share: None)
    assert record.status is Status.OK, record.message
    exact = sqrt(1000.0 * 2e5 / (1 - 0.3**2) / (pi * 10.0))
    # 20 elements over the half-width: the largest value at a vertex is 0.4 % below
    assert record.scalars["peak_pressure"] == pytest.approx(exact, rel=0.006)
