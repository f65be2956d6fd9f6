"""Goes from one converged state to a target in increments, halving those that fail."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.contact.state import Converged, Energy, State
from solver.errors import LimitLoad, ModelError, NotConverged
from solver.fem.fields import elastic_energy
from solver.loading.energy import worked
from solver.loading.increment import Increment
from solver.loading.outcome import IncrementFailed, Tolerances

if TYPE_CHECKING:
    from collections.abc import Callable

    from solver.contact.state import ContactState
    from solver.contact.system import System

    Report = Callable[[], None]
    Predict = Callable[[State | None, State, float], State | None]

ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class PathControl:
    """How a path is cut into increments.

    Attributes
    ----------
    load_step : spacing of the trunk, in load factor
    unload_steps : equal increments from full load to none; the last takes the bodies apart
    max_cuts : times an increment may be halved before the path ends
    tolerances : of an increment
    """

    load_step: float = 0.05
    unload_steps: int = 5
    max_cuts: int = 4
    tolerances: Tolerances = field(default_factory=Tolerances)

    def __post_init__(self) -> None:
        if not self.load_step > 0:
            raise ModelError("load_step", self.load_step, "must be positive")
        if self.unload_steps < 1:
            raise ModelError("unload_steps", self.unload_steps, "must be at least 1")


@dataclass(frozen=True, slots=True)
class Tally:
    """What a path has cost and done.

    Newton iterations of each increment, cuts, iterations that needed the inner fallback or a
    blended tangent, CPU seconds, plastic work [N mm], least plastic dissipation at a point of an
    increment [N mm/mm3].
    """

    iterations: tuple[int, ...] = ()
    cuts: int = 0
    pivoted: int = 0
    blended: int = 0
    seconds: float = 0.0
    plastic_work: float = 0.0
    dissipation: float = 0.0

    def plus(self, converged: Converged) -> Tally:
        """Return the tally with one more increment."""
        return replace(
            self,
            iterations=(*self.iterations, converged.iterations),
            pivoted=self.pivoted + converged.pivoted,
            blended=self.blended + converged.blended,
            plastic_work=self.plastic_work + converged.plastic_work,
            dissipation=float(np.minimum(self.dissipation, converged.dissipation)),
        )


@dataclass(frozen=True, slots=True)
class Point:
    """A state on the path, the one before it for extrapolation, and the cost so far."""

    now: Converged
    before: State | None
    tally: Tally


class Stopped(Exception):
    """A path has ended: why, and its last point."""

    def __init__(self, error: NotConverged, point: Point) -> None:
        super().__init__(str(error))
        self.error = error
        self.point = point


class Stepper:
    """Advances a system.

    Parameters
    ----------
    predict : gives the state an increment iterates from, or None for the last converged one
    elastic_first : whether increments with a prediction still begin with the elastic operator
    place : says in words where on the path a load factor (or time) is
    """

    def __init__(
        self,
        system: System,
        control: PathControl,
        report: Report | None = None,
        predict: Predict | None = None,
        *,
        elastic_first: bool = False,
        place: Callable[[float], str] = "load factor {:.6g}".format,
    ) -> None:
        self.system = system
        self.control = control
        self._predict = predict or extrapolate
        self._elastic_first = elastic_first
        self._place = place
        self.report = report or (lambda: None)
        self._clock = time.process_time()

    def rest(self, state: State) -> Point:
        """Return the first point of a path: a state without contact forces at load zero."""
        at_rest = Increment(self.system, state, state.load, contact=False).solve()
        stresses = zip(self.system.parts, at_rest.responses, strict=True)
        energy = Energy(stored=sum(elastic_energy(part, r.stress) for part, r in stresses))
        return Point(replace(at_rest, state=state, energy=energy), None, Tally())

    def together(self, state: State) -> Point:
        """Return the first point of a path, overlapping bodies having pushed each other apart.

        They do so before any load acts, so that what they resist is not taken for a limit load.
        """
        point = self.rest(state)
        if not self.system.overlapping:
            return point
        try:
            pushed = Increment(
                self.system, state, state.load, tolerances=self.control.tolerances
            ).solve()
        except IncrementFailed as failure:
            error = NotConverged(f"the overlap of the bodies could not be resolved: {failure}")
            raise Stopped(error, replace(point, tally=self.timed(point.tally))) from failure
        pushed = self.worked(point.now, pushed)
        return Point(pushed, None, self.timed(point.tally.plus(pushed)))

    def advance(self, point: Point, target: float, *, contact: bool = True) -> Point:
        """Return the point at load ``target`` or raise `Stopped`."""
        step = target - point.now.state.load
        least = abs(step) / 2**self.control.max_cuts
        while point.now.state.load != target:
            state = point.now.state
            close = abs(target - state.load) <= abs(step) * (1 + ROUNDING)
            load = target if close else state.load + step
            together = contact or load != target
            guess = self._predict(point.before, state, load) if together else None
            try:
                converged = Increment(
                    self.system,
                    state,
                    load,
                    guess=guess,
                    contact=together,
                    elastic_first=guess is None or self._elastic_first,
                    patient=abs(load - state.load) < 2 * least * (1 - ROUNDING),
                    tolerances=self.control.tolerances,
                ).solve()
            except IncrementFailed as failure:
                tally = replace(point.tally, cuts=point.tally.cuts + 1)
                point = replace(point, tally=self.timed(tally), before=None)
                step = (load - state.load) / 2
                if abs(step) < least * (1 - ROUNDING):
                    raise Stopped(self._ended(failure, state.load, load), point) from failure
                continue
            converged = self.worked(point.now, converged)
            point = Point(converged, state, self.timed(point.tally.plus(converged)))
            if converged.strayed:
                error = NotConverged(f"{self._place(load)}: {converged.strayed}", state.load, load)
                raise Stopped(error, point)
            self.report()
        return point

    def worked(self, before: Converged, now: Converged) -> Converged:
        """Return an increment with the work along its path up to there."""
        return replace(now, energy=worked(self.system.parts, before, now))

    def _ended(self, failure: IncrementFailed, reached: float, attempted: float) -> NotConverged:
        way = f"between {self._place(reached)} and {self._place(attempted)}"
        growing = any(part.grows(reached, attempted) for part in self.system.parts)
        if failure.flow.limit and growing:
            return LimitLoad(f"no equilibrium {way}: {failure.flow}", reached, attempted)
        return NotConverged(f"the increment {way} failed: {failure}", reached, attempted)

    def timed(self, tally: Tally) -> Tally:
        """Return the tally with the CPU time spent since the last call."""
        now = time.process_time()
        spent, self._clock = now - self._clock, now
        return replace(tally, seconds=tally.seconds + spent)


def extrapolate(before: State | None, now: State, load: float) -> State | None:
    """Return the state at ``load`` on the line through two states, or None at a reversal."""
    if before is None or now.load == before.load:
        return None
    share = (load - now.load) / (now.load - before.load)
    if share <= 0:
        return None

    def contact(b: ContactState, n: ContactState) -> ContactState:
        return replace(
            n,
            normal=np.maximum(n.normal + share * (n.normal - b.normal), 0.0),
            tangential=n.tangential + share * (n.tangential - b.tangential),
        )

    return replace(
        now,
        u=tuple(n + share * (n - b) for b, n in zip(before.u, now.u, strict=True)),
        contacts=tuple(contact(b, n) for b, n in zip(before.contacts, now.contacts, strict=True)),
    )
