"""Lateral force, yaw and spin of a wheel on a rail."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from solver import ModelError, Record
from solver.results.record import Status
from solver.rolling.scenes.wheel_rail import WheelRailParameters
from solver.shipped import SCENES
from tests.records import kept

SCENE = SCENES["wheel_rail"]
CROWNED = {
    "accuracy": "draft", "hardening": "kinematic", "hardening_ratio": 0.0196, "load": 80e3,
    "wheel_profile": "crowned", "cant": 0.0, "lateral_position": 0.0, "passes": 1,
}  # fmt: skip
FULL = 0.17 * 80e3
"""Friction times load [N]."""


@cache
def rolled(*changes: tuple[str, Any]) -> Record:
    """The record of one pass of a crowned wheel, symmetric about the middle of the rail."""
    parameters = SCENE.parameters(**CROWNED | dict(changes))
    (record,) = SCENE.path(parameters, [1], lambda share: None)
    assert record.status is Status.OK, record.message
    return kept(record)


def test_a_given_lateral_force_is_that_of_the_creepage_it_makes() -> None:
    wanted = 0.5 * FULL
    by_force = rolled(("lateral_control", "force"), ("given_lateral_force", wanted)).scalars
    assert by_force["lateral_force"] == pytest.approx(wanted, rel=1e-8)
    creepage = by_force["axle_lateral_creepage"]
    by_creepage = rolled(("lateral_creepage", creepage)).scalars
    assert by_creepage["lateral_force"] == pytest.approx(wanted, rel=1e-4)


def test_yaw_is_a_lateral_creepage_where_the_wheel_is_level() -> None:
    """A wheel heading towards the middle of the track drags the rail to its outside."""
    yawed, creeping = (
        rolled((name, 0.001)).scalars["lateral_force"] for name in ("yaw", "lateral_creepage")
    )
    assert 0.3 * FULL < creeping < FULL
    assert yawed == pytest.approx(creeping, rel=0.02)
    assert rolled(("yaw", -0.001)).scalars["lateral_force"] == pytest.approx(-yawed, rel=0.02)


def test_spin_turns_the_rail_with_it_and_drags_it_aside() -> None:
    """In Kalker's theory a spin makes a moment of its sign and a lateral force of the other's."""
    spun, other = (rolled(("spin", each)).scalars for each in (2e-4, -2e-4))
    assert spun["spin_moment"] > 0.0 > other["spin_moment"]
    np.testing.assert_allclose(other["spin_moment"], -spun["spin_moment"], rtol=0.02)
    np.testing.assert_allclose(other["lateral_force"], -spun["lateral_force"], rtol=0.02)
    assert abs(spun["lateral_force"]) > 0.05 * FULL


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"given_lateral_force": 1.0}, "given_lateral_force = 1.0: needs lateral_control = force"),
        (
            {"lateral_control": "force", "lateral_creepage": 0.01},
            "lateral_creepage = 0.01: must be 0 with lateral_control = force",
        ),
        (
            {"lateral_control": "force", "friction": 0.0},
            "lateral_control = 'force': must be creepage without friction",
        ),
        ({"yaw": 0.2}, "yaw = 0.2: must be at least -0.1 and at most 0.1"),
    ],
)
def test_what_does_not_fit_is_refused(given: dict[str, Any], told: str) -> None:
    with pytest.raises(ModelError, match=told):
        WheelRailParameters(**given)
