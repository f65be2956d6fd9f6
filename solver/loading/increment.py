"""One load increment: plasticity outside, contact inside.

From the last converged state, at the current displacements:

1. constitutive update: internal force and consistent tangent K of every part; K is symmetric,
   friction is not part of it
2. contact geometry: gap, slip and their derivative rows H at the candidate vertices
3. compliance of the contact points ``W = H K^-1 H'``
4. the frictional contact problem on W, exactly; the free rigid motions of parts held by contact
   alone are extra unknowns with exact balance equations, as in FETI. If the problem has no
   solution, or steps are far too long, the tangent is blended with the elastic stiffness
5. the whole step if it reduces the out-of-balance forces enough; else a line search on the plastic
   residual, with interpolated contact forces
6. convergence if the residual with contact forces, and the violation of the contact conditions, are
   within the tolerances

Without a prediction the first iteration uses the elastic operator: after a reversal of load
Newton's method would diverge with the plastic tangent of the previous step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from solver.contact.candidates import Candidates, find_candidates, no_candidates
from solver.contact.drift import beyond_end
from solver.contact.state import ContactState, Converged, State, Timing
from solver.contact.system import System
from solver.fem.deformation import PartResponse
from solver.fem.operators import Operator
from solver.fem.window import Windowed
from solver.linear.solvers import Singular, one_thread
from solver.loading.energy import plastic_work
from solver.loading.limit import is_singular, mechanism, slide
from solver.loading.outcome import IncrementFailed, Mechanism, Yielded
from solver.loading.program import Tolerances
from solver.loading.step import (
    NewtonStep,
    Series,
    newton_step,
    norm,
    on_parts,
    out_of_balance,
    rounding,
    search,
    unheld,
)
from solver.loading.timing import timing
from solver.typing import Array

Vectors = tuple[Array, ...]


_BLENDS = (0.0, 1e-3, 0.02, 0.1, 0.3, 1.0)
"""Shares of the elastic stiffness in the tangent, tried in this order."""
_LEAST, _SLOWLY = 1e-5, 0.5
"""The share with a tangent that has no stiffness along a step, once two steps have left more of the
out-of-balance forces than `_SLOWLY`, and until they grow: a larger share slows convergence, and
with a smaller one rounding determines the step."""
_SHORT = 0.1
"""Share of a step that the line search takes: a step is short below it. Each short step after the
first one moves to the next blend, but not to the last one, the elastic stiffness."""
_PATIENCE = 15
"""Number of iterations without a smaller residual: an increment fails after more."""
_DIVERGED = 1e4
_LESS = 0.8
"""Out-of-balance forces after a whole step over those before: a step with a smaller ratio needs no
line search. Close to a limit load the energy rises along many steps that approach the solution."""
_SHORTEST = 1e-3
"""Least share of a step to which it is shortened until its forces are finite."""
_CORRECTIONS, _BALANCED, _CORRECTED, _SLOW, _NEGLIGIBLE = 12, 1e-6, 1e-6, 0.1, (1e-13, 1e-12)
"""Most steps of `Increment.linearised`; out-of-balance forces after the last one over those before
the first; size of the last one over that of the first; the forces after a step over those before,
above which other tangents follow; negligible forces and steps, over the level of forces and the
displacements: rounding of positions makes steps larger than forces."""
_STIFF = 0.01
"""Compliance of a condition of links that turn, over the largest one: one below it turns with it,
almost along a support, and so is no measure of its violation."""
_UNBALANCED = 100.0
_ROUNDED = 10.0
"""Force level of bodies without load, over the level at which rounding errors alone would exceed
the tolerance."""


def _small(sizes: Sequence[float], ratio: float, least: float) -> bool:
    """Whether the last of the sizes of corrections is negligible."""
    return sizes[-1] <= max(ratio * sizes[0], least)


def _finite(forces: Vectors) -> bool:
    return all(bool(np.isfinite(each).all()) for each in forces)


@dataclass(frozen=True, slots=True, kw_only=True)
class Balanced:
    """The last iterate of an increment, in equilibrium.

    ``scale`` is the force level [N]; see `Converged` for ``iterations``, ``pivoted``, ``blended``.
    """

    u: Vectors
    contacts: tuple[ContactState, ...]
    links: Array
    responses: tuple[PartResponse, ...]
    residuals: Vectors
    candidates: Candidates
    scale: float
    iterations: int
    pivoted: int
    blended: int


class Increment:
    """One increment of ``system`` from the state ``start`` to ``time``.

    Parameters
    ----------
    guess : first iterate, by default ``start``; its prescribed motions are those at ``time``
    contact : false separates the bodies
    friction : false leaves friction out
    elastic_first : use the elastic operator in the first iteration
    elastic_only : raise `Yielded` as soon as a point yields
    patient : use all iterations if every body hardens, so that an equilibrium exists: with little
        hardening the residual rises and falls while the energy falls
    compliance : elastic compliances of contact points known so far, by their vertices [mm/N]
    """

    def __init__(
        self,
        system: System,
        start: State,
        time: float,
        *,
        guess: State | None = None,
        contact: bool = True,
        friction: bool = True,
        elastic_first: bool = True,
        elastic_only: bool = False,
        patient: bool = False,
        tolerances: Tolerances | None = None,
        compliance: dict[tuple[bytes, ...], Array] | None = None,
    ) -> None:
        self.system = system = system.during(start)
        self.start = start
        self.time = time
        self.guess = guess
        self.contact = contact
        self.friction = friction
        self.elastic_first = elastic_first
        self.elastic_only = elastic_only
        materials = [part.body.material for part in system.parts]
        self.patient = patient and all(m.elastic or m.hardens for m in materials)
        self.tolerances = tolerances or Tolerances()
        self._began: tuple[Vectors, Candidates] | None = None  # residuals, candidates
        self._pivoted, self._blended = 0, 0
        # corners of a yield surface have no tangent
        self._softened = any(part.body.law.surface.has_corners for part in system.parts)
        self._path: list[Vectors] = []  # displacements of all iterates so far
        self.compliance = {} if compliance is None else compliance

    def solve(self) -> Converged:
        """Return the converged increment or raise `IncrementFailed` (or `Yielded`)."""
        with one_thread():
            return self._commit(self._iterate())

    def closed(self, found: Balanced) -> Converged | None:
        """Return the increment that ends in an iterate; None if it is outside the tolerances."""
        with one_thread():
            scale, error, violation = self._errors(found.residuals, found.candidates)
            if not self._ends(found.u, found.candidates, scale, error, violation):
                return None
            return self._commit(replace(found, scale=scale))

    def approach(self) -> Balanced:
        """Return the last iterate of the increment, or raise `IncrementFailed`."""
        with one_thread():
            return self._iterate()

    def linearised(
        self, end: Converged, operators: Sequence[Operator]
    ) -> tuple[Converged, Candidates]:
        """Return the increment after Newton steps from an almost equal one, and its contact.

        The first step begins where the difference between the starts of the two leads. It suffices
        where no point begins or ceases to flow on the way, and the tangent is exact: it has no
        terms for surfaces of small strain that slide far, none for the unsymmetric part of a law,
        and none at the corners of a yield surface. Else steps follow until forces balance, and if
        surfaces slide far or links turn until the steps are negligible; if they become so slowly,
        with the tangents of this increment.

        Parameters
        ----------
        end : the other increment
        operators : the inverse tangent of each part at its end

        Raises
        ------
        IncrementFailed
            if no contact forces balance the load, or the steps do not end
        """
        with one_thread():
            contacts, links = end.state.contacts, end.state.links
            each = zip(end.state.u, self.start.u, end.start.u, strict=True)
            ahead = replace(end.state, u=tuple(ui + own - its for ui, own, its in each))
            u = self.system.moved(ahead, self.time).u
            turns = self.system.links.turn or any(c.finite for c in self.start.contacts)
            self.system = self.system.turned(u)
            responses, candidates = self._respond(u), self._candidates(u, contacts, links)
            residuals, steps, outs = self._residuals(u, responses), list[float](), list[float]()
            for _ in range(_CORRECTIONS):
                outs.append(self._unbalanced(residuals, candidates, candidates.forces))
                least = max(_NEGLIGIBLE[0] * end.state.force_scale, rounding(self.system, u))
                balanced = _small(outs, _BALANCED, least)
                if steps and balanced:
                    if not turns or _small(steps, _CORRECTED, _NEGLIGIBLE[1] * norm(u)):
                        break
                elif len(outs) > 2 and outs[-1] > _SLOW * outs[-2]:
                    both = zip(self.system.operators, responses, strict=True)
                    operators = [own.tangent(response, 0.0) for own, response in both]
                step = newton_step(self.system, residuals, operators, candidates, self.time)
                if step is None:
                    raise IncrementFailed("no contact forces were found that balance this load")
                u = tuple(ui + du for ui, du in zip(u, step.u, strict=True))
                self.system = self.system.turned(u)
                contacts = candidates.states(contacts, step.forces, step.status)
                links, responses = step.forces[candidates.linked], self._respond(u)
                residuals = self._residuals(u, responses)
                candidates = self._candidates(u, contacts, links)
                steps.append(norm(step.u))
            else:
                raise IncrementFailed(f"{_CORRECTIONS} steps did not lead to the increment")
            found = Balanced(
                u=u,
                contacts=contacts,
                links=links,
                responses=responses,
                residuals=residuals,
                candidates=candidates,
                scale=end.state.force_scale,
                iterations=1,
                pivoted=0,
                blended=0,
            )
            return self._commit(found, end.timing), candidates

    def _iterate(self) -> Balanced:
        tolerances = self.tolerances
        origin = self.system.moved(self._guessed(), self.time)
        u, contacts, links = origin.u, origin.contacts, origin.links
        responses = self._respond(u)
        residuals = self._residuals(u, responses)
        best, since_best = np.inf, 0
        series, begun, crawled, slow, last = Series(), 0.0, 0, 0, np.inf
        for iteration in range(tolerances.iterations + 1):
            self.system = self.system.turned(u)
            candidates = self._candidates(u, contacts, links)
            self._began = self._began or (residuals, candidates)
            scale, error, violation = self._errors(residuals, candidates)
            since_best = 0 if error < best else since_best + 1
            # overlapping or moved bodies can begin with a residual of zero: compare later residuals
            # with the first violation of contact instead
            best = max(min(best, error), tolerances.residual)
            begun = begun if iteration else violation
            hopeless = since_best > _PATIENCE and not self.patient
            hopeless |= error > _DIVERGED * max(best, begun)
            if hopeless or not (np.isfinite(error) and np.isfinite(violation)):
                break
            if self._ends(u, candidates, scale, error, violation):
                return Balanced(
                    u=u,
                    contacts=contacts,
                    links=links,
                    responses=responses,
                    residuals=residuals,
                    candidates=candidates,
                    scale=scale,
                    iterations=iteration,
                    pivoted=self._pivoted,
                    blended=self._blended,
                )
            elastic_first = iteration == 0 and self.elastic_first
            first = max(crawled - 1, int(self._softened))
            first = len(_BLENDS) - 1 if elastic_first else min(first, len(_BLENDS) - 2)
            slow, last = (slow + (error > _SLOWLY * last) if error < last else 0), error
            least = (_LEAST,) * (self._softened and first == 1 and slow > 1)
            self._path.append(u)
            try:
                step = self._step(residuals, responses, candidates, least + _BLENDS[first:])
            except IncrementFailed as failure:
                slides = self._slide((residuals, candidates))
                failure.why = slides or self._flow(responses, residuals, candidates, scale)
                raise
            out = max(error, tolerances.residual / _LESS) * scale
            share, u, responses, residuals = self._search(u, residuals, candidates, step, out)
            crawled = crawled + 1 if share < _SHORT else 0
            forces = (1 - share) * candidates.forces + share * step.forces
            ahead = series.sum(self._path[-1], candidates, step, share)
            if ahead is not None:
                farther = self._respond(ahead[0])
                beyond = self._residuals(ahead[0], farther)
                if _finite(beyond):
                    best = np.inf if least else best  # it may be far, and leads back from there
                    (u, forces), responses, residuals = ahead, farther, beyond
            contacts = candidates.states(contacts, forces, step.status)
            links = forces[candidates.linked]
            if self.elastic_only and any(r.law.yielding.any() for r in responses):
                raise Yielded
        self._path.append(u)
        raise IncrementFailed(
            f"{iteration} iterations left a relative out-of-balance force of {error:.1e} "
            f"and a contact violation of {violation:.1e}",
            self._slide() or self._flow(responses, residuals, candidates, scale),
        )

    def _guessed(self) -> State:
        """Return the first iterate, in which parts that nothing holds keep their positions."""
        if self.guess is None:
            return self.start
        system, u = self.system, list(self.guess.u)
        stays = system.links.loose(system.holds(self.start.time, self.time))
        for k, part in enumerate(system.parts):
            if stays[k] and part.rigid.shape[1]:
                u[k] = self.start.u[k]
        return replace(self.guess, u=tuple(u))

    def _slide(self, *places: tuple[Vectors, Candidates]) -> Mechanism | None:
        """Return the slide of a body in one of the iterates ``places``, or in the first one.

        The first iterate is examined because a later one may have lost the contacts of the body. A
        body of large strain may have turned in a later one.
        """
        places = () if self.system.model.large else places
        places = (*places, self._began) if self._began else places
        found = (slide(self.system, residuals, candidates) for residuals, candidates in places)
        return next((each for each in found if each is not None), None)

    def _flow(
        self,
        responses: Sequence[PartResponse],
        residuals: Vectors,
        candidates: Candidates,
        level: float,
    ) -> Mechanism:
        """Return the motion that proves a limit load, or the one that comes closest to a proof.

        Motions lead from each iterate to the last one and to the next one. Iterates of a flowing
        body scatter about its mechanism; in a long motion the scatter is relatively small. In
        windows of bodies nothing is proven: the rest of a body could flow too. Nor is it for large
        strain: the power of a mechanism changes with the shape of the bodies.
        """
        system, best, path = self.system, Mechanism(), self._path
        if system.model.large or any(isinstance(part, Windowed) for part in system.parts):
            return best
        for start, end in (*((at, path[-1]) for at in path[:-1]), *pairwise(path)):
            moved = tuple(after - before for before, after in zip(start, end, strict=True))
            found = mechanism(system, self.time, moved, responses, residuals, candidates, level)
            best = max(best, found)
            if best.limit:
                break
        return best

    # -- 1, 2: stress, residual, contact geometry ----------------------------------------------

    def _respond(self, u: Vectors) -> tuple[PartResponse, ...]:
        each = zip(self.system.parts, u, self.start.plastic, strict=True)
        return tuple(part.respond(ui, plastic, self.time) for part, ui, plastic in each)

    def _residuals(self, u: Vectors, responses: Sequence[PartResponse]) -> Vectors:
        """Return external minus internal forces of each part, without contact forces [N]."""
        each = zip(self.system.parts, u, responses, strict=True)
        return tuple(part.residual(self.time, ui, response) for part, ui, response in each)

    def _candidates(
        self, u: Vectors, contacts: tuple[ContactState, ...], links: Array
    ) -> Candidates:
        if not self.contact:
            return no_candidates(self.system, u, links)
        span = self.time - self.start.time
        found = find_candidates(self.system, self.start, u, contacts, links, span)
        return found if self.friction else found.smooth()

    def _errors(self, residuals: Vectors, candidates: Candidates) -> tuple[float, float, float]:
        """Return the force level [N], the relative residual and relative contact violation."""
        parts = self.system.parts
        inner = on_parts(self.system, candidates, candidates.forces)
        external = float(np.hypot.reduce([part.force_level(self.time) for part in parts]))
        level = external + norm(inner)
        if external == 0:  # overlap alone causes forces: the internal forces are the level
            level += norm(residuals)
        if external == 0 and self.start.force_scale == 0:  # bodies without contact and force
            level += _ROUNDED * rounding(self.system, self.start.u) / self.tolerances.residual
        scale = max(self.start.force_scale, level, self.system.least(self.time)[0])
        if scale == 0:
            overlap = min(candidates.motion[: candidates.n].min(initial=0.0), candidates.beyond)
            off = overlap < -self.system.gap_tolerance or candidates.motion[candidates.linked].any()
            return 0.0, float(off), 0.0
        error = self._unbalanced(residuals, candidates, candidates.forces) / scale
        stiffness = 1 / np.diag(self._compliance(candidates))
        return scale, error, candidates.violation(stiffness) / scale

    def _unbalanced(self, residuals: Vectors, candidates: Candidates, forces: Array) -> float:
        """Return the norm of the out-of-balance forces of all parts under contact forces [N]."""
        each = zip(
            self.system.parts,
            out_of_balance(self.system, residuals, candidates, forces),
            strict=True,
        )
        return norm([r[part.free] for part, r in each])

    def _ends(
        self, u: Vectors, candidates: Candidates, scale: float, error: float, violation: float
    ) -> bool:
        """Whether an iterate is within the tolerances, or within rounding if slightly outside."""
        limit = self.tolerances.residual
        # a flowing body moves far: rounding of its displacements may exceed the tolerance
        balanced = error < limit
        little = 0 < error < _UNBALANCED * limit
        balanced |= little and error * scale <= rounding(self.system, u)
        limit = self.tolerances.contact
        met = violation < limit
        if not met and balanced and violation < _UNBALANCED * limit:
            stiffest = 1 / np.diag(self._compliance(candidates)).min()
            met = violation * scale <= stiffest * self.system.blur
        return balanced and met and candidates.beyond >= 0

    def _compliance(self, candidates: Candidates) -> Array:
        """Return the elastic compliance of the contact points [mm/N], computed once."""
        key = tuple(vertices.tobytes() for vertices in candidates.vertices)
        if key not in self.compliance:
            W = candidates.compliance([o.elastic for o in self.system.operators])
            last = np.arange(len(W))[candidates.linked]
            own = W[last, last] + candidates.links.compliance
            least = _STIFF * np.diag(W).max(initial=0.0) if self.system.links.turn else 0.0
            W[last, last] = np.where(own > least, own, np.diag(W).max(initial=1.0))
            self.compliance[key] = W
        return self.compliance[key]

    # -- 3, 4: the step ------------------------------------------------------------------------

    def _step(
        self,
        residuals: Vectors,
        responses: Sequence[PartResponse],
        candidates: Candidates,
        blends: Sequence[float],
    ) -> NewtonStep:
        """Return the step with the first of the ``blends`` that has a solution.

        Raises `IncrementFailed` if no blend has one.
        """
        for blend in blends:
            try:
                operators = [
                    o.tangent(response, blend)
                    for o, response in zip(self.system.operators, responses, strict=True)
                ]
                step = newton_step(self.system, residuals, operators, candidates, self.time)
            except Singular:
                continue
            if step and not blend and is_singular(self.system.parts, self.time, step.u, responses):
                self._softened = True
            elif step is not None:
                self._pivoted += step.pivoted
                self._blended += 0 < blend and len(blends) > 1
                return step
        raise IncrementFailed(
            "no contact forces were found that balance this load" + unheld(self.system, candidates)
        )

    # -- 5: line search ------------------------------------------------------------------------

    def _search(
        self, u: Vectors, residuals: Vectors, candidates: Candidates, step: NewtonStep, out: float
    ) -> tuple[float, Vectors, tuple[PartResponse, ...], Vectors]:
        """Return a share of the step, and displacements, responses and residuals after it.

        ``out`` is the norm of the out-of-balance forces before the step, at least the tolerance
        over `_LESS` [N]: a step that ends within the tolerance needs no line search.
        """
        trial: tuple[Vectors, tuple[PartResponse, ...], Vectors]

        def residuals_at(share: float) -> Vectors:
            nonlocal trial
            moved = tuple(ui + share * du for ui, du in zip(u, step.u, strict=True))
            responses = self._respond(moved)
            trial = moved, responses, self._residuals(moved, responses)
            return trial[-1]

        most, whole = 1.0, residuals_at(1.0)
        while not _finite(whole) and most > _SHORTEST:  # a part is inverted
            most /= 4
            whole = residuals_at(most)
        if most == 1 and self._unbalanced(whole, candidates, step.forces) < _LESS * out:
            return 1.0, *trial
        # if vertices change status, the slope with the contact forces before the step may be
        # negative; with those after it the slope is the quadratic form of the tangent, positive
        before = candidates.forces
        if step.slope(self.system, residuals, candidates, before) <= 0:
            before = step.forces

        def along(share: float, residual: Vectors) -> float:
            forces = (1 - share) * before + share * step.forces
            return step.slope(self.system, residual, candidates, forces)

        start, end = along(0.0, residuals), along(most, whole)
        share = search(lambda s: along(most * s, residuals_at(most * s)), start, end)
        return most * share, *trial

    # -- 6: the converged state ----------------------------------------------------------------

    def _commit(self, found: Balanced, timing: Timing | None = None) -> Converged:
        u, responses, candidates = found.u, found.responses, found.candidates
        span = self.time - self.start.time
        contacts = candidates.kept(self.start.contacts, span, grows=not self.system.moves)
        spent = [
            plastic_work(part, before, response.law, self.time)
            for part, before, response in zip(
                self.system.parts, self.start.plastic, responses, strict=True
            )
        ]
        inner = on_parts(self.system, candidates, candidates.forces)
        plastic = tuple(response.law.state for response in responses)
        held = zip(self.system.parts, u, found.residuals, inner, strict=True)
        return Converged(
            start=self.start,
            forces=tuple(part.external(self.time, ui) - r - c for part, ui, r, c in held),
            contact_forces=inner,
            contact_work=candidates.work(self.start.contacts),
            plastic_work=sum(work for work, _ in spent),
            dissipation=float(np.min([0.0, *(least for _, least in spent)])),
            state=State(self.time, u, plastic, contacts, found.scale, found.links),
            responses=tuple(r.law for r in responses),
            iterations=found.iterations,
            pivoted=found.pivoted,
            blended=found.blended,
            beyond_end=beyond_end(self.system, u, candidates),
            timing=timing or self._timing(candidates),
            separated=not self.contact,
        )

    def _timing(self, candidates: Candidates) -> Timing:
        if not candidates.n or not self.friction:
            return Timing()
        return timing(self.system, self.start, candidates, self._compliance(candidates))
