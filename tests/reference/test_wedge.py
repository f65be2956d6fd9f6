"""The powers of corners against closed forms, and against the spectrum of the plain equations."""

from __future__ import annotations

from math import atan, cos, pi, sin

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import eigvals
from scipy.optimize import brentq

from tests.reference.wedge import Slip, dundurs, singular_power, sticking_friction

Array = NDArray[np.float64]
NU = 0.3
N = 14  # intervals in the angle; more change the powers by less than 1e-8


def chebyshev(first: float, last: float) -> tuple[Array, Array]:
    """Points and the matrix of differentiation. L.N. Trefethen, Spectral Methods in MATLAB, 6."""
    x = np.cos(pi * np.arange(N + 1) / N)
    c = np.r_[2.0, np.ones(N - 1), 2.0] * (-1.0) ** np.arange(N + 1)
    D = np.outer(c, 1 / c) / (x[:, None] - x + np.eye(N + 1))
    D -= np.diag(D.sum(axis=1))
    return (last + first) / 2 + (last - first) / 2 * x, D * 2 / (last - first)


def body(first: float, last: float, shear_modulus: float) -> tuple[Array, Array]:
    """Matrices A and B of A x = s B x: elasticity in polar coordinates at r^s, collocated.

    The unknowns are the radial and hoop displacement U and V, W = s U, the shear and the hoop
    stress; no stress function is used.
    """
    D = chebyshev(first, last)[1]
    one, zero = np.eye(N + 1), np.zeros((N + 1, N + 1))
    lame = 2 * shear_modulus * NU / (1 - 2 * NU)
    M = lame + 2 * shear_modulus
    E = M - lame**2 / M
    G = shear_modulus
    A = np.block(
        [
            [D, -one, zero, -one / G, zero],  # U' + (s - 1) V = shear / G
            [one, D, zero, zero, -one / M],  # V' + U + s lame/M U = hoop / M
            [zero, zero, one, zero, zero],
            [zero, zero, zero, D, -one],  # shear' - hoop + s (E W + lame/M hoop) = 0
            [zero, zero, zero, one, D],  # hoop' + (s + 1) shear = 0
        ]
    )
    B = -np.block(
        [
            [zero, one, zero, zero, zero],
            [lame / M * one, zero, zero, zero, zero],
            [-one, zero, zero, zero, zero],
            [zero, zero, E * one, zero, lame / M * one],
            [zero, zero, zero, one, zero],
        ]
    )
    return A, B


def spectrum(friction: float, slip: Slip, stiffness: float = 1.0) -> NDArray[np.complex128]:
    """All powers with real part in (0.02, 1) at a square punch ``stiffness`` times as stiff."""
    (A_1, B_1), (A_2, B_2) = body(pi / 2, pi, stiffness), body(-pi, 0.0, 1.0)
    n = 5 * (N + 1)
    A, B = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, 2 * n))
    A[:n, :n], A[n:, n:], B[:n, :n], B[n:, n:] = A_1, A_2, B_1, B_2
    U, V, shear, hoop = 0, N + 1, 3 * (N + 1), 4 * (N + 1)
    # the first point is the last angle: the contact of the punch, the free side of the half-plane
    top, bottom, side, surface = 0, n + N, N, n
    conditions = [
        {side + shear: 1.0},
        {side + hoop: 1.0},
        {surface + shear: 1.0},
        {surface + hoop: 1.0},
        {top + shear: 1.0, bottom + shear: -1.0},
        {top + hoop: 1.0, bottom + hoop: -1.0},
        {top + V: 1.0, bottom + V: -1.0},
        {top + U: 1.0, bottom + U: -1.0}
        if slip == "stuck"
        else {top + shear: 1.0, top + hoop: friction if slip == "outward" else -friction},
    ]
    # they replace the equations of the four fields with a derivative, at one end of each body
    rows = [i * (N + 1) + end for i in (0, 1, 3, 4) for end in (0, n)]
    for row, condition in zip(rows, conditions, strict=True):
        A[row], B[row] = 0.0, 0.0
        for column, value in condition.items():
            A[row, column] = value
    powers = eigvals(A, B)
    powers = powers[np.isfinite(powers)]
    return np.sort_complex(powers[(powers.real > 0.02) & (powers.real < 0.999)])


def test_frictionless_square_corner_is_that_of_dundurs_and_lee() -> None:
    def characteristic(s: float) -> float:
        return cos(pi * s) * (sin(s * pi / 2) ** 2 - s**2) + sin(pi * s) ** 2 / 2

    root = brentq(characteristic, 0.6, 0.9, xtol=1e-14)
    assert singular_power(0.0) == pytest.approx(root, abs=1e-12)
    assert round(root, 4) == 0.7740


