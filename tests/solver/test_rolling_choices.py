"""What a user of rolling may choose: another wheel, the size of the half-space, small wheels."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from solver import ModelError
from solver.results.record import Status
from solver.rolling.load import RollingLoad
from solver.rolling.plane.lines import recorded_step
from solver.rolling.scenes.rolling import RollingParameters
from solver.rolling.scenes.rolling_setup import view
from solver.shipped import SCENES

ROLLING = SCENES["rolling"]


def rolled(**own: Any) -> Any:
    parameters = ROLLING.parameters(**({"accuracy": "draft", "load_ratio": 1.0} | own))
    (record,) = ROLLING.path(parameters, [parameters.load_ratio], lambda fraction: None)
    assert record.status is Status.OK, record.message
    return record


def test_a_wheel_has_the_poisson_ratio_of_the_half_space_unless_it_is_given() -> None:
    assert RollingParameters(poisson_ratio=0.25).wheel_material.poisson_ratio == 0.25
    like = RollingParameters(poisson_ratio=0.25, wheel_poisson_ratio=0.25)
    assert like.half_width == RollingParameters(poisson_ratio=0.25).half_width
    other = RollingParameters(wheel_poisson_ratio=0.0, wheel_stiffness=2.0)
    one, two = (1 - 0.3**2) / 2e5, 1 / 4e5
    assert other.contact_modulus == pytest.approx(1 / (one + two), rel=1e-12)


@pytest.mark.solves
@pytest.mark.parametrize("track", ["endless", 4.0])
def test_a_wheel_of_another_poisson_ratio_has_the_pressure_of_hertz_and_creeps(track: Any) -> None:
    soft = rolled(track=track, wheel_poisson_ratio=0.0)
    assert soft.scalars["peak_contact_pressure"] == pytest.approx(502.0, rel=0.01)
    # surfaces that stretch differently pass each other by less than the strain of the contact
    strain = 502.0 / 2e5
    assert -strain < soft.scalars["creepage"] < -0.1 * strain
    assert abs(rolled(track=track).scalars["creepage"]) < 0.02 * strain


@pytest.mark.solves
def test_a_small_half_space_is_another_problem() -> None:
    small, large = (rolled(track=4.0, half_space_size=size, load_ratio=2.7, growth=1.8).scalars
                    for size in (10.0, 400.0))  # fmt: skip
    name = "peak_residual_tension"
    assert abs(small[name] / large[name] - 1) > 0.02


def test_its_size_is_refused_where_it_means_nothing() -> None:
    with pytest.raises(ModelError, match=r"must be 400\.0 with track = endless") as refusal:
        RollingParameters(half_space_size=50.0)
    assert refusal.value.field == "half_space_size"


def test_steady_passes_have_quadratic_elements() -> None:
    with pytest.raises(ModelError, match="must be quad8 with track = endless") as refusal:
        RollingParameters(element="quad4")
    assert refusal.value.field == "element"
    assert RollingParameters(element="quad4", track=50.0).element == "quad4"


@pytest.mark.parametrize("half_width", [0.05, 1.0, 8.3, 100.0])
def test_recorded_positions_are_dense_in_the_contact(half_width: float) -> None:
    step = recorded_step(half_width)
    assert step <= 0.25
    assert half_width / step >= 30
    assert step == 0.25 or half_width / step < 60


def test_the_usual_wheel_is_recorded_where_it_was_and_a_small_one_more_densely() -> None:
    usual = view(RollingParameters(track=50.0))
    assert np.diff(usual.s) == pytest.approx(0.25)
    assert np.diff(usual.x) == pytest.approx(0.5)
    small = view(RollingParameters(track=5.0, radius=20.0, load_ratio=1.0))
    assert np.diff(small.s).max() < RollingParameters(radius=20.0, load_ratio=1.0).half_width / 30


@pytest.mark.solves
def test_friction_may_be_above_one_but_not_without_bound() -> None:
    rough = rolled(friction=1.5, traction=0.2, load_ratio=1.5)
    assert rough.scalars["longitudinal_force"] != 0.0
    with pytest.raises(ModelError, match=r"friction = 11\.0: must be at least 0 and at most 10"):
        RollingParameters(friction=11.0)


@pytest.mark.parametrize(
    "given", [{"force": -1.0}, {"force": 1.0, "drive": np.nan}, {"force": 1.0, "spin": np.inf}]
)
def test_a_load_that_no_wheel_can_have_is_refused(given: dict[str, float]) -> None:
    *_, name = given
    with pytest.raises(ModelError, match=f"{name} .* must be "):
        RollingLoad(**given)
