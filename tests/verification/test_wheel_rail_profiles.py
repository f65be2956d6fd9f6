"""Profiles of wheel and rail that are given by points: the same results, and what is refused."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from solver import ModelError, Record
from solver.results.record import Status
from solver.rolling.rail.profiles.rail import rail_60e1
from solver.rolling.rail.profiles.wheel_profile import s1002
from solver.rolling.scenes.wheel_rail import WheelRailParameters
from solver.rolling.scenes.wheel_rail_track import geometry
from solver.shipped import SCENES

SCENE = SCENES["wheel_rail"]
DRAFT = {"accuracy": "draft", "hardening": "kinematic", "hardening_ratio": 0.0196}


@cache
def rail_points(step: float = 0.5) -> np.ndarray:
    """Points (n, 2) of the running surface of 60E1, equally far from each other [mm]."""
    rail = rail_60e1()
    right, left = rail.running
    z, y = rail.outline.at(np.arange(left, right, -step))
    head = (np.abs(z) < 35.9) & (y > -14.0)
    return np.stack([z[head], y[head]], axis=1)


def wheel_points(step: float = 0.5) -> np.ndarray:
    """Points (n, 2) of S1002 from its flange to its outside [mm]."""
    z = np.arange(-38.0, 55.0, step)
    return np.stack([z, s1002().height(z)], axis=1)


def rolled(**changes: Any) -> Record:
    """The record of one pass."""
    (record,) = SCENE.path(SCENE.parameters(**DRAFT | changes), [1], lambda share: None)
    assert record.status is Status.OK, record.message
    return record


def test_points_of_the_standard_profiles_give_their_results() -> None:
    """A spline through points each half a millimetre smooths the jumps of curvature."""
    own = rolled(wheel_profile="s1002").scalars
    by_points = rolled(rail_profile=rail_points(), wheel_profile=wheel_points()).scalars
    for name, tolerance in (
        ("peak_patch_pressure", 2e-3), ("max_plastic_strain", 5e-3), ("axle_height", 1e-3),
        ("lateral_force", 0.02),
    ):  # fmt: skip
        assert by_points[name] == pytest.approx(own[name], rel=tolerance), name


def test_points_are_numbers_that_count_for_a_run() -> None:
    one = WheelRailParameters(rail_profile=rail_points())  # type: ignore[arg-type]
    same = WheelRailParameters(rail_profile=rail_points().tolist())  # type: ignore[arg-type]
    assert one == same
    assert hash(one) == hash(same)
    assert one.rail_profile[0] == (rail_points()[0, 0], rail_points()[0, 1])
    worn = WheelRailParameters(rail_profile=rail_points() - [0.0, 1.0])  # type: ignore[arg-type]
    assert geometry(worn) != geometry(one)


def noisy(points: np.ndarray) -> np.ndarray:
    """Points with noise of 0.02 mm."""
    noise = np.random.default_rng(1).normal(0.0, 0.02, len(points))
    return points + np.stack([np.zeros_like(noise), noise], axis=1)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"rail_profile": noisy(rail_points())}, "rail_profile = .* must be smooth: at z"),
        ({"wheel_profile": noisy(wheel_points())}, "wheel_profile = .* must be smooth: at z"),
        ({"rail_profile": rail_points(8.0)}, "rail_profile = .* must have points at most 6 mm"),
        ({"wheel_profile": wheel_points(8.0)}, "wheel_profile = .* must have points at most 6 mm"),
        ({"rail_profile": rail_points()[40:-40]}, "rail_profile = .* end at the sides"),
        ({"rail_profile": rail_points() - [0, 40]}, "rail_profile = .* must lie between"),
        (
            {"rail_profile": rail_points()[::-1]},
            "rail_profile = .* z increases; these are number 0 and 1",
        ),
        (
            {"wheel_profile": wheel_points()[60:]},
            "lateral_position = .* from the ends of",
        ),
        ({"wheel_profile": wheel_points()[-4:]}, "lateral_position = .* not beside it"),
        ({"rail_profile": "54e9"}, "rail_profile = '54e9': must be 60e1 or a tuple"),
    ],
)
def test_points_that_are_no_profile_are_refused(given: dict[str, Any], told: str) -> None:
    with pytest.raises(ModelError, match=told):
        geometry(WheelRailParameters(accuracy="standard", **given))
