"""Cattaneo's and Mindlin's tractions against the laws they must obey, and against elements."""

from __future__ import annotations

from math import log, pi

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.reference.cattaneo import SlidingCylinders

Array = NDArray[np.float64]

F = 0.3
PAIR = SlidingCylinders(force=1000.0, radius=50.0, modulus=1.1e5, friction=F)
A = PAIR.half_width
FULL = F * PAIR.force
LARGEST = 0.7 * FULL

# x = a cos t: the midpoint rule is Gauss-Chebyshev quadrature, exact to rounding for one ellipse
N = 4000
ANGLE = pi * (np.arange(N) + 0.5) / N
X = A * np.cos(ANGLE)


def total(traction: Array) -> float:
    return float(np.sum(traction * A * np.sin(ANGLE)) * pi / N)


class Elements:
    """Constant elements of shear traction under Hertz's pressure, with stick, slip and history."""

    def __init__(self, n: int) -> None:
        edges = -A * np.cos(pi * np.arange(n + 1) / n)
        self.x, self.width = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
        y = self.x[:, None] - edges
        potential = y * np.log(np.abs(y)) - y
        # relative displacement of the surfaces by q: -(2 / (pi E*)) int q ln|x - s|
        self.K = -2 / (pi * PAIR.modulus) * (potential[:, :-1] - potential[:, 1:])
        self.limit = F * PAIR.pressure(self.x)
        self.q, self.slip, self.shift = np.zeros(n), np.zeros(n), 0.0

    def push(self, force: float) -> None:
        """Bring the force to a value: slip = shift - K q where a point slips, unchanged elsewhere.

        Points that slip bear friction times pressure, those that stick at most that.
        """
        n = len(self.x)
        sense = np.zeros(n)
        for _ in range(60):
            A_ = np.zeros((n + 1, n + 1))
            b = np.zeros(n + 1)
            A_[:n, :n] = np.where(sense[:, None] != 0, np.eye(n), self.K)
            A_[:n, n] = np.where(sense != 0, 0.0, -1.0)
            b[:n] = np.where(sense != 0, sense * self.limit, -self.slip)
            A_[n, :n], b[n] = self.width, force
            solution = np.linalg.solve(A_, b)
            q, slip = solution[:n], solution[n] - self.K @ solution[:n]
            change = slip - self.slip
            kept = np.where(sense * change > 0, sense, 0.0)
            after = np.where(sense != 0, kept, np.where(np.abs(q) > self.limit, np.sign(q), 0.0))
            if np.array_equal(after, sense):
                self.q, self.slip, self.shift = q, slip, solution[n]
                return
            sense = after
        raise AssertionError("stick and slip do not settle")


def test_pressure_is_that_of_hertz() -> None:
    assert total(PAIR.pressure(X)) == pytest.approx(PAIR.force, rel=1e-6)
    # K.L. Johnson, 4.45: p0 = sqrt(P E* / (pi R))
    assert PAIR.peak_pressure == pytest.approx(np.sqrt(1000 * 1.1e5 / (pi * 50)), rel=1e-12)


@pytest.mark.parametrize("share", [-0.9, 0.2, 0.7, 1.0])
def test_first_push_bears_the_force_within_friction(share: float) -> None:
    q = PAIR.shear(X, share * FULL)
    assert total(q) == pytest.approx(share * FULL, rel=1e-5)
    assert np.all(np.abs(q) <= F * PAIR.pressure(X) * (1 + 1e-12))
    slips = np.abs(X) > PAIR.stick_width(share * FULL)
    assert q[slips] == pytest.approx(np.sign(share) * F * PAIR.pressure(X[slips]))


def test_stick_width_is_the_root_of_what_force_is_left() -> None:
    assert PAIR.stick_width(0.0) == A
    assert PAIR.stick_width(0.75 * FULL) == pytest.approx(A / 2, rel=1e-12)
    assert PAIR.stick_width(FULL) == 0.0
    with pytest.raises(ValueError, match="more than friction bears"):
        PAIR.stick_width(1.01 * FULL)


@pytest.mark.parametrize("share", [1.0, 0.5, 0.0, -0.4, -1.0])
def test_reversed_push_bears_the_force_within_friction(share: float) -> None:
    force = share * LARGEST
    q = PAIR.reversed_shear(X, force, LARGEST)
    assert total(q) == pytest.approx(force, abs=1e-5 * FULL)
    assert np.all(np.abs(q) <= F * PAIR.pressure(X) * (1 + 1e-12))
    slips = np.abs(X) > PAIR.reversed_stick_width(force, LARGEST)
    assert q[slips] == pytest.approx(-F * PAIR.pressure(X[slips]))


def test_a_half_cycle_ends_where_a_first_push_the_other_way_does() -> None:
    assert PAIR.reversed_shear(X, LARGEST, LARGEST) == pytest.approx(PAIR.shear(X, LARGEST))
    assert PAIR.reversed_shear(X, -LARGEST, LARGEST) == pytest.approx(PAIR.shear(X, -LARGEST))
    assert PAIR.reversed_shear(X, LARGEST / 2, -LARGEST) == pytest.approx(
        -PAIR.reversed_shear(X, -LARGEST / 2, LARGEST)
    )


def test_elements_with_stick_and_slip_find_the_same_on_the_whole_path() -> None:
    scale = F * PAIR.peak_pressure
    errors = []
    for n in (100, 200):
        body = Elements(n)
        worst = []
        for share in (0.5, 1.0):
            body.push(share * LARGEST)
            worst.append(body.q - PAIR.shear(body.x, share * LARGEST))
        worst.append(
            (body.slip - PAIR.slip(body.x, LARGEST)) / PAIR.slip(X[:1], LARGEST) * FULL / A
        )
        for share in (0.4, -0.3, -1.0):
            body.push(share * LARGEST)
            worst.append(body.q - PAIR.reversed_shear(body.x, share * LARGEST, LARGEST))
        errors.append([float(np.sqrt(np.mean(e**2))) for e in worst])
    assert max(errors[1]) < 3e-3 * scale
    assert np.all(np.array(errors[1]) < 0.7 * np.array(errors[0]))


@pytest.mark.parametrize("share", [0.3, 0.7, 1.0])
def test_heat_of_a_cycle_is_the_work_of_the_force(share: float) -> None:
    largest = share * FULL

    def potential(width: float) -> float:  # int ln|s| (width / a) sqrt(1 - (s / width)^2) ds
        return 0.0 if width == 0 else pi / 2 * width**2 / A * (log(width / 2) - 0.5)

    def shift(force: float) -> float:
        b, c = PAIR.reversed_stick_width(force, largest), PAIR.stick_width(largest)
        q_log = -potential(A) + 2 * potential(b) - potential(c)
        return -2 / (pi * PAIR.modulus) * F * PAIR.peak_pressure * q_log

    # by parts from largest to -largest and, by symmetry, back
    t, w = np.polynomial.legendre.leggauss(60)
    inner = largest * float(w @ np.array([shift(largest * s) for s in t]))
    work = 2 * (inner - largest * (shift(-largest) + shift(largest)))
    assert PAIR.dissipation(largest) == pytest.approx(work, rel=1e-4)


def test_heat_of_small_cycles_grows_with_the_cube_of_the_force() -> None:
    heat = [PAIR.dissipation(share * FULL) for share in (1e-3, 2e-3)]
    assert heat[1] / heat[0] == pytest.approx(8, rel=5e-3)
