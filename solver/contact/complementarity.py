"""The frictional contact problem on the contact points, solved exactly.

`solver.contact.problem` states it. A semismooth Newton method on the active sets solves nearly
every instance in a few dense solves. If the sets cycle, passes follow with the friction bound of
the previous pass: each is a convex problem, solved by Lemke's method, and its result is a better
start for the active sets. (Lemke's method on the whole frictional problem in A. Klarbring's form,
Ingenieur-Archiv 56 (1986) 529-541, ends in a ray for most instances: its matrix is not copositive.)
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import linalg

from solver.contact.given_bound import given_bound
from solver.contact.problem import BACKWARD, FORWARD, OPEN, STICK, ContactProblem, ContactSolution
from solver.model.friction import LEAST_FRICTION, BoundLines
from solver.typing import Array, Ints

_MAX_SETS = 40
_MAX_PASSES = 20
_LESS = 0.1
"""Factor of the friction bound in the next pass, after friction alone carried the load."""
_TOLERANCE = LEAST_FRICTION
_FAR = 1e-4
"""Least length scale of closed points, over the largest gap: gaps are known up to rounding."""
_ROUNDING = 1e-14
_ACCURATE = 1e-6
_CONSISTENT = 1e-12
"""Relative residual of a least-squares solution: a smaller one is rounding. A larger one is a load
that contact cannot balance, even with tiny friction."""
_FIRST = 1e3
"""Weight of the force balance, relative to that of gaps, in a least-squares solution."""
_KNOWN = 1e-8


def solve_contact(problem: ContactProblem, start: Ints) -> ContactSolution | None:
    """Return the solution; None if there is none or none was found.

    ``start`` (n,) is the initial status of the points, usually that of the previous iteration.
    """
    if problem.n == 0:
        empty = np.zeros(0)
        solvable = not problem.balance.size
        return ContactSolution(empty, empty, start, False) if solvable else None
    if _at_rest(problem):
        nothing = np.zeros_like(problem.offset), np.zeros_like(problem.balance)
        return ContactSolution(*nothing, np.full_like(start, OPEN), False)
    return _active_sets(problem, start, np.zeros(problem.n, dtype=int)) or _lag_bound(problem)


def _at_rest(problem: ContactProblem) -> bool:
    """Whether no point touches and no force acts: free bodies then keep their positions."""
    gaps = problem.offset[: problem.n]
    force, length = replace(problem, balance=np.zeros(0)).scales
    apart = bool((gaps > _TOLERANCE * length).all())
    return apart and bool((np.abs(problem.balance) <= _CONSISTENT * force).all())


def change_of(
    problem: ContactProblem, solution: ContactSolution, offset: Array
) -> tuple[Array, Array]:
    """Return the changes of forces (m,) and rigid motions (k,) if the offset changes.

    ``offset`` (m,) is its change [mm]. The status of all points is fixed; slipping points keep
    their tangential force at the bound.
    """
    lines = problem.lines
    piece = lines.piece(solution.forces[: problem.n])
    alone = BoundLines(lines.slope, np.zeros_like(lines.level))
    changed = replace(problem, offset=offset, balance=0 * problem.balance)
    nothing_moves = np.zeros_like(offset), np.zeros_like(solution.rigid)
    found = _forces(changed, solution.status, piece, alone)
    return nothing_moves if found is None or found[2].any() else found[:2]


def _forces(
    problem: ContactProblem, status: Ints, piece: Ints, bound: BoundLines
) -> tuple[Array, Array, Array] | None:
    """Return forces and rigid motions of given statuses, or None for a singular system.

    ``piece`` (n,) is the line of the ``bound`` that gives the tangential force of a slipping point.
    The third array (k,) is the part of the load that these points cannot balance, a motion that
    none of them resists; zero if they balance all of it.
    """
    n, k, rough = problem.n, len(problem.balance), problem.lines.rough
    closed = np.flatnonzero(status != OPEN)
    stick = np.flatnonzero(status == STICK) if problem.frictional else closed[:0]
    if problem.frictional:
        stick = stick[rough[stick]]
    if not len(closed) and not k:
        return np.zeros(len(problem.offset)), np.zeros(0), np.zeros(0)
    # columns: normal forces, with the friction proportional to them where the point slips, then
    # tangential forces of sticking points; the constant part of friction is known
    P = np.zeros((len(problem.offset), len(closed) + len(stick)))
    known = np.zeros(len(problem.offset))
    P[closed, np.arange(len(closed))] = 1.0
    if problem.frictional:
        sign = np.where(status[closed] == FORWARD, -1.0, 0.0)
        sign[status[closed] == BACKWARD] = 1.0
        slope, given = (of[piece[closed], closed] for of in bound)
        P[n + closed, np.arange(len(closed))] = sign * slope
        known[n + closed[sign != 0]] = (sign * given)[sign != 0]
        P[n + stick, len(closed) + np.arange(len(stick))] = 1.0
    rows = np.concatenate([closed, n + stick])
    size = len(rows)
    S = np.zeros((size + k, size + k))
    S[:size, :size] = problem.W[rows] @ P
    S[:size, size:] = problem.turned[rows]
    S[size:, :size] = problem.A.T @ P
    S[size:, size:] = 0.0 if problem.D is None else problem.D
    rhs = -np.concatenate([problem.offset[rows], problem.balance])
    rhs -= np.concatenate([problem.W[rows] @ known, problem.A.T @ known])
    # forces and motions differ in magnitude by the compliance: scale the rows
    weight = np.ones(size + k)
    if k and size:
        weight[size:] = np.abs(problem.W[rows, rows]).max() / np.abs(problem.A).max()
        S *= weight[:, None] * weight[None, :]
    rhs *= weight
    # with fewer conditions than rigid motions the matrix is singular: the body can rotate about its
    # only contact point. A factorisation would rotate it by rounding; least squares does not
    free, rest = 0 < size < k, np.zeros(k)
    if not free:
        _, _, solution, info = linalg.lapack.dgesv(S, rhs)
        free = bool(info) or not _solves(S, solution, rhs)
        if free and (not size or np.linalg.matrix_rank(problem.turned[rows]) == k):
            return None
    if free:
        # if a body slips on all points, rounding of positions may prevent an exact solution: gaps
        # may miss their conditions by this rounding, the force balance may not
        forces = np.arange(size + k) >= size
        first = np.where(forces, _FIRST, 1.0)
        solution = linalg.lstsq(first[:, None] * S, first * rhs)[0]
        least = _CONSISTENT * np.abs(rhs).max(initial=0.0)
        allowed = np.where(forces, least, max(least, _TOLERANCE * problem.scales[1]))
        miss = S @ solution - rhs
        if (np.abs(miss) > allowed).any():
            rest = miss[size:] * weight[size:]
            if not rest.any():
                return None
    solution *= weight
    return P @ solution[:size] + known, solution[size:], rest


def _solves(S: Array, solution: Array, rhs: Array) -> bool:
    miss = np.abs(S @ solution - rhs).max(initial=0.0)
    return bool(miss <= _ACCURATE * np.abs(rhs).max(initial=0.0))


def _active_sets(problem: ContactProblem, start: Ints, piece: Ints) -> ContactSolution | None:
    """Return the solution reached from a status; None if the sets cycle or a system is singular.

    ``piece`` (n,) is the line of the bound that gives the tangential force of a slipping point.
    """
    n, lines, points = problem.n, problem.lines, np.arange(problem.n)
    rough, steepest = lines.rough, lines.slope.max(axis=0)
    force, length = problem.scales
    near = max(-problem.offset[:n].min(), _FAR * length)  # length scale of closed points
    tiny_force, tiny_length = _TOLERANCE * force, _TOLERANCE * near
    # a small share of the tangential force even with little friction, but not below rounding
    tiny_shear = force * np.clip(_ACCURATE * steepest, _ROUNDING, _TOLERANCE)
    status = start.copy()
    if problem.balance.size and not (status != OPEN).any():
        status[np.argmin(problem.offset[:n])] = STICK
    seen = set()
    for _ in range(_MAX_SETS):
        key = status.tobytes() + piece.tobytes()
        if key in seen:
            return None
        seen.add(key)
        found = _forces(problem, status, piece, lines)
        if found is None:
            return None
        F, q, rest = found
        motion = problem.moved(F, q)
        if rest.any():
            stopped = _stopped(status, motion, problem.turned @ rest)
            if stopped is None:
                return None
            status, piece = stopped, np.where(stopped > STICK, piece, 0)
            continue
        N, gap = F[:n], motion[:n]
        closed = status != OPEN
        new = np.where(closed & (N < -tiny_force), OPEN, status)
        new[~closed & (gap < -tiny_length)] = STICK
        if problem.frictional:
            T, slip = F[n:], motion[n:]
            bound = lines.least(N) + tiny_shear
            keep = closed & (new != OPEN) & rough
            new[keep & (status == STICK) & (T > bound)] = BACKWARD
            new[keep & (status == STICK) & (T < -bound)] = FORWARD
            new[keep & (status == FORWARD) & (slip < -tiny_length)] = STICK
            new[keep & (status == BACKWARD) & (slip > tiny_length)] = STICK
        # a point keeps its line within the tolerance, so that rounding causes no cycle
        bounds = lines.slope * N + lines.level
        least = bounds.argmin(axis=0)
        stays = bounds[piece, points] <= bounds[least, points] + tiny_force
        onto = np.where(rough & (new > STICK), np.where(stays, piece, least), 0)
        if np.array_equal(new, status) and np.array_equal(onto, piece):
            return ContactSolution(F, q, status, False)
        status, piece = new, onto
    return None


def _stopped(status: Ints, motion: Array, rate: Array) -> Ints | None:
    """Return the statuses after a body has moved until one more point closes or sticks.

    ``rate`` (m,) is the rate of ``motion``, the gaps and slips. None if no point stops the body.
    """
    n = len(status)
    signs = np.zeros_like(motion)
    signs[:n][status == OPEN] = 1.0
    if len(motion) > n:
        signs[n:][status == FORWARD], signs[n:][status == BACKWARD] = 1.0, -1.0
    approaches = signs * rate < 0
    if not approaches.any():
        return None
    time = np.full(len(motion), np.inf)
    time[approaches] = -motion[approaches] / rate[approaches]
    out = status.copy()
    out[np.argmin(time) % n] = STICK
    return out


def _lag_bound(problem: ContactProblem) -> ContactSolution | None:
    """Return the solution found in passes, each a convex problem with the bound of the last one.

    The active-set method restarts from the status of every pass. Its solution is exact, and the
    passes themselves need not converge.
    """
    n, lines, rough = problem.n, problem.lines, problem.lines.rough
    force, _ = problem.scales
    # begin with a large bound: in every pass friction must be able to hold a floating body
    bound = lines.least(np.full(n, force if len(problem.balance) else 0.0))
    for _ in range(_MAX_PASSES):
        solved = given_bound(problem, bound)
        if solved is None:
            return None
        F, q = solved
        N = np.maximum(F[:n], 0.0)
        status = np.where(N > 1e-9 * force, STICK, OPEN)
        if problem.frictional:
            sliding = (status != OPEN) & rough
            reached = np.abs(F[n:]) >= bound * (1 - 1e-9)
            slip = problem.moved(F, q)[n:]
            ahead = np.where(bound > 0, -F[n:], slip)  # without friction the slip has the direction
            status[sliding & reached & (ahead > 0)] = FORWARD
            status[sliding & reached & (ahead < 0)] = BACKWARD
        on = np.where(status > STICK, lines.piece(N), 0)
        found = _active_sets(problem, status, on)
        if found is not None:
            return ContactSolution(found.forces, found.rigid, found.status, True)
        touching = (status != OPEN).any()
        # friction on inclined surfaces may carry the whole load without any pressure
        before, bound = bound, lines.least(N) if touching else _LESS * bound
        settled = np.abs(bound - before).max() <= 1e-12 * before.max()
        if settled or not touching:
            F = np.where(np.resize(status, len(F)) == OPEN, 0.0, F)
            if _holds(problem, F, q):
                return ContactSolution(F, q, status, True)
        if settled:
            return None
    return None


def _holds(problem: ContactProblem, F: Array, q: Array) -> bool:
    """Whether forces and motions satisfy all conditions.

    A solution of a pass may belong to no set of statuses: if no force rotates a body, every
    rotation that keeps its open points open is a solution.
    """
    n, (force, length) = problem.n, problem.scales
    motion = problem.moved(F, q)
    N, met = F[:n], np.minimum(F[:n] / force, motion[:n] / length)
    off = np.concatenate([met, problem.unbalanced(F, q) / force])
    if problem.frictional:
        bound = problem.lines.least(N) / force
        T, slip = F[n:] / force, motion[n:] / length
        off = np.concatenate([off, np.clip(T - slip, -bound, bound) - T])
    return bool((np.abs(off) <= _KNOWN).all())
