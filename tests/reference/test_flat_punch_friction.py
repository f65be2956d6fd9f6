"""The stick zone under a flat punch: closed forms, refinement, and another discretisation."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad

from tests.reference.flat_punch_friction import (
    coupled_stick_width,
    coupling,
    stick_width,
    tractions,
    uncoupled_stick_width,
)
from tests.reference.wedge import singular_power

Array = NDArray[np.float64]
NU = 0.3
BETA = coupling(NU)


def constant_elements(friction: float, n: int) -> tuple[Array, Array, Array, Array]:
    """Edges, pressure, shear and inward motion by elements of constant traction in (0, 1).

    Nothing is presumed of the stick zone: every element sticks (no motion, |q| <= f p) or slips
    inward (q = f p). The motion is that of the surface times E / (2 (1 - nu^2)).
    """
    edges = np.sin(pi / 2 * np.linspace(0, 1, n + 1))
    x, h = (edges[1:] + edges[:-1]) / 2, np.diff(edges)

    def primitive(y: Array) -> Array:
        return y * np.log(np.abs(y)) - y

    def logarithm(y: Array) -> Array:
        return primitive(y - edges[:-1]) - primitive(y - edges[1:])

    right, left = logarithm(x[:, None]), logarithm(-x[:, None])
    even, odd = (right + left) / pi, (right - left) / pi
    sums = BETA * (np.tril(np.ones((n, n)), -1) + np.eye(n) / 2) * h
    one, zero = np.ones((n, 1)), np.zeros((n, 1))
    slips = np.zeros(n, dtype=bool)
    for _ in range(50):
        law = np.where(slips[:, None], -friction * np.eye(n), sums)
        moved = np.where(slips[:, None], np.eye(n), odd)
        A = np.block([[-even, sums, -one], [law, moved, zero], [2 * h, 0 * h, 0]])
        solution = np.linalg.solve(A, np.r_[np.zeros(2 * n), 1.0])
        p, q = solution[:n], solution[n : 2 * n]
        motion = sums @ p + odd @ q
        after = np.where(slips, motion > 0, np.abs(q) > friction * p)
        if np.array_equal(after, slips):
            return edges, p, q, motion
        slips = after
    raise AssertionError("stick and slip do not settle")


@pytest.mark.parametrize("friction", [0.2, 0.3, 0.4, 0.5])
def test_elements_that_know_nothing_of_the_stick_zone_find_the_same(friction: float) -> None:
    edges, p, q, motion = constant_elements(friction, 600)
    slips = motion > 1e-12
    first = int(np.argmax(slips))
    assert np.all(slips[first:]) and not np.any(slips[:first])
    assert np.all(q >= 0) and np.all(q <= friction * p * (1 + 1e-9))
    assert np.all(np.diff(motion[first:]) > 0)  # the surface slides most at the corner
    # friction p - q falls as sqrt(c - x): its square meets zero at c
    x = (edges[1:] + edges[:-1]) / 2
    near = slice(first - 12, first - 2)
    slope, constant = np.polyfit(x[near], (friction - q[near] / p[near]) ** 2, 1)
    assert -constant / slope == pytest.approx(stick_width(friction, NU), abs=1.5e-3)


@pytest.mark.parametrize("friction", [0.1, 0.2, 0.3, 0.5])
def test_stick_width_converges_with_order_and_grading(friction: float) -> None:
    fine = coupled_stick_width(friction, BETA, order=8, levels=8)
    assert coupled_stick_width(friction, BETA) == pytest.approx(fine, abs=2e-6)
    assert coupled_stick_width(friction, BETA, order=4, levels=5) == pytest.approx(fine, abs=1e-4)


def test_stick_width_has_these_values_in_steel() -> None:
    widths = [stick_width(friction, NU) for friction in (0.1, 0.2, 0.3, 0.4, 0.5)]
    assert widths == pytest.approx([0.0364, 0.3604, 0.6891, 0.8645, 0.9410], abs=1e-4)


@pytest.mark.parametrize("ratio", [0.5, 1.0, 2.0])
def test_little_coupling_gives_the_elliptic_integrals(ratio: float) -> None:
    errors = [
        coupled_stick_width(ratio * beta, beta) - uncoupled_stick_width(ratio * beta, beta)
        for beta in (0.1, 0.05, 0.025)
    ]
    assert np.abs(errors[-1]) < 1e-3
    # the pressure is changed by the square of beta
    assert np.divide(errors[:-1], errors[1:]) == pytest.approx([4, 4], rel=0.05)


@pytest.mark.parametrize("ratio", [0.5, 1.0, 2.0])
def test_elliptic_integrals_are_the_condition_of_a_bounded_shear_traction(ratio: float) -> None:
    # q = f p + correction in |x| < c; the correction is bounded at both ends where the gradient
    # of motion that it must undo, over sqrt(c^2 - x^2), has no integral (Johnson, 2.7). In closed
    # form int sign(s) p / (x - s) ds = -2 artanh(b) p(0) / b with b = sqrt(1 - x^2).
    c = uncoupled_stick_width(ratio, 1.0)

    def gradient(t: float) -> float:
        x = c * np.sin(t)
        b = np.sqrt(1 - x**2)
        return 1 / b - ratio / pi * 2 * np.log((1 + b) / x) / b

    total = quad(gradient, 0, 0.1, epsabs=1e-10)[0] + quad(gradient, 0.1, pi / 2)[0]
    scale, _ = quad(lambda t: 1 / np.sqrt(1 - (c * np.sin(t)) ** 2), 0, pi / 2)
    assert abs(total) < 1e-6 * scale


def test_without_coupling_the_pressure_tends_to_that_of_the_frictionless_punch() -> None:
    def error(order: int) -> float:
        punch = tractions(0.5, 1e-9, 1e-9, order, levels=6)
        inner = punch.x < 1 - 1e-4
        exact = 1 / (pi * np.sqrt(1 - punch.x[inner] ** 2))
        return float(np.abs(punch.pressure[inner] / exact - 1).max())

    errors = [error(order) for order in (4, 8, 12)]
    assert errors[-1] < 1e-4
    # geometric in the order, as on panels that shrink towards every singularity
    assert errors[0] / errors[1] > 10 and errors[1] / errors[2] > 10


@pytest.mark.parametrize("friction", [0.2, 0.5])
def test_pressure_grows_to_the_corner_by_the_power_of_the_sliding_wedge(friction: float) -> None:
    punch = tractions(stick_width(friction, NU), friction, BETA)
    near = (punch.x > 1 - 1e-3) & (punch.x < 1 - 1e-5)
    slope = np.polyfit(np.log(1 - punch.x[near]), np.log(punch.pressure[near]), 1)[0]
    power = singular_power(friction, slip="outward", alpha=1.0, beta=BETA)
    assert slope + 1 == pytest.approx(power, abs=2e-3)


def test_shear_stays_below_friction_where_the_surface_sticks() -> None:
    width = stick_width(0.3, NU)
    punch = tractions(width, 0.3, BETA)
    sticks = punch.x < width - 1e-6
    assert np.all(punch.shear[sticks] < 0.3 * punch.pressure[sticks])
    assert np.all(punch.shear > 0)


def test_more_friction_and_less_compressibility_widen_the_stick_zone() -> None:
    assert stick_width(0.0, NU) == 0.0
    assert stick_width(0.1, 0.5) == 1.0
    assert stick_width(3.0, NU) > 0.9999
    assert stick_width(3.0, 0.45) == 1.0
    by_friction = [stick_width(friction, NU) for friction in (0.05, 0.1, 0.3, 0.6, 1.0)]
    by_poisson_ratio = [stick_width(0.2, nu) for nu in (0.0, 0.1, 0.3, 0.45, 0.49)]
    for widths in (by_friction, by_poisson_ratio):
        assert widths == sorted(widths)
