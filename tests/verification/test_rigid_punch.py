"""The rigid flat punch: closed form, wedge problem, coupled integral equations."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from solver.memory import release
from solver.results.record import Status
from studies.scenes.registry import scene_named
from tests.reference.flat_punch_friction import stick_width
from tests.reference.wedge import singular_power

RIGID_PUNCH = scene_named("rigid_punch")
NU = 0.3
FRICTIONS = (0.2, 0.4)
WIDE = {"largest_element": 0.01}
"""Far from the corner elements are as wide as those of draft accuracy: what is fitted is near."""


@cache
def pressed(**own: Any) -> dict[str, float]:
    parameters = RIGID_PUNCH.parameters(**own)
    (record,) = RIGID_PUNCH.path(parameters, [parameters.mean_pressure], lambda fraction: None)
    assert record.status is Status.OK, record.message
    found = dict(record.scalars)
    del record
    release(0)  # hundreds of megabytes for each mesh
    return found


def test_away_from_the_corner_the_error_of_pressure_falls_with_the_square_of_the_elements() -> None:
    # the pressure is linear between vertices; halved elements have the square root of the growth
    errors = [
        pressed(largest_element=0.04 / k, growth=2.0736 ** (1 / k), smallest_element=1 / 1125 / k)
        ["pressure_error"] for k in (1, 2, 4)
    ]  # fmt: skip
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert (orders > 1.6).all(), orders
    assert errors[-1] < 2e-4


@pytest.mark.parametrize(
    ("accuracy", "error"),
    [("draft", 0.003), pytest.param("standard", 0.001, marks=pytest.mark.long)],
)
def test_pressure_at_the_corner_goes_as_one_over_the_root_of_the_distance(
    accuracy: str, error: float
) -> None:
    found = pressed(accuracy=accuracy)
    assert found["singular_power"] - 1 == pytest.approx(-0.5, abs=error)
    assert found["singular_power_error"] < 0.005
    # 2 / (pi sqrt(2 r)) with r over a
    assert found["singular_intensity"] == pytest.approx(np.sqrt(2) / np.pi, rel=0.01)


@pytest.mark.parametrize("friction", FRICTIONS)
def test_friction_weakens_the_singularity_as_the_wedge_problem_has_it(friction: float) -> None:
    found = pressed(friction=friction, **WIDE)
    # for a rigid wedge Dundurs' parameters are 1 and (1 - 2 nu) / (2 - 2 nu); the half-plane slips
    # inward under the punch, which is the punch slipping outward
    exact = singular_power(friction, slip="outward", alpha=1.0, beta=(1 - 2 * NU) / (2 - 2 * NU))
    assert exact > 0.51
    assert found["singular_power"] == pytest.approx(exact, abs=0.001)


@pytest.mark.parametrize("friction", FRICTIONS)
def test_the_middle_sticks_as_the_coupled_integral_equations_have_it(friction: float) -> None:
    assert pressed(friction=friction, **WIDE)["stick_fraction"] == pytest.approx(
        stick_width(friction, NU), rel=0.02
    )
    assert np.isnan(pressed(friction=friction, **WIDE)["pressure_error"])


def test_a_small_half_plane_changes_the_part_that_sticks() -> None:
    # the closed forms are those of a half-plane
    own = {"friction": 0.3, "accuracy": "draft"}
    near, far = (pressed(**own, half_plane_size=size)["stick_fraction"] for size in (5, 400))
    assert near > far + 0.02