@pytest.mark.parametrize("angle", [pi / 3, pi / 2, 2 * pi / 3, 5 * pi / 6])
def test_stuck_corner_is_the_notch_of_williams(angle: float) -> None:
    opening = pi + angle

    def symmetric(s: float) -> float:
        return sin(s * opening) + s * sin(opening)

    root = brentq(symmetric, 0.45, 0.9, xtol=1e-14)
    assert singular_power(slip="stuck", angle=angle) == pytest.approx(root, abs=1e-12)


def test_stuck_square_corner_is_the_known_number() -> None:
    assert round(singular_power(slip="stuck"), 4) == 0.5445


def test_corner_of_two_half_planes_is_a_crack() -> None:
    for friction in (0.0, 0.3):  # friction of equal materials does not act on the opening
        assert singular_power(friction, angle=pi) == pytest.approx(0.5, abs=1e-12)


@pytest.mark.parametrize("friction", [0.0, 0.2, 0.5, 1.0])
def test_rigid_punch_has_the_closed_form(friction: float) -> None:
    # K.L. Johnson, Contact Mechanics (1985), 2.25: at the edge of a rigid punch that slides over
    # a half-plane the pressure is a power with cot(pi p) = -+ beta f
    beta = (1 - 2 * NU) / (2 * (1 - NU))
    shift = atan(beta * friction) / pi
    outward = singular_power(friction, slip="outward", alpha=1.0, beta=beta)
    inward = singular_power(friction, slip="inward", alpha=1.0, beta=beta)
    assert (outward, inward) == pytest.approx((0.5 + shift, 0.5 - shift), abs=1e-12)


def test_a_stiffer_punch_tends_to_the_rigid_one() -> None:
    alpha, beta = dundurs((1e9, NU), (1.0, NU))
    assert (alpha, beta) == pytest.approx((1.0, (1 - 2 * NU) / (2 * (1 - NU))), abs=1e-8)
    assert dundurs((2e5, NU), (2e5, NU)) == (0.0, 0.0)


@pytest.mark.parametrize("slip", ["outward", "inward"])
@pytest.mark.parametrize("friction", [0.0, 0.1, 0.2, 0.3, 0.5])
@pytest.mark.parametrize("stiffness", [0.5, 1.0, 3.0])
def test_power_is_the_lowest_of_the_whole_spectrum(
    friction: float, slip: Slip, stiffness: float
) -> None:
    alpha, beta = dundurs((stiffness, NU), (1.0, NU))
    power = singular_power(friction, slip=slip, alpha=alpha, beta=beta)
    powers = spectrum(friction, slip, stiffness)
    lowest = powers[0] if len(powers) else 1.0
    assert power == pytest.approx(lowest, abs=1e-7)


def test_stuck_corner_has_the_two_powers_of_the_notch() -> None:
    powers = spectrum(0.0, "stuck")
    assert powers == pytest.approx([0.5444837368, 0.9085291898], abs=1e-7)


def test_outward_slip_lowers_the_power_and_inward_slip_raises_it() -> None:
    frictions = (0.0, 0.1, 0.2, 0.3, 0.4)
    outward = [singular_power(f, slip="outward") for f in frictions]
    inward = [singular_power(f, slip="inward") for f in frictions]
    assert outward == sorted(outward, reverse=True)
    assert inward == sorted(inward)
    assert outward == pytest.approx([0.7740, 0.7249, 0.6799, 0.6380, 0.5983], abs=5e-5)
    assert inward == pytest.approx([0.7740, 0.8293, 0.8945, 0.9799, 1.0], abs=5e-5)


def test_inward_slip_takes_the_singularity_away_at_one_over_pi() -> None:
    assert singular_power(1 / pi - 1e-3, slip="inward") < 1.0
    assert singular_power(1 / pi + 1e-3, slip="inward") == 1.0


def test_slip_against_too_much_friction_is_refused() -> None:
    assert singular_power(2.0) < 0.02
    with pytest.raises(ValueError, match="finite energy"):
        singular_power(2.2)


def test_complex_powers_of_a_stuck_corner_are_refused() -> None:
    with pytest.raises(ValueError, match="complex"):
        singular_power(slip="stuck", alpha=1.0, beta=0.2857)


def test_slipping_and_stuck_corner_agree_where_the_corner_begins_to_stick() -> None:
    friction = sticking_friction()
    assert round(friction, 3) == 0.543
    assert singular_power(friction) == pytest.approx(singular_power(slip="stuck"), abs=1e-12)
