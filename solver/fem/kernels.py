"""Loops compiled by numba: logarithmic strain at points, with its derivatives; see `log_strain`.

The types of all arguments are fixed, as in `solver.rolling.kernels`. Division by zero is that of
numpy: flat elements have NaN. Arguments of all functions are

    g : (n_elements, n_points, 4 or 5, m) derivative of the displacement gradients xx, xy, yx, yy
        (, hoop) by the unknowns of the element [1/mm]
    u : (n_elements, m) unknowns of the elements, x and y of their nodes in turn [mm]
    T : (4, n_elements, n_points) Mandel stress conjugate to the logarithmic strain [MPa]
"""

from __future__ import annotations

import math

import numpy as np
from numba import boolean, float64, njit

from solver.typing import Array

_PLANE, _SOLID, _POINTS = float64[:, ::1], float64[:, :, ::1], float64[:, :, :, ::1]
NEAR = 0.05
"""Ratio q up to which h is a power series; principal strains differ by 0.22 there."""
_TERMS = 15
"""Number of its terms. The first term left out is below 1e-20."""
_SQRT2 = math.sqrt(2.0)


@njit(cache=True, error_model="numpy")
def _gradient(g: Array, u: Array) -> tuple[float, float, float, float, float]:
    """Return the displacement gradients xx, xy, yx, yy, hoop of a point: g (4 or 5, m), u (m,).

    Those in the plane are of displacements relative to the first node, which are less rounded.
    """
    H = np.zeros(5)
    for row in range(4):
        for i in range(2, g.shape[1]):
            H[row] += g[row, i] * (u[i] - u[i % 2])
    for i in range(g.shape[1] if g.shape[0] == 5 else 0):
        H[4] += g[4, i] * u[i]
    return H[0], H[1], H[2], H[3], H[4]


@njit(cache=True, error_model="numpy")
def _stretch(
    xx: float, xy: float, yx: float, yy: float
) -> tuple[float, float, float, float, float, float, float]:
    """Return s, d, o, det F less 1, phi and its first two derivatives by d^2 + o^2."""
    a, b = 2 * xx + xx * xx + yx * yx, 2 * yy + yy * yy + xy * xy
    s, d, o = 1 + (a + b) / 2, (a - b) / 2, xy + yx + xx * xy + yx * yy
    grown = xx + yy + xx * yy - xy * yx
    q, h, h1, h2 = (d * d + o * o) / (s * s), 0.0, 0.0, 0.0
    if q < NEAR:
        for k in range(_TERMS - 1, -1, -1):
            h2 = h2 * q + 2 * h1
            h1 = h1 * q + h
            h = h * q + 1 / (2 * k + 1)
    else:
        root, rest = math.sqrt(q), (s / (1 + grown)) ** 2
        h = math.log(s * (1 + root) / (1 + grown)) / root
        h1 = (rest - h) / (2 * q)
        h2 = (rest * rest - 3 * h1) / (2 * q)
    return s, d, o, grown, h / (2 * s), h1 / (2 * s**3), h2 / (2 * s**5)


