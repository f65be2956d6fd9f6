"""The frictional contact problem on the contact points, solved exactly.

Unknowns are the normal forces N >= 0 and tangential forces T at n points and the free rigid
motions q of bodies held by contact alone. With ``F = (N, T)`` (without friction ``F = N``)::

    (gap, slip) = offset + W F + A q        0 = balance + A' F
    N >= 0, gap >= 0, N gap = 0
    |T| <= mu N,  slip = 0 where below,  T = -mu N sign(slip) where equal

Active sets by semismooth Newton solve nearly every instance in a few dense solves. Where the
sets cycle, the friction bound is lagged: each pass is a convex problem, solved by Lemke's
method, and gives the active sets a better start. (Lemke's method on the whole frictional
problem in A. Klarbring's form, Ingenieur-Archiv 56 (1986) 529-541, ends in a ray for most
instances: its matrix is not copositive.)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

if TYPE_CHECKING:
    from numpy.typing import NDArray

OPEN, STICK, FORWARD, BACKWARD = 0, 1, 2, 3
_MAX_SETS = 40
_MAX_PASSES = 20
_PIVOTS_PER_UNKNOWN = 20
_TOLERANCE = 1e-10
_ACCURATE = 1e-6


@dataclass(frozen=True, slots=True)
class ContactProblem:
    """One instance.

    Attributes
    ----------
    W : (m, m) compliance of the contact points [mm/N], m = 2n with friction, n without
    offset : (m,) gap and slip at zero force [mm]
    friction : (n,) coefficient at each point; zero holds the tangential force at zero
    A : (m, k) gap and slip of the free rigid motions
    balance : (k,) resultants of all other forces on those motions [N]
    """

    W: NDArray[np.float64]
    offset: NDArray[np.float64]
    friction: NDArray[np.float64]
    A: NDArray[np.float64]
    balance: NDArray[np.float64]

    @property
    def n(self) -> int:
        """Number of contact points."""
        return len(self.friction)

    @property
    def frictional(self) -> bool:
        """Whether tangential unknowns exist."""
        return len(self.offset) > self.n


@dataclass(frozen=True, slots=True)
class ContactSolution:
    """Forces (m,), rigid motions (k,), the status of each point, and how it was found."""

    forces: NDArray[np.float64]
    rigid: NDArray[np.float64]
    status: NDArray[np.int64]
    pivoted: bool


def solve_contact(problem: ContactProblem, start: NDArray[np.int64]) -> ContactSolution | None:
    """Return the solution, or None when there is none (or none was found).

    ``start`` (n,) is the status to begin with, usually that of the iteration before.
    """
    if problem.n == 0:
        empty = np.zeros(0)
        solvable = not problem.balance.size
        return ContactSolution(empty, empty, start, False) if solvable else None
    return _active_sets(problem, start) or _lag_bound(problem)


def _scales(problem: ContactProblem) -> tuple[float, float]:
    """Return a force [N] and a length [mm] that tolerances refer to."""
    compliance = np.abs(np.diag(problem.W)).max()
    length = np.abs(problem.offset[: problem.n]).max()
    force = np.abs(problem.balance).sum()
    length = max(length, force * compliance * 1e-3, 1e-30)
    return max(force, length / compliance), length


def _forces(
    problem: ContactProblem, status: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Return forces and rigid motions of given statuses, or None for a singular system."""
    n, k = problem.n, len(problem.balance)
    closed = np.flatnonzero(status != OPEN)
    stick = np.flatnonzero(status == STICK) if problem.frictional else closed[:0]
    if problem.frictional:
        stick = stick[problem.friction[stick] > 0]
    if not len(closed) and not k:
        return np.zeros(len(problem.offset)), np.zeros(0)
    # columns of F: each normal force carries the friction force of a slipping point
    P = np.zeros((len(problem.offset), len(closed) + len(stick)))
    P[closed, np.arange(len(closed))] = 1.0
    if problem.frictional:
        sign = np.where(status[closed] == FORWARD, -1.0, 0.0)
        sign[status[closed] == BACKWARD] = 1.0
        P[n + closed, np.arange(len(closed))] = sign * problem.friction[closed]
        P[n + stick, len(closed) + np.arange(len(stick))] = 1.0
    rows = np.concatenate([closed, n + stick])
    size = len(rows)
    S = np.zeros((size + k, size + k))
    S[:size, :size] = problem.W[rows] @ P
    S[:size, size:] = problem.A[rows]
    S[size:, :size] = problem.A.T @ P
    rhs = -np.concatenate([problem.offset[rows], problem.balance])
    # forces and motions differ by the magnitude of the compliance: balance the rows
    weight = np.ones(size + k)
    if k and size:
        weight[size:] = np.abs(problem.W[rows, rows]).max() / np.abs(problem.A).max()
        S *= weight[:, None] * weight[None, :]
    rhs *= weight
    _, _, solution, info = linalg.lapack.dgesv(S, rhs)
    if info or not _solves(S, solution, rhs):
        if not size or np.linalg.matrix_rank(problem.A[rows]) == k:
            return None
        # a body on one point is free to turn about it, and stays where nothing turns it
        solution = linalg.lstsq(S, rhs)[0]
        if not _solves(S, solution, rhs):
            return None
    solution *= weight
    return P @ solution[:size], solution[size:]


def _solves(
    S: NDArray[np.float64], solution: NDArray[np.float64], rhs: NDArray[np.float64]
) -> bool:
    miss = np.abs(S @ solution - rhs).max(initial=0.0)
    return bool(miss <= _ACCURATE * np.abs(rhs).max(initial=0.0))


