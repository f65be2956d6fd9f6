"""Powers fitted to made-up stress near a corner, whose power is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from solver.results.singularity import apparent_power, fit_singularity

R = np.geomspace(1e-4, 1.0, 60)
LOW, HIGH = 1e-3, 3e-2


@pytest.mark.parametrize("p", [0.5, 0.7740, 0.95, 1.2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_power_alone_is_found_exactly(p, sign):
    found = fit_singularity(R, sign * 3.0 * R ** (p - 1), LOW, HIGH)
    assert (found.power, found.intensity) == pytest.approx((p, sign * 3.0), abs=1e-9)
    assert found.error < 1e-9
    assert apparent_power(R, R ** (p - 1), LOW, HIGH) == pytest.approx(p, abs=1e-12)


@pytest.mark.parametrize("beside", [-1.0, -0.5, 0.5, 2.0])
@pytest.mark.parametrize("above", [0.8, 1.0, 1.12])
def test_the_next_term_of_the_series_is_taken_off(above, beside):
    """Whatever its exponent, more than two thirds of what it shifts a straight line by."""
    p = 0.68
    stress = R ** (p - 1) * (1 + beside * R**above)
    found = fit_singularity(R, stress, LOW, HIGH)
    assert abs(found.power - p) <= found.error
    assert abs(apparent_power(R, stress, LOW, HIGH) - p) > 3 * abs(found.power - p)


def test_noise_is_in_the_error():
    noise = 1 + 0.01 * np.random.default_rng(5).standard_normal(len(R))
    found = fit_singularity(R, R**-0.3 * noise, LOW, HIGH)
    assert 1e-3 < found.error < 0.1
    assert abs(found.power - 0.7) < 3 * found.error


def test_a_longer_range_of_a_curved_field_has_the_larger_error():
    stress = R**-0.3 * (1 + 20 * R)
    errors = [fit_singularity(R, stress, LOW, high).error for high in (0.01, 0.03, 0.1)]
    assert errors == sorted(errors)
    assert errors[-1] > 2 * errors[0]


def test_points_weigh_by_the_scales_they_stand_for():
    """Where half of the range is sampled ten times as densely, the straight line stays."""
    curved = R**-0.3 * (1 + 5 * R)
    dense = np.unique(np.concatenate([R, np.geomspace(1e-2, 3e-2, 80)]))
    plain = apparent_power(R, curved, LOW, HIGH)
    assert apparent_power(dense, dense**-0.3 * (1 + 5 * dense), LOW, HIGH) == pytest.approx(
        plain, abs=5e-3
    )


def test_the_order_of_the_points_does_not_matter():
    turned = np.random.default_rng(3).permutation(R)
    stress = turned**-0.3 * (1 + turned)
    one = fit_singularity(turned, stress, LOW, HIGH)
    other = fit_singularity(np.sort(turned), stress[np.argsort(turned)], LOW, HIGH)
    assert (one.power, one.error) == pytest.approx((other.power, other.error), abs=1e-12)


@pytest.mark.parametrize(
    ("r", "stress"),
    [
        (R, np.zeros_like(R)),
        (R, np.log(R / 5e-3)),
        (np.array([0.0, 2e-3, 5e-3, 1e-2, 2e-2]), np.ones(5)),
    ],
    ids=["none", "both signs", "four points"],
)
def test_what_has_no_power_gives_none(r, stress):
    found = fit_singularity(r, stress, LOW, HIGH)
    assert all(map(math.isnan, (found.power, found.error, found.intensity)))
    assert math.isnan(apparent_power(r, stress, LOW, HIGH))
