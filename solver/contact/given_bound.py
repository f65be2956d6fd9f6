"""The contact problem with fixed friction bounds, a convex problem, by Lemke's method."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from solver.contact.problem import ContactProblem
from solver.typing import Array, Bools, Ints

_PIVOTS_PER_UNKNOWN = 20


def given_bound(problem: ContactProblem, bound: Array) -> tuple[Array, Array] | None:
    """Return forces (m,) and rigid motions (k,) with |T| <= bound (n,), or None without a solution.

    z = (N, tau, back), w = (gap, fore, sigma) with tau = T / bound + 1, sigma = 1 - T / bound
    and slip = fore - back. The matrix is positive semidefinite up to a scaling of its columns, so
    the method finds a solution if one exists. Tangential forces in units of their bounds are as
    accurate as normal forces, even with tiny friction. Rigid motions are eliminated by a principal
    pivot on as many normal forces.
    """
    n, k = problem.n, len(problem.balance)
    # scales make forces and gaps of order one
    force, length = problem.scales
    at = np.flatnonzero(bound > 0) if problem.frictional else np.zeros(0, dtype=int)
    m = len(at)
    rows = np.concatenate([np.arange(n), n + at])
    limit = bound[at] / force
    unit = np.concatenate([np.ones(n), limit])
    M = np.zeros((n + 2 * m, n + 2 * m))
    M[: n + m, : n + m] = force / length * problem.W[np.ix_(rows, rows)] * unit
    M[n : n + m, n + m :] = np.eye(m)
    M[n + m :, n : n + m] = -np.eye(m)
    r = np.concatenate([problem.offset[rows] / length, np.full(m, 2.0)])
    r[: n + m] -= M[: n + m, n : n + m].sum(axis=1)
    held = np.zeros(0, dtype=int)
    if k:
        shape = np.abs(problem.A).max()
        A = np.zeros((n + 2 * m, k))
        A[: n + m] = problem.A[rows] / shape
        columns = np.zeros((k, n + 2 * m))
        columns[:, : n + m] = A[: n + m].T * unit
        balance = problem.balance / (force * shape) - columns[:, n : n + m].sum(axis=1)
        held = linalg.qr(A[: n + m].T, mode="r", pivoting=True)[1][:k]
        if len(held) < k or np.linalg.matrix_rank(A[held]) < k:
            return None  # the points are too few, or too close, to hold the floating bodies
        D = np.zeros((k, k)) if problem.D is None else problem.D * (length / (force * shape**2))
        eliminated = _eliminate(M, r, A, columns, balance, D, held)
        if eliminated is None:
            return None
        whole, (M, r) = (M[held], r[held]), eliminated
    z, solved = lemke(M, r, _PIVOTS_PER_UNKNOWN * len(r))
    if not solved:
        return None
    q = np.zeros(k)
    if k:
        motion = z[held]
        z[held] = (M @ z + r)[held]
        q = np.linalg.solve(A[held], motion - whole[0] @ z - whole[1]) * length / shape
    F = np.zeros(len(problem.offset))
    F[:n] = force * z[:n]
    F[n + at] = bound[at] * (z[n : n + m] - 1)
    return F, q


def _eliminate(
    M: Array,
    r: Array,
    A: Array,
    columns: Array,
    balance: Array,
    D: Array,
    held: Ints,
) -> tuple[Array, Array] | None:
    """Exchange the normal forces ``held`` with their gaps, and eliminate the rigid motions."""
    N, k = M.shape[0], len(held)
    rest = np.setdiff1d(np.arange(N), held)
    block = np.zeros((2 * k, 2 * k))
    block[:k, :k] = M[np.ix_(held, held)]
    block[:k, k:] = A[held]
    block[k:, :k] = columns[:, held]
    block[k:, k:] = D
    known = np.zeros((2 * k, N + 1))  # of (gap at held, other z, 1)
    known[np.arange(k), held] = 1.0
    known[:k, rest] = -M[np.ix_(held, rest)]
    known[k:, rest] = -columns[:, rest]
    known[:k, N] = -r[held]
    known[k:, N] = -balance
    try:
        inner = np.linalg.solve(block, known)
    except np.linalg.LinAlgError:
        return None
    new = np.zeros((N, N + 1))
    new[held] = inner[:k]
    new[rest] = M[np.ix_(rest, held)] @ inner[:k] + A[rest] @ inner[k:]
    new[np.ix_(rest, rest)] += M[np.ix_(rest, rest)]
    new[rest, N] += r[rest]
    return new[:, :N], new[:, N]


def lemke(M: Array, r: Array, max_pivots: int) -> tuple[Array, bool]:
    """Solve ``w = M z + r, w >= 0, z >= 0, w z = 0`` by Lemke's complementary pivoting.

    Returns
    -------
    z (n,), and whether it is a solution: false after a secondary ray or too many pivots.

    References
    ----------
    R.W. Cottle, J.-S. Pang, R.E. Stone, The Linear Complementarity Problem (1992), algorithm 4.4.5.
    """
    n = len(r)
    z = np.zeros(n)
    if r.min() >= 0:
        return z, True
    # tableau of basic = T @ (w, z, z0, 1); variables 0..n-1 are w, n..2n-1 z, 2n is z0
    T = np.hstack([np.eye(n), -M, np.full((n, 1), -1.0), r[:, None]])
    change = np.empty_like(T)
    basis = np.arange(n)
    row = int(np.argmin(r))
    entering = 2 * n
    for _ in range(max_pivots):
        T[row] /= T[row, entering]
        factors = T[:, entering].copy()
        factors[row] = 0.0
        T -= np.multiply.outer(factors, T[row], out=change)
        leaving = basis[row]
        basis[row] = entering
        if leaving == 2 * n:
            found = (n <= basis) & (basis < 2 * n)
            z[basis[found] - n] = T[found, 2 * n + 1]
            return z, True
        entering = leaving + n if leaving < n else leaving - n
        row = _leaving(T[:, entering], T[:, 2 * n + 1], basis == 2 * n)
        if row < 0:
            return z, False
    return z, False


def _leaving(column: Array, values: Array, artificial: Bools) -> int:
    """Return the row of the least ratio, preferably that of z0 among equal ones; -1 if none."""
    rows = np.flatnonzero(column > 1e-11 * np.abs(column).max())
    ratios = np.maximum(values[rows], 0.0) / column[rows]
    best, found = np.inf, -1
    for i, ratio, z0 in zip(rows.tolist(), ratios.tolist(), artificial[rows].tolist(), strict=True):
        if ratio < best or (z0 and ratio <= best * (1 + 1e-12)):
            best, found = ratio, i
    return found