def _active_sets(problem: ContactProblem, start: NDArray[np.int64]) -> ContactSolution | None:
    n, mu = problem.n, problem.friction
    force, length = _scales(problem)
    tiny_force, tiny_length = _TOLERANCE * force, _TOLERANCE * length
    status = start.copy()
    if problem.balance.size and not (status != OPEN).any():
        status[np.argmin(problem.offset[:n])] = STICK
    seen = set()
    for _ in range(_MAX_SETS):
        key = status.tobytes()
        if key in seen:
            return None
        seen.add(key)
        found = _forces(problem, status)
        if found is None:
            return None
        F, q = found
        motion = problem.offset + problem.W @ F + problem.A @ q
        N, gap = F[:n], motion[:n]
        closed = status != OPEN
        new = np.where(closed & (N < -tiny_force), OPEN, status)
        new[~closed & (gap < -tiny_length)] = STICK
        if problem.frictional:
            T, slip = F[n:], motion[n:]
            bound = mu * np.maximum(N, 0) + tiny_force
            keep = closed & (new != OPEN) & (mu > 0)
            new[keep & (status == STICK) & (T > bound)] = BACKWARD
            new[keep & (status == STICK) & (T < -bound)] = FORWARD
            new[keep & (status == FORWARD) & (slip < -tiny_length)] = STICK
            new[keep & (status == BACKWARD) & (slip > tiny_length)] = STICK
        if np.array_equal(new, status):
            return ContactSolution(F, q, status, False)
        status = new
    return None


def _lag_bound(problem: ContactProblem) -> ContactSolution | None:
    """Solve passes with the friction bound of the pass before, each a convex problem.

    After every pass the active sets start once more from what it found, so that the answer is
    exact and the passes need not converge themselves.
    """
    n, mu = problem.n, problem.friction
    force, _ = _scales(problem)
    # from above: a motion that friction has to hold must find enough of it in every pass
    bound = mu * force if len(problem.balance) else np.zeros(n)
    for _ in range(_MAX_PASSES):
        F = _given_bound(problem, bound)
        if F is None:
            return None
        N = np.maximum(F[:n], 0.0)
        status = np.where(N > 1e-9 * force, STICK, OPEN)
        if problem.frictional:
            sliding = (status != OPEN) & (mu > 0)
            reached = np.abs(F[n:]) >= bound * (1 - 1e-9)
            status[sliding & reached & (F[n:] < 0)] = FORWARD
            status[sliding & reached & (F[n:] > 0)] = BACKWARD
        found = _active_sets(problem, status)
        if found is not None:
            return ContactSolution(found.forces, found.rigid, found.status, True)
        if np.abs(mu * N - bound).max() < 1e-12 * force:
            return None
        bound = mu * N
    return None


def _given_bound(problem: ContactProblem, bound: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the forces when |T| <= bound is given: a convex problem, by Lemke's method.

    z = (N, tau, back), w = (gap, fore, sigma) with tau = T + bound, sigma = bound - T and
    slip = fore - back: the matrix is positive semidefinite, so the method ends with a
    solution where one exists. Rigid motions are eliminated by a principal pivot on as many
    contact forces as there are motions.
    """
    # compiled, and rarely needed: only who comes here pays for importing the compiler
    from solver.contact.lemke import lemke

    n, k = problem.n, len(problem.balance)
    # scaled so that forces and gaps are of order one
    force, length = _scales(problem)
    at = np.flatnonzero(bound > 0) if problem.frictional else np.zeros(0, dtype=int)
    m = len(at)
    rows = np.concatenate([np.arange(n), n + at])
    limit = bound[at] / force
    M = np.zeros((n + 2 * m, n + 2 * m))
    M[: n + m, : n + m] = force / length * problem.W[np.ix_(rows, rows)]
    M[n : n + m, n + m :] = np.eye(m)
    M[n + m :, n : n + m] = -np.eye(m)
    r = np.concatenate([problem.offset[rows] / length, 2 * limit])
    r[: n + m] -= M[: n + m, n : n + m] @ limit
    held = np.zeros(0, dtype=int)
    if k:
        shape = np.abs(problem.A).max()
        A = np.zeros((n + 2 * m, k))
        A[: n + m] = problem.A[rows] / shape
        balance = problem.balance / (force * shape) - A[n : n + m].T @ limit
        held = linalg.qr(A[: n + m].T, mode="r", pivoting=True)[1][:k]
        if len(held) < k:  # too few points to hold what floats
            return None
        eliminated = _eliminate(M, r, A, A.T, balance, held)
        if eliminated is None:
            return None
        M, r = eliminated
    z, solved = lemke(M, r, _PIVOTS_PER_UNKNOWN * len(r))
    if not solved:
        return None
    if k:
        z[held] = (M @ z + r)[held]
    F = np.zeros(len(problem.offset))
    F[:n] = force * z[:n]
    F[n + at] = force * (z[n : n + m] - limit)
    return F


def _eliminate(
    M: NDArray[np.float64],
    r: NDArray[np.float64],
    A: NDArray[np.float64],
    columns: NDArray[np.float64],
    balance: NDArray[np.float64],
    held: NDArray[np.int64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Exchange the normal forces ``held`` with their gaps, and remove the rigid motions."""
    N, k = M.shape[0], len(held)
    rest = np.setdiff1d(np.arange(N), held)
    block = np.zeros((2 * k, 2 * k))
    block[:k, :k] = M[np.ix_(held, held)]
    block[:k, k:] = A[held]
    block[k:, :k] = columns[:, held]
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
