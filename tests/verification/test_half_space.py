"""Displacements of a half-space: closed forms of rectangles against quadrature and symmetry."""

from __future__ import annotations

import numpy as np
import pytest

from solver.materials import Elasticity
from solver.rolling.rail.half_space import half_space
from solver.rolling.rail.patch_grid import SHARES, Hats

NU = 0.3
STEEL = Elasticity(youngs_modulus=2e5, poisson_ratio=NU)
S = np.array([0.0, 0.7, 1.5, 2.9, 3.6, 4.4])
SPACING, STATIONS = 0.8, 4
GAUSS = np.polynomial.legendre.leggauss(8)


def point_force(X: np.ndarray, Z: np.ndarray) -> np.ndarray:
    """Return displacements (3, 3, ...) by a unit force at the origin, y outward.

    Written out from the solutions in cylindrical form: a force along y moves the surface radially
    by (1/2 - nu) / r, one along x radially by 1 / r and along the circle by (1 - nu) / r times the
    cosine and the sine of the angle; all over 2 pi G.
    """
    r, angle = np.hypot(X, Z), np.arctan2(Z, X)
    cos, sin, level = np.cos(angle), np.sin(angle), (0.5 - NU) / r
    u = np.zeros((3, 3, *r.shape))
    u[1, 1] = (1 - NU) / r
    u[0, 1], u[2, 1] = level * cos, level * sin
    for column, (radial, round_) in ((0, (cos, -sin)), (2, (sin, cos))):
        u[0, column] = (radial * cos - (1 - NU) * round_ * sin) / r
        u[2, column] = (radial * sin + (1 - NU) * round_ * cos) / r
        u[1, column] = -level * radial
    return u / (2 * np.pi * STEEL.shear_modulus)


def under_hat(vertex: int) -> tuple[np.ndarray, np.ndarray]:
    """Return positions across and weights that integrate a function times a hat."""
    ends = S[max(vertex - 1, 0) : vertex + 2]
    half = np.diff(ends)[:, None] / 2
    z = (ends[:-1, None] + half * (1 + GAUSS[0])).ravel()
    return z, (half * GAUSS[1]).ravel() * np.interp(z, S, np.eye(len(S))[vertex])


@pytest.mark.parametrize(("d", "i", "j"), [(3, 1, 1), (-3, 2, 4), (0, 1, 4), (2, 0, 5), (0, 5, 0)])
def test_displacements_are_the_integrals_of_point_forces(d: int, i: int, j: int) -> None:
    """At the points themselves to 1e-7; their mean is that under the hat to 1e-3."""
    found = half_space(S, SPACING, STATIONS, STEEL)[d, i, :, j]
    hats, (by, hat), x = Hats(S), under_hat(j), SPACING / 2 * GAUSS[0]
    for (at, mean), tolerance in (((hats.points, hats.mean[i]), 1e-7), (under_hat(i), 1e-3)):
        Z = at[:, None] - by + 0 * x[:, None, None]
        weights = np.einsum("x,i,j->xij", SPACING / 2 * GAUSS[1], mean / mean.sum(), hat)
        u = point_force(-d * SPACING - x[:, None, None] + 0 * Z, Z)
        expected = (u * weights).sum(axis=(2, 3, 4))
        assert found == pytest.approx(expected, abs=tolerance * np.abs(expected).max())


def test_uniform_pressure_on_a_square_lifts_its_centre_as_love_says() -> None:
    """u = 4 p a ln(1 + sqrt 2) (1 - nu^2) 2 / (pi E) for sides 2 a: Johnson (1985), 3.3.

    A narrow hat tells the value at the middle; the pressure across is a row of hats, whose outer
    flanks lie about the edge.
    """
    s = np.linspace(-2.0, 2.0, 401)
    found = half_space(s, 2.0, 1, STEEL)[0, 200, 1, :, 1]
    inside = np.where(np.abs(s) < 0.999, 1.0, np.where(np.abs(s) < 1.001, 0.5, 0.0))
    expected = 8 * np.log(1 + np.sqrt(2)) * (1 - NU**2) / (np.pi * 2e5)
    assert found @ inside == pytest.approx(expected, rel=1e-4)


def test_work_of_one_traction_on_another_is_the_same_the_other_way_round() -> None:
    """Betti, up to the two points an edge at which displacements are taken."""
    C = half_space(S, SPACING, STATIONS, STEEL)
    work = C * Hats(S).width[:, None, None, None]
    back = work[-np.arange(2 * STATIONS)].transpose(0, 3, 4, 1, 2)
    known = np.arange(2 * STATIONS) != STATIONS  # the one distance without its opposite
    assert work[known] == pytest.approx(back[known], abs=5e-3 * work.max())
    assert work[2, 1, :, 4] == pytest.approx(back[2, 1, :, 4], abs=1e-4 * work[2, 1, :, 4].max())


def test_a_rigid_body_does_not_move() -> None:
    rigid = Elasticity(youngs_modulus=np.inf, poisson_ratio=0.3)
    assert not half_space(S, SPACING, STATIONS, rigid).any()


def test_mean_under_hats_is_exact_for_functions_linear_between_vertices() -> None:
    hats = Hats(S)
    values = np.sin(S)
    exact = np.array([
        np.sum(under_hat(j)[1] * np.interp(under_hat(j)[0], S, values)) for j in range(len(S))
    ])  # fmt: skip
    assert hats.mean @ np.interp(hats.points, S, values) * hats.width == pytest.approx(exact)
    assert hats.mean.sum(axis=1) == pytest.approx(1.0)


def test_the_nearest_hats_work_on_every_hat_as_the_function_does() -> None:
    """And are it where it is linear between vertices; products are those at the points."""
    hats = Hats(S)
    values = np.cos(hats.points)
    to_points = hats.nearest(SHARES, np.array([0.5, 0.5]))
    nearest = to_points @ values
    assert hats.mean @ hats.along(nearest[:-1], nearest[1:]) == pytest.approx(hats.mean @ values)
    assert nearest @ hats.width == pytest.approx(hats.mean @ values @ hats.width)
    linear = np.sin(S)
    assert to_points @ hats.along(linear[:-1], linear[1:]) == pytest.approx(linear)
