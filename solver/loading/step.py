"""One Newton step of all parts, condensed to the contact points and solved there; its acceleration.

Where forces of contact and links turn with surfaces and bodies (`Turning`), a step has, with the
stiffness K of the parts, their rigid motions R, and the unknowns of contact c,

    u = K^-1 (r + H' F - T u_c) + (R - Z) q,   Z = K^-1 (K R),   u_c = M (a + C H' F + (R - Z) q)

where T is the stiffness of the turning forces (`solver.contact.turning`), C the compliance of the
unknowns c, ``M = (1 + C T)^-1``, and a the displacements by r alone. K R is not zero under load:
the forces within a body turn with it. The resultants of all forces on the rigid motions must
vanish. The stiffness has pins or springs where they hold these motions; as the resultants vanish,
these bear no force, and a step of bodies that contact or links hold does not depend on them.

The tangent lacks derivatives of the friction bound along a surface, with small strain also those
of contact normals, and may be blended with the elastic stiffness. Newton's method then converges
like a geometric series, sometimes with a ratio of 0.9. Anderson's mixing combines the last iterates
so that the remaining step is smallest. If the missing part of the tangent is constant, this
restores Newton's method.

D.G. Anderson, J. ACM 12 (1965) 547-560; H.F. Walker, P. Ni, SIAM J. Numer. Anal. 49 (2011)
1715-1735, algorithm 2.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import block_diag

from solver.contact.candidates import Candidates
from solver.contact.links import solve_linked
from solver.contact.problem import ContactProblem
from solver.contact.system import System
from solver.contact.turning import Turning
from solver.fem.operators import Operator
from solver.fem.part import Part
from solver.linear.solvers import Begun, Singular
from solver.typing import Array, Ints

Vectors = tuple[Array, ...]


@dataclass(frozen=True, slots=True)
class NewtonStep:
    """Displacements of each part, contact forces, status, and whether pivoting was needed."""

    u: Vectors
    forces: Array
    status: Ints
    pivoted: bool

    def slope(
        self,
        system: System,
        residual: Vectors,
        candidates: Candidates,
        forces: Array,
    ) -> float:
        """Return minus the derivative of the energy along the step under given contact forces."""
        out = out_of_balance(system, residual, candidates, forces)
        return sum(float(du @ r) for du, r in zip(self.u, out, strict=True))


def on_parts(system: System, candidates: Candidates, forces: Array) -> Vectors:
    """Return the nodal forces that contact forces exert on each part [N]."""
    return tuple(candidates.all_on_part(i, forces) for i, _ in enumerate(system.parts))


def out_of_balance(
    system: System, residuals: Vectors, candidates: Candidates, forces: Array
) -> Vectors:
    """Return the out-of-balance forces of all parts under contact forces [N].

    A part that nothing holds keeps its position: forces on its rigid motions are left out.
    """
    inner = on_parts(system, candidates, forces)
    each = zip(system.parts, residuals, inner, candidates.stays, strict=True)
    return tuple(r + c - moving(part, r + c) if stays else r + c for part, r, c, stays in each)


def moving(part: Part, force: Array) -> Array:
    """Return the part (n,) of nodal forces that works on the rigid motions of a part [N]."""
    Q, _ = np.linalg.qr(part.rigid[part.free])
    out = np.zeros(part.n)
    out[part.free] = Q @ (Q.T @ force[part.free])
    return out


def newton_step(
    system: System,
    residuals: Vectors,
    operators: Sequence[Operator],
    candidates: Candidates,
    time: float = 0.0,
) -> NewtonStep | None:
    """Return the step for given tangents; None if no contact forces balance the load.

    Bodies without supports, links and pairs keep their positions.

    Parameters
    ----------
    residuals : external minus internal forces of each part, without contact forces [N]
    operators : inverse tangent of each part
    time : the time, if contact forces turn
    """
    # sum the large forces before solving: their sum is small, and the rounding of the factor, about
    # 1e-16 (size of the body / smallest element)^2, is relative to it
    balanced = out_of_balance(system, residuals, candidates, candidates.forces)
    begun = [operator.begin(r) for operator, r in zip(operators, balanced, strict=True)]
    each = zip(system.parts, candidates.stays, strict=True)
    floating = [part.rigid[:, :0] if stays else part.rigid for part, stays in each]
    touched = np.repeat(candidates.holds, [R.shape[1] for R in floating])
    turning = candidates.turning() if candidates.turning else None
    free, own, balance = [], [], []
    for part, R, operator, r, push in zip(
        system.parts, floating, operators, residuals, candidates.pushes, strict=True
    ):
        motion, D = R, np.zeros((R.shape[1],) * 2)
        if turning and R.size and (KR := part.turned_forces(time, r)) is not None:
            still = np.zeros(len(R))
            Z = np.stack([operator.begin(each).finish(still) for each in KR.T], axis=1)
            motion, D = R - Z, KR.T @ Z - R.T @ KR
        free.append(motion)
        own.append(D)
        balance.append(motion.T @ (r + push))
    given = candidates, operators, begun, free, np.concatenate(balance)
    if turning is None:
        problem, pushes = _problem(*given)
        A = problem.A
    else:
        problem, pushes = _turned_problem(*given, block_diag(*own), turning)
        A = np.hstack([candidates.of_part(i, R) for i, R in enumerate(floating)])
    last = np.arange(len(problem.W))[candidates.linked]
    problem.W[last, last] += candidates.links.compliance
    problem.offset[last] -= candidates.links.compliance * candidates.forces[last]
    solution = solve_linked(problem, A[last], touched, candidates.status)
    if solution is None:
        return None
    motions = np.split(solution.rigid, np.cumsum([R.shape[1] for R in free])[:-1])
    changes = pushes(solution.forces, solution.rigid)
    u = tuple(
        part.finish(push) + R @ q
        for part, push, R, q in zip(begun, changes, free, motions, strict=True)
    )
    if not all(np.isfinite(du).all() for du in u):
        return None
    return NewtonStep(u, solution.forces, solution.status, solution.pivoted)


def norm(vectors: Sequence[Array]) -> float:
    """Return the Euclidean norm of all vectors together."""
    return float(np.sqrt(sum(float(v @ v) for v in vectors)))


def rounding(system: System, u: Vectors) -> float:
    """Return the out-of-balance force that rounding can cause in all parts [N]."""
    each = zip(system.parts, u, strict=True)
    return float(np.hypot.reduce([part.rounding(ui) for part, ui in each]))


def unheld(system: System, candidates: Candidates) -> str:
    """Return a hint on bodies that only contact can hold, without contact forces; else empty."""
    each = zip(system.parts, candidates.holds, strict=True)
    floating = [repr(part.body.name) for part, held in each if held and part.rigid.shape[1]]
    if not floating or candidates.forces.any():
        return ""
    gap = min(candidates.motion[: candidates.n].min(initial=np.inf), candidates.beyond)
    stands = (
        f"has a gap of {gap:.3g} mm: the load must push it towards the other body"
        if gap > system.gap_tolerance
        else "touches: the load must press it against the other body, with less tangential force "
        "than friction carries"
    )
    return f"; body {' and '.join(floating)} is held by contact alone and {stands}"


_EVALUATIONS = 10
_SLACK = 0.2


def search(slope: Callable[[float], float], start: float, end: float) -> float:
    """Return the share of a step, in (0, 1], at which the energy stops falling.

    In an increment of associated plasticity the energy is convex, and ``slope`` falls through zero
    along the step. A share is accepted if its slope is at most a fifth of ``start`` in magnitude,
    or at the end of the step if the energy still falls there. This is tighter than usual: in a
    perfectly plastic body close to its limit, a loose search makes Newton's method very slow.
    The search is an Illinois iteration.

    Parameters
    ----------
    slope : (share) -> minus the derivative of the energy along the step
    start, end : its values at share zero and one; the whole step is taken if the first is not
        positive
    """
    share = 1.0
    if start <= 0 or end >= -_SLACK * start:
        return share
    low, at_low, high, at_high = 0.0, start, 1.0, end
    for _ in range(_EVALUATIONS):
        ratio = at_low / (at_low - at_high)
        share = low + (high - low) * min(max(ratio, 0.1), 0.9)
        now = slope(share)
        if abs(now) <= _SLACK * start:
            break
        if now > 0:
            low, at_low, at_high = share, now, 0.5 * at_high
        else:
            high, at_low, at_high = share, 0.5 * at_low, now
    return share


def _problem(
    candidates: Candidates,
    operators: Sequence[Operator],
    begun: Sequence[Begun],
    rigid: Sequence[Array],
    balance: Array,
) -> tuple[ContactProblem, Callable[[Array, Array], list[Array]]]:
    """Return the contact problem, and its forces and motions to changes of nodal forces.

    ``begun`` are displacements of parts by their out-of-balance forces, ``rigid`` their motions.
    """
    W, F = candidates.compliance(operators), candidates.forces
    offset = candidates.motion - W @ F
    for i, part in enumerate(begun):
        offset += candidates.of_part(i, part.kept)
    problem = ContactProblem(
        W=W,
        offset=offset,
        lines=candidates.lines,
        A=np.hstack([candidates.of_part(i, R) for i, R in enumerate(rigid)]),
        G=np.hstack([candidates.motions(i, R) for i, R in enumerate(rigid)]),
        balance=balance,
    )
    return problem, lambda forces, q: [
        candidates.on_part(i, forces - F, len(R)) for i, R in enumerate(rigid)
    ]


def _turned_problem(
    candidates: Candidates,
    operators: Sequence[Operator],
    begun: Sequence[Begun],
    rigid: Sequence[Array],
    balance: Array,
    D: Array,
    turning: Turning,
) -> tuple[ContactProblem, Callable[[Array, Array], list[Array]]]:
    """Return the problem if forces turn; ``rigid`` are R - Z, and D their resultants."""
    H, T, F = turning.rows, turning.stiffness, candidates.forces
    ends = np.cumsum([len(at) for at in turning.dofs])
    each = zip(operators, turning.dofs, strict=True)
    C = block_diag(*(operator.compliance(at, np.eye(len(at))) for operator, at in each))
    a = np.concatenate([part.kept[at] for part, at in zip(begun, turning.dofs, strict=True)])
    R = block_diag(*(of[at] for of, at in zip(rigid, turning.dofs, strict=True)))
    try:
        M = np.linalg.inv(np.eye(len(T)) + C @ T)
    except np.linalg.LinAlgError as error:
        raise Singular("forces of contact or links turn bodies that do not resist") from error
    by_motion, TM = turning.motions @ M, T @ M
    W = by_motion @ C @ H.T
    problem = ContactProblem(
        W=W,
        offset=candidates.motion + by_motion @ a - W @ F,
        lines=candidates.lines,
        A=(H - H @ (TM @ C).T) @ R,
        G=by_motion @ R,
        balance=balance - R.T @ (TM @ (a - C @ (H.T @ F))),
        D=D - R.T @ TM @ R,
    )

    def pushes(forces: Array, q: Array) -> list[Array]:
        more, nodal = H.T @ (forces - F), [np.zeros(len(of)) for of in rigid]
        change = more - TM @ (a + C @ more + R @ q)
        for of, at, end in zip(nodal, turning.dofs, ends, strict=True):
            of[at] = change[end - len(at) : end]
        return nodal

    return problem, pushes


_SLOW = 0.6
"""|step_k| / |step_k-1|: convergence is slow above this ratio."""
_PATIENCE = 5
"""Number of slow steps in a row before acceleration; a change of contact status causes a few."""
_WINDING = 3.0
"""|step_k| / |step_k-1|: a step above this ratio begins a new series."""
_ALONG = 0.7
"""Cosine of the angle between two steps: above it they have the same direction."""
_DEPTH = 5


@dataclass(slots=True)
class Series:
    """Successive whole steps that hardly decrease, with the same contact status.

    They may alternate or circle about the solution. Steps that grow in one direction may be plastic
    flow of a body and are not accelerated. A partial step ends the series: points have changed
    between elastic and plastic, so the missing part of the tangent has changed too.
    """

    _key: bytes = b""
    _slow: int = 0
    _places: list[Array] = field(default_factory=list)
    _steps: list[Array] = field(default_factory=list)

    def sum(
        self, u: Vectors, candidates: Candidates, step: NewtonStep, share: float
    ) -> tuple[Vectors, Array] | None:
        """Return accelerated displacements and contact forces after a step.

        None if convergence is fast, as nearly always: the step itself is then used.
        """
        if share < 1:
            self._slow, self._places, self._steps = 0, [], []
            return None
        place = np.concatenate([*u, candidates.forces])
        now = np.concatenate([*step.u, step.forces - candidates.forces])
        cut = np.cumsum([len(ui) for ui in u])
        n = int(cut[-1])
        key = b"".join(v.tobytes() for v in (*candidates.vertices, step.status))
        size = np.linalg.norm(now[:n])
        last = np.linalg.norm(self._steps[-1][:n]) if self._steps else 0.0
        along = now[:n] @ self._steps[-1][:n] if self._steps else 0.0
        flows = size > last and along > _ALONG * size * last
        if key != self._key or size > _WINDING * last or flows:
            self._key, self._slow, self._places, self._steps = key, 0, [], []
        elif self._slow < _PATIENCE:
            self._slow = self._slow + 1 if size > _SLOW * last else 0
        self._places = [*self._places[-_DEPTH:], place]
        self._steps = [*self._steps[-_DEPTH:], now]
        if self._slow < _PATIENCE:
            return None
        moved = np.diff(self._places, axis=0)
        changed = np.diff(self._steps, axis=0)
        weight = np.linalg.lstsq(changed[:, :n].T, now[:n])[0]
        *ahead, forces = np.split(place + now - weight @ (moved + changed), cut)
        return tuple(ahead), forces
