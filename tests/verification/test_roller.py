"""The rigid roller of the scene file against Hertz."""

from __future__ import annotations

import tomllib
from math import pi, sqrt
from pathlib import Path

import pytest

from solver import Status
from solver.results.record import Record
from studies.scenes.description import Description
from studies.scenes.scene import file_scene, read_scene

pytestmark = pytest.mark.divides

FILE = Path(__file__).parents[2] / "data/scenes/roller.toml"


def test_the_pressure_under_a_rigid_roller_is_that_of_hertz() -> None:
    scene = read_scene(FILE)
    (record,) = scene.path(scene.parameters(), [1.0], lambda share: None)
    assert record.status is Status.OK, record.message
    exact = sqrt(1000.0 * 2e5 / (1 - 0.3**2) / (pi * 10.0))
    # 20 elements over the half-width: the largest value at a vertex is 0.4 % below
    assert record.scalars["peak_pressure"] == pytest.approx(exact, rel=0.006)


@pytest.mark.long
def test_first_flow_under_a_growing_contact_is_divided_or_its_error_is_stated() -> None:
    """In one increment the pressure is 7 % off, which a straight path of strain does not show."""

    def pressed(step: float | None, **more: float) -> Record:
        content = tomllib.loads(FILE.read_text()) | more
        content["loading"]["step"] = step or 1.0
        shape = content["bodies"]["half_plane"]["shape"]
        side = {"size": "$a/10"}
        shape["x"][:2] = {"at": 0} | side, {"at": "1.5*$a"} | side
        shape["y"][1:] = {"at": "-$a"} | side, {"at": 0} | side
        scene = file_scene(Description(FILE.name, content, {}))
        run = scene.parameters(load=2245.0, yield_stress=1000.0, hardening_ratio=0.02)
        (record,) = scene.path(run, [], lambda share: None)
        return record

    peak = pressed(0.04).scalars["peak_pressure"]
    by_default, as_given = pressed(None), pressed(None, increment_error=1.0)
    assert by_default.scalars["peak_pressure"] == pytest.approx(peak, rel=3e-3)
    assert by_default.scalars["increments"] > 20
    assert as_given.scalars["peak_pressure"] == pytest.approx(1.067 * peak, rel=5e-3)
    assert as_given.scalars["audit_increment_error"] > 0.05
