"""Loops compiled by numba: smallest enclosing balls, and the largest shear stress.

The types of all arguments are fixed, as in `solver.rolling.kernels`: importing this module compiles
all that is ever used, or reads what an earlier import compiled. Its users import it at the first
call. Tensors are tensor components xx, yy, zz, xy, yz, zx.
"""

from __future__ import annotations

import math

import numpy as np
from numba import float64, njit

from solver.typing import Array

_STEPS = float64[:, :, ::1]
_ROUNDING = 1e-14
"""Relative difference of squares of lengths that is rounding."""
_FLAT = 1e-20
"""Square of the distance of a point from a plane over that from its points: on the plane."""
_MOST = 400
"""Largest number of points that join a ball; of a path of 100 points about 6 do."""


@njit(cache=True, inline="always")
def _solved(A: Array, b: Array, n: int) -> None:
    """Replace b (n,) by the solution of A x = b, symmetric and positive definite (Cholesky)."""
    for j in range(n):
        for k in range(j):
            A[j, j] -= A[j, k] * A[j, k]
        A[j, j] = math.sqrt(max(A[j, j], 1e-300))
        for i in range(j + 1, n):
            for k in range(j):
                A[i, j] -= A[i, k] * A[j, k]
            A[i, j] /= A[j, j]
    for i in range(n):
        for k in range(i):
            b[i] -= A[i, k] * b[k]
        b[i] /= A[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= A[k, i] * b[k]
        b[i] /= A[i, i]


@njit(cache=True, inline="always")
def _farthest(x: Array, centre: Array) -> tuple[int, float]:
    """Return the point of x (k, n) farthest from a centre (k,), and its distance squared."""
    far, most = -1, 0.0
    for i in range(x.shape[1]):
        size = 0.0
        for a in range(len(x)):
            size += (x[a, i] - centre[a]) ** 2
        if size > most:
            far, most = i, size
    return far, most


@njit(cache=True)
def ball(x: Array, centre: Array, support: Array, share: Array, work: Array) -> tuple[float, int]:
    """Find the smallest ball around points x (k, n); return its radius and its support's size.

    It is the dual method of active sets: every ball is the smallest one around its support, its
    centre is their mean with positive shares, and each is larger than the one before.

    1. The point farthest from the centre joins, unless it is in the ball: then this is the ball.
    2. Its share t grows from zero. The centre c + t w stays equally far from the support, where w
       is the distance of the point from the plane through the support; the shares fall by t b,
       where b are the barycentric coordinates of the point's projection onto that plane.
    3. If a share falls to zero first, its point is dropped, and 2 goes on; this also happens if
       the point is on that plane. Else it goes on until the point is on the ball.

    `centre` (k,), `support` (k + 2,) and `share` (k + 2,) receive the result; `work`
    (k + 2, 2 k + 4) is overwritten.

    References
    ----------
    D. Goldfarb, A. Idnani, Math. Program. 27 (1983) 1-33, for quadratic programs.
    """
    k = len(x)
    A, edges, b = work[:, : k + 2], work[:, k + 2 : 2 * k + 2], work[:, 2 * k + 2]
    way = work[:k, 2 * k + 3]
    centre[:] = x[:, 0]
    support[0], share[0], count = 0, 1.0, 1
    radius = scale = 0.0
    for turn in range(_MOST):
        far, most = _farthest(x, centre)
        if turn == 0:
            scale = most
        if most <= radius * (1 + _ROUNDING) + _ROUNDING**2 * scale:
            break
        gained = 0.0
        while True:
            p, m = int(support[0]), count - 1
            for i in range(m):
                b[i + 1] = 0.0
                for a in range(k):
                    edges[i, a] = x[a, int(support[i + 1])] - x[a, p]
                    b[i + 1] += edges[i, a] * (x[a, far] - x[a, p])
                for j in range(i + 1):
                    A[i, j] = 0.0
                    for a in range(k):
                        A[i, j] += edges[i, a] * edges[j, a]
            _solved(A, b[1:], m)
            b[0] = 1.0
            for i in range(m):
                b[0] -= b[i + 1]
            length = whole = radius = away = 0.0
            for a in range(k):
                way[a] = x[a, far] - x[a, p]
                whole += way[a] * way[a]
                for i in range(m):
                    way[a] -= b[i + 1] * edges[i, a]
                length += way[a] * way[a]
                radius += (x[a, p] - centre[a]) ** 2
                away += (x[a, far] - centre[a]) ** 2
            free = m < k and length > _FLAT * whole
            step, drop = (away - radius) / (2 * length) if free else math.inf, -1
            for i in range(count):
                if b[i] > 0.0 and share[i] < step * b[i]:
                    step, drop = share[i] / b[i], i
            if step == math.inf:  # it is on the plane, and rounding alone puts it outside
                break
            for i in range(count):
                share[i] -= step * b[i]
            if free:
                for a in range(k):
                    centre[a] += step * way[a]
            gained += step
            if drop < 0:
                break
            count -= 1
            for i in range(drop, count):
                support[i], share[i] = support[i + 1], share[i + 1]
            if count == 0:
                break
        support[count], share[count] = far, gained
        count += 1
        radius = 0.0
        for a in range(k):
            radius += (x[a, far] - centre[a]) ** 2
    return math.sqrt(radius), count


@njit((_STEPS,), cache=True)
def balls(x: Array) -> tuple[Array, Array]:
    """Return centres (n_paths, k) and radii (n_paths,) of the smallest balls around paths.

    Parameters
    ----------
    x : (n_paths, k, n_instants)
    """
    n_paths, k, _ = x.shape
    centres, radii = np.empty((n_paths, k)), np.empty(n_paths)
    support, share, work = np.empty(k + 2), np.empty(k + 2), np.empty((k + 2, 2 * k + 4))
    for path in range(n_paths):
        radii[path], _count = ball(x[path], centres[path], support, share, work)
    return centres, radii


@njit((_STEPS,), cache=True)
def largest_shear(x: Array) -> Array:
    """Return half the difference of the outer principal values (n_points, n_instants).

    The closed form loses half the digits where two values are equal: use it to choose an instant.

    Parameters
    ----------
    x : (n_points, 6, n_instants) deviators
    """
    n_points, _, n = x.shape
    found = np.empty((n_points, n))
    for point in range(n_points):
        for t in range(n):
            a, b, c = x[point, 0, t], x[point, 1, t], x[point, 2, t]
            d, e, f = x[point, 3, t], x[point, 4, t], x[point, 5, t]
            second = (a * a + b * b + c * c) / 2 + d * d + e * e + f * f
            third = a * (b * c - e * e) - d * (d * c - e * f) + f * (d * e - b * f)
            sine = 0.0
            if second > 0.0:
                sine = max(-1.0, min(1.0, 1.5 * math.sqrt(3.0) * third / second**1.5))
            found[point, t] = math.sqrt(second) * math.cos(math.asin(sine) / 3)
    return found