@njit(cache=True, error_model="numpy")
def _by_functions(
    s: float, d: float, o: float, J: float, phi: float, phi1: float, P: Array
) -> None:
    """Set P (4, 3), the derivative of the strain xx, yy, zz, xy by s, d, o."""
    D = 2 * J * J
    turned = 2 * d * o * phi1
    by_s, by_d, by_o = -d / D, phi + 2 * d * d * phi1, turned
    P[0, 0], P[0, 1], P[0, 2] = s / D + by_s, -d / D + by_d, -o / D + by_o
    P[1, 0], P[1, 1], P[1, 2] = s / D - by_s, -d / D - by_d, -o / D - by_o
    P[3, 0], P[3, 1], P[3, 2] = (
        -_SQRT2 * o / D, _SQRT2 * turned, _SQRT2 * (phi + 2 * o * o * phi1)
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def _by_gradient(xx: float, xy: float, yx: float, yy: float, Q: Array) -> None:
    """Set Q (3, 4), the derivative of s, d, o by the displacement gradients."""
    a, d = 1 + xx, 1 + yy
    Q[0, 0], Q[0, 1], Q[0, 2], Q[0, 3] = a, xy, yx, d
    Q[1, 0], Q[1, 1], Q[1, 2], Q[1, 3] = a, -xy, yx, -d
    Q[2, 0], Q[2, 1], Q[2, 2], Q[2, 3] = xy, a, d, yx


@njit(cache=True, error_model="numpy")
def _level(X: Array, weights: Array) -> None:
    """Give the trace of X (4, n_points), Mandel, its mean at all points of an element."""
    average = 0.0
    for p in range(len(weights)):
        average += weights[p] * (X[0, p] + X[1, p] + X[2, p])
    average /= weights.sum()
    for p in range(len(weights)):
        off = (average - X[0, p] - X[1, p] - X[2, p]) / 3
        for a in range(3):
            X[a, p] += off


@njit([(_POINTS, _PLANE, _PLANE, boolean, _SOLID, _POINTS)], cache=True, error_model="numpy")
def strains(g: Array, u: Array, weights: Array, mean: bool, E: Array, B: Array) -> None:
    """Set the Mandel strain E (4, n_elements, n_points) and its derivative B by the unknowns.

    B has the shape (n_elements, n_points, 4, m). With ``mean`` the volumetric strain is the mean
    over each element, by ``weights`` (n_elements, n_points). Both are NaN at inverted points.
    """
    elements, points, rows, m = g.shape
    P, Q, A = np.zeros((4, 3)), np.zeros((3, 4)), np.zeros((4, 5))
    for e in range(elements):
        for p in range(points):
            xx, xy, yx, yy, hoop = _gradient(g[e, p], u[e])
            s, d, o, grown, phi, phi1, _ = _stretch(xx, xy, yx, yy)
            if not (grown > -1 and hoop > -1):
                E[:, e, p] = np.nan
                B[e, p] = np.nan
                continue
            volume = math.log1p(grown) / 2
            E[0, e, p], E[1, e, p] = volume + phi * d, volume - phi * d
            E[2, e, p], E[3, e, p] = math.log1p(hoop), _SQRT2 * phi * o
            _by_functions(s, d, o, 1 + grown, phi, phi1, P)
            _by_gradient(xx, xy, yx, yy, Q)
            for a in (0, 1, 3):
                for j in range(4):
                    A[a, j] = P[a, 0] * Q[0, j] + P[a, 1] * Q[1, j] + P[a, 2] * Q[2, j]
            A[2, 4] = 1 / (1 + hoop)
            for a in range(4):
                for i in range(m):
                    total = 0.0
                    for j in range(rows):
                        total += A[a, j] * g[e, p, j, i]
                    B[e, p, a, i] = total
        if mean:
            _level(E[:, e], weights[e])
            for i in range(m):
                _level(B[e, :, :, i].T, weights[e])


@njit(cache=True, error_model="numpy")
def _in_material(P: Array, T0: float, T1: float, T3: float) -> tuple[float, float, float]:
    """Return the stress xx, yy, xy in the plane on the undeformed body [MPa]."""
    by_s = P[0, 0] * T0 + P[1, 0] * T1 + P[3, 0] * T3
    by_d = P[0, 1] * T0 + P[1, 1] * T1 + P[3, 1] * T3
    by_o = P[0, 2] * T0 + P[1, 2] * T1 + P[3, 2] * T3
    return by_s + by_d, by_s - by_d, by_o


@njit([(_POINTS, _PLANE, _PLANE, _SOLID, _SOLID)], cache=True, error_model="numpy")
def geometric(g: Array, u: Array, weights: Array, T: Array, K: Array) -> None:
    """Add the geometric stiffness to K (n_elements, m, m) [N/mm]; weights are volumes [mm3]."""
    elements, points, rows, m = g.shape
    P, Q, C = np.zeros((4, 3)), np.zeros((3, 4)), np.zeros((3, 3))
    M, half = np.zeros((5, 5)), np.zeros((5, m))
    for e in range(elements):
        for p in range(points):
            xx, xy, yx, yy, hoop = _gradient(g[e, p], u[e])
            s, d, o, grown, phi, phi1, phi2 = _stretch(xx, xy, yx, yy)
            J = 1 + grown
            _by_functions(s, d, o, J, phi, phi1, P)
            _by_gradient(xx, xy, yx, yy, Q)
            D = J * J
            total, diff = T[0, e, p] + T[1, e, p], T[0, e, p] - T[1, e, p]
            shear = _SQRT2 * T[3, e, p]
            w = diff * d + shear * o
            k = -total / (4 * D * D) + w * phi2
            own = 2 * (-total / (4 * D) + w * phi1)
            along = (total * s - w) / (D * D)
            C[0, 0] = -total * (s * s + d * d + o * o) / (2 * D * D) + w * s / (D * D)
            C[0, 1] = C[1, 0] = d * along - diff / (2 * D)
            C[0, 2] = C[2, 0] = o * along - shear / (2 * D)
            C[1, 1] = own + 4 * d * d * k + 4 * diff * d * phi1
            C[2, 2] = own + 4 * o * o * k + 4 * shear * o * phi1
            C[1, 2] = C[2, 1] = 4 * d * o * k + 2 * (diff * o + shear * d) * phi1
            for i in range(4):
                for j in range(4):
                    both = 0.0
                    for a in range(3):
                        for b in range(3):
                            both += Q[a, i] * C[a, b] * Q[b, j]
                    M[i, j] = both
            S0, S1, S2 = _in_material(P, T[0, e, p], T[1, e, p], T[3, e, p])
            for i in (0, 2):
                M[i, i] += S0
                M[i + 1, i + 1] += S1
                M[i, i + 1] += S2
                M[i + 1, i] += S2
            M[4, 4] = -T[2, e, p] / (1 + hoop) ** 2
            for a in range(rows):
                for i in range(m):
                    force = 0.0
                    for b in range(rows):
                        force += M[a, b] * g[e, p, b, i]
                    half[a, i] = weights[e, p] * force
            for i in range(m):
                for j in range(m):
                    both = 0.0
                    for a in range(rows):
                        both += g[e, p, a, i] * half[a, j]
                    K[e, i, j] += both


@njit([(_POINTS, _PLANE, _SOLID, _PLANE, _SOLID)], cache=True, error_model="numpy")
def cauchy(g: Array, u: Array, T: Array, across: Array, true: Array) -> None:
    """Set the Cauchy stress ``true`` (4, n_elements, n_points) [MPa].

    ``across`` (n_elements, n_points) is the stretch of the thickness, 1 but in plane stress.
    """
    P = np.zeros((4, 3))
    for e in range(g.shape[0]):
        for p in range(g.shape[1]):
            xx, xy, yx, yy, hoop = _gradient(g[e, p], u[e])
            s, d, o, grown, phi, phi1, _ = _stretch(xx, xy, yx, yy)
            _by_functions(s, d, o, 1 + grown, phi, phi1, P)
            a, b, c = _in_material(P, T[0, e, p], T[1, e, p], T[3, e, p])
            Fa, Fb = 1 + xx, 1 + yy
            volume = (1 + grown) * (1 + hoop) * across[e, p]
            one_x, one_y = a * Fa + c * xy, c * Fa + b * xy
            two_x, two_y = a * yx + c * Fb, c * yx + b * Fb
            true[0, e, p] = (one_x * Fa + one_y * xy) / volume
            true[1, e, p] = (two_x * yx + two_y * Fb) / volume
            true[2, e, p] = T[2, e, p] / volume
            true[3, e, p] = _SQRT2 * (one_x * yx + one_y * Fb) / volume
