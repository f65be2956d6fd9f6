"""One load increment: plasticity outside, contact inside.

From the last converged state, at the current displacements:

1. constitutive update: internal force and consistent tangent K of every part; friction is not
   in K, which stays symmetric
2. contact geometry: gap, slip and their derivative rows H at the candidate vertices
3. compliance of the contact points ``W = H K^-1 H'``
4. the frictional contact problem on W, exactly; the free rigid motions of parts held by contact
   alone are extra unknowns with exact balance equations, as in FETI. Where the problem has no
   solution the tangent is too soft, and is blended with the elastic stiffness
5. line search on the plastic residual, contact forces interpolated
6. converged when the residual, contact forces included, and the contact conditions vanish

Without an extrapolated guess the first iteration uses the elastic operator: after a reversal of
load a plastic tangent of the step before would diverge.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.contact.candidates import Candidates, find_candidates, no_candidates
from solver.contact.complementarity import ContactProblem, solve_contact
from solver.line_search import search
from solver.linear import Singular
from solver.outcome import Converged, IncrementFailed, Tolerances, Yielded
from solver.state import State
from solver.threads import one_thread

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.constitutive import Response
    from solver.operators import Operator
    from solver.state import ContactState
    from solver.system import System

    Vectors = tuple[NDArray[np.float64], ...]

_BLENDS = (0.0, 0.02, 0.1, 0.3, 1.0)
_PATIENCE = 15
"""Iterations without a smaller residual before an increment is given up."""
_DIVERGED = 1e4
_UNBALANCED = 100.0
_TOUCHING = 1e-9  # overlap before anything is loaded [mm]
_LATE = 1
"""Iterations after which a step without stiffness tells that the structure flows."""


@dataclass(frozen=True, slots=True)
class _Step:
    """A Newton step: displacements of each part, contact forces and statuses."""

    u: Vectors
    forces: NDArray[np.float64]
    status: NDArray[np.int64]


class Increment:
    """One increment of ``system`` from the state ``start`` to the load factor ``load``.

    Parameters
    ----------
    guess : state to iterate from, usually extrapolated; ``start`` when absent
    contact : False takes the bodies apart
    elastic_only : raise `Yielded` as soon as a point yields
    """

    def __init__(
        self,
        system: System,
        start: State,
        load: float,
        *,
        guess: State | None = None,
        contact: bool = True,
        elastic_first: bool = True,
        elastic_only: bool = False,
        tolerances: Tolerances | None = None,
    ) -> None:
        self.system = system
        self.start = start
        self.load = load
        self.guess = guess
        self.contact = contact
        self.elastic_first = elastic_first
        self.elastic_only = elastic_only
        self.tolerances = tolerances or Tolerances()
        self._pivoted = 0
        self._blended = 0

    def solve(self) -> Converged:
        """Return the converged increment or raise `IncrementFailed` (or `Yielded`)."""
        with one_thread():
            return self._iterate()

    def _iterate(self) -> Converged:
        tolerances = self.tolerances
        origin = self.guess or self.start
        u, contacts = origin.u, origin.contacts
        responses = self._respond(u)
        best, since_best, softest = np.inf, 0, 1.0
        for iteration in range(tolerances.iterations + 1):
            candidates = self._candidates(u, contacts)
            residuals = self._residuals(u, responses)
            scale, error, violation = self._errors(residuals, candidates)
            since_best = 0 if error < best else since_best + 1
            best = min(best, error)
            hopeless = since_best > _PATIENCE or error > _DIVERGED * best
            if hopeless or not (np.isfinite(error) and np.isfinite(violation)):
                break
            balanced = error < tolerances.residual and violation < tolerances.contact
            if balanced and candidates.beyond >= 0:
                return self._commit(u, responses, candidates, scale, iteration)
            elastic_first = iteration == 0 and self.elastic_first
            step = self._step(residuals, responses, candidates, elastic_first)
            if iteration >= _LATE:
                softest = min(softest, self._stiffness(step, responses))
            share, u, responses = self._search(u, residuals, candidates, step)
            forces = (1 - share) * candidates.forces + share * step.forces
            contacts = candidates.states(contacts, forces, step.status)
            if self.elastic_only and any(r.yielding.any() for r in responses):
                raise Yielded
        raise IncrementFailed(
            f"{iteration} iterations left a relative out-of-balance force of {error:.1e} "
            f"and a contact violation of {violation:.1e}",
            # what stops at rounding does not flow
            softest if best > _UNBALANCED * tolerances.residual else 1.0,
        )

    # -- 1, 2: where we are ------------------------------------------------------------------

    def _respond(self, u: Vectors) -> tuple[Response, ...]:
        return tuple(
            part.respond(ui, plastic)
            for part, ui, plastic in zip(self.system.parts, u, self.start.plastic, strict=True)
        )

    def _residuals(self, u: Vectors, responses: Sequence[Response]) -> Vectors:
        """Return external minus internal forces of each part, contact forces left out."""
        return tuple(
            part.residual(self.load, ui, response)
            for part, ui, response in zip(self.system.parts, u, responses, strict=True)
        )

    def _candidates(self, u: Vectors, contacts: tuple[ContactState, ...]) -> Candidates:
        if not self.contact:
            return no_candidates(self.system)
        span = self.load - self.start.load
        return find_candidates(self.system, self.start, u, contacts, span)

    def _on_parts(self, candidates: Candidates, forces: NDArray[np.float64]) -> Vectors:
        return tuple(
            candidates.on_part(i, forces, part.n) for i, part in enumerate(self.system.parts)
        )

    def _errors(self, residuals: Vectors, candidates: Candidates) -> tuple[float, float, float]:
        """Return the force level [N], the relative residual and relative contact violation."""
        parts = self.system.parts
        inner = self._on_parts(candidates, candidates.forces)
        level = _norm([part.external(self.load) for part in parts]) + _norm(inner)
        scale = max(self.start.force_scale, level)
        if scale == 0:  # nothing loads the bodies yet; overlapping ones are not in balance
            overlap = min(candidates.motion[: candidates.n].min(initial=0.0), candidates.beyond)
            return 0.0, float(overlap < -_TOUCHING), 0.0
        out = [(r + c)[p.free] for p, r, c in zip(parts, residuals, inner, strict=True)]
        W = candidates.compliance([o.elastic for o in self.system.operators])
        return scale, _norm(out) / scale, candidates.violation(1 / np.diag(W)) / scale

    # -- 3, 4: the step ------------------------------------------------------------------------

    def _step(
        self,
        residuals: Vectors,
        responses: Sequence[Response],
        candidates: Candidates,
        elastic: bool,
    ) -> _Step:
        for blend in (1.0,) if elastic else _BLENDS:
            try:
                operators = [
                    o.tangent(response, blend)
                    for o, response in zip(self.system.operators, responses, strict=True)
                ]
                step = self._blended_step(residuals, operators, candidates)
            except Singular:
                continue
            if step is not None:
                self._blended += 0 < blend and not elastic
                return step
        raise IncrementFailed("no contact forces were found that balance this load", 1.0)

    def _blended_step(
        self, residuals: Vectors, operators: Sequence[Operator], candidates: Candidates
    ) -> _Step | None:
        parts = self.system.parts
        # all large forces balance first: what is left to solve for is small, and rounding of
        # the factor, about 1e-16 (size of the body / smallest element)^2, acts on that alone
        held = self._on_parts(candidates, candidates.forces)
        balanced = [r + c for r, c in zip(residuals, held, strict=True)]
        W = candidates.compliance(operators)
        motion = candidates.motion - W @ candidates.forces
        for i, (operator, r) in enumerate(zip(operators, balanced, strict=True)):
            motion += candidates.of_part(i, operator.solve(r))
        floating = [part.rigid if self.contact else part.rigid[:, :0] for part in parts]
        solution = solve_contact(
            ContactProblem(
                W=W,
                offset=motion,
                friction=candidates.friction,
                A=np.hstack([candidates.of_part(i, R) for i, R in enumerate(floating)]),
                balance=np.concatenate([R.T @ r for R, r in zip(floating, residuals, strict=True)]),
            ),
            candidates.status,
        )
        if solution is None:
            return None
        self._pivoted += solution.pivoted
        change = self._on_parts(candidates, solution.forces - candidates.forces)
        rigid = np.split(solution.rigid, np.cumsum([R.shape[1] for R in floating])[:-1])
        u = tuple(
            operator.solve(r + c) + R @ q
            for operator, r, c, R, q in zip(
                operators, balanced, change, floating, rigid, strict=True
            )
        )
        if not all(np.isfinite(du).all() for du in u):
            return None
        return _Step(u, solution.forces, solution.status)

    # -- 5: line search ------------------------------------------------------------------------

    def _search(
        self, u: Vectors, residuals: Vectors, candidates: Candidates, step: _Step
    ) -> tuple[float, Vectors, tuple[Response, ...]]:
        trial: tuple[Vectors, tuple[Response, ...]]

        def along(share: float, residual: Vectors) -> float:
            forces = (1 - share) * candidates.forces + share * step.forces
            inner = self._on_parts(candidates, forces)
            terms = zip(step.u, residual, inner, strict=True)
            return sum(float(du @ (r + c)) for du, r, c in terms)

        def slope(share: float) -> float:
            nonlocal trial
            moved = tuple(ui + share * du for ui, du in zip(u, step.u, strict=True))
            trial = moved, self._respond(moved)
            return along(share, self._residuals(*trial))

        share = search(slope, along(0.0, residuals))
        return share, *trial

    # -- 6: the end ----------------------------------------------------------------------------

    def _commit(
        self,
        u: Vectors,
        responses: tuple[Response, ...],
        candidates: Candidates,
        scale: float,
        iterations: int,
    ) -> Converged:
        contacts = candidates.kept(self.start.contacts, self.load - self.start.load)
        spent = [
            part.plastic_work(before, response)
            for part, before, response in zip(
                self.system.parts, self.start.plastic, responses, strict=True
            )
        ]
        return Converged(
            plastic_work=sum(work for work, _ in spent),
            dissipation=float(np.min([0.0, *(least for _, least in spent)])),
            state=State(self.load, u, tuple(r.state for r in responses), contacts, scale),
            responses=responses,
            iterations=iterations,
            elastic=not any(r.yielding.any() for r in responses),
            pivoted=self._pivoted,
            blended=self._blended,
        )

    def _stiffness(self, step: _Step, responses: Sequence[Response]) -> float:
        """Return the tangent stiffness along a step over the elastic one."""
        forms = [
            part.stiffness_along(du, response)
            for part, du, response in zip(self.system.parts, step.u, responses, strict=True)
        ]
        tangent, elastic = (sum(form[k] for form in forms) for k in (0, 1))
        return tangent / elastic if elastic > 0 else 1.0


def _norm(vectors: Sequence[NDArray[np.float64]]) -> float:
    return float(np.sqrt(sum(float(v @ v) for v in vectors)))
