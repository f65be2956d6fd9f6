"""One Newton step of all parts, condensed to the contact points and solved there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from solver.contact.candidates import Candidates
from solver.contact.links import solve_linked
from solver.contact.problem import ContactProblem, ContactSolution
from solver.contact.system import System
from solver.fem.operators import Operator
from solver.fem.part import Part
from solver.linear.solvers import Begun
from solver.loading.turned import turned_problem
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
    pushed = [r + p for r, p in zip(residuals, candidates.pushes, strict=True)]
    touched = np.repeat(candidates.holds, [R.shape[1] for R in floating])

    def solved(problem: ContactProblem) -> ContactSolution | None:
        links, last = len(candidates.links), np.arange(len(problem.W))[candidates.linked]
        problem.W[last, last] += candidates.links.compliance
        problem.offset[last] -= candidates.links.compliance * candidates.forces[last]
        return solve_linked(problem, links, touched, candidates.status)

    solution = None
    if candidates.turning is not None and not len(candidates.links):
        forces = on_parts(system, candidates, candidates.forces)
        rigid = [
            (R, part.turned_forces(time, own) if R.size else None)
            for part, R, own in zip(system.parts, floating, forces, strict=True)
        ]
        problem, moved = turned_problem(
            candidates, candidates.turning(), operators, begun, rigid, pushed
        )
        solution = solved(problem)
    if solution is None:  # the forces that turn are those of contacts that may open
        problem, moved = _plain_problem(system, candidates, operators, begun, floating, pushed)
        solution = solved(problem)
    if solution is None:
        return None
    u = moved(solution.forces, solution.rigid)
    if not all(np.isfinite(du).all() for du in u):
        return None
    return NewtonStep(u, solution.forces, solution.status, solution.pivoted)


def _plain_problem(
    system: System,
    candidates: Candidates,
    operators: Sequence[Operator],
    begun: Sequence[Begun],
    floating: Sequence[Array],
    residuals: Sequence[Array],
) -> tuple[ContactProblem, Callable[[Array, Array], Vectors]]:
    """Return the contact problem, and a function of its forces and motions to displacements."""
    W = candidates.compliance(operators)
    motion = candidates.motion - W @ candidates.forces
    for i, part in enumerate(begun):
        motion += candidates.of_part(i, part.kept)
    problem = ContactProblem(
        W=W,
        offset=motion,
        lines=candidates.lines,
        A=np.hstack([candidates.of_part(i, R) for i, R in enumerate(floating)]),
        G=np.hstack([candidates.motions(i, R) for i, R in enumerate(floating)]),
        balance=np.concatenate([R.T @ r for R, r in zip(floating, residuals, strict=True)]),
    )

    def moved(forces: Array, q: Array) -> Vectors:
        more = forces - candidates.forces
        change = [candidates.on_part(i, more, part.n) for i, part in enumerate(system.parts)]
        rigid = np.split(q, np.cumsum([R.shape[1] for R in floating])[:-1])
        each = zip(begun, change, floating, rigid, strict=True)
        return tuple(part.finish(c) + R @ own for part, c, R, own in each)

    return problem, moved


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
