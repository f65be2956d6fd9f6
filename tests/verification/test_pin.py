"""The pin of the scene file in its hole, elastic, against Persson's conforming contact."""

from __future__ import annotations

import numpy as np
import pytest

from solver import Status
from tests.reference.persson import DiscInHole
from tests.verification.scene_files import RADIUS, pin


def test_the_closed_form_is_in_balance_and_is_that_of_hertz_where_contact_is_short() -> None:
    exact = DiscInHole(force=700.0, radius=RADIUS, clearance=0.05, modulus=2.2e5)
    angle = np.linspace(-exact.angle, exact.angle, 200_001)
    upward = exact.pressure(angle) * np.cos(angle) * RADIUS
    assert np.trapezoid(upward, angle) == pytest.approx(700.0, rel=1e-6)
    short = DiscInHole(force=0.1, radius=RADIUS, clearance=0.05, modulus=2.2e5)
    half_width = np.sqrt(8 * 0.1 * RADIUS**2 / (np.pi * 0.05 * 2.2e5))
    assert RADIUS * short.angle == pytest.approx(half_width, rel=1e-4)
    peak = short.pressure(np.zeros(1)).item()
    assert peak == pytest.approx(2 * 0.1 / (np.pi * half_width), rel=1e-4)


@pytest.mark.parametrize(("clearance", "load_ratio"), [(0.01, 0.5), (0.05, 0.5), (0.02, 0.3)])
def test_contact_angle_and_pressure_are_those_of_persson(
    clearance: float, load_ratio: float
) -> None:
    record, exact = pin(clearance, load_ratio)
    assert record.status is Status.OK, record.message
    assert record.scalars["plastic_strain_plate"] == 0.0
    assert record.scalars["contact_length"] / RADIUS == pytest.approx(exact.angle, rel=0.02)
    peak = exact.pressure(np.zeros(1)).item()
    assert record.scalars["peak_pressure"] == pytest.approx(peak, rel=0.005)
    _, x = record.fields["contact_x"]
    _, y = record.fields["contact_y"]
    angle = np.arctan2(x[0], -(y[0] + clearance))
    _, pressure = record.fields["contact_pressure"]
    wanted = exact.pressure(angle)
    miss = np.trapezoid(np.abs(pressure[0, 0] - wanted), angle) / np.trapezoid(wanted, angle)
    assert abs(miss) < 0.02
