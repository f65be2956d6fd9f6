"""Advance a converged state to a given time in increments; halve an increment that fails."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from solver.contact.drift import followed
from solver.contact.parting import parted
from solver.contact.state import ContactState, Converged, Energy, State, Timing
from solver.contact.system import System
from solver.errors import LimitLoad, ModelError, NotConverged
from solver.fem.fields import elastic_energy
from solver.fem.rigid import RigidPart
from solver.linear.solvers import one_thread
from solver.loading.energy import worked
from solver.loading.increment import Increment
from solver.loading.integration import doubtful, integrated, lost
from solver.loading.limit import spent
from solver.loading.narrowing import FailedInWindows, narrowed
from solver.loading.outcome import IncrementFailed, Mechanism, PathEnded, Point, Tally, Yielded
from solver.loading.prediction import MEMORY, Predictor
from solver.loading.program import INCREMENT_ERROR, ROUNDING, Control

Attempt = tuple[float, Mechanism | None]
"""Time of an increment that failed, and the reason; None if it failed only in windows."""
Report = Callable[[], None]
Watch = Callable[[Converged], Any]


_NEAR = 8
"""(Excluded load - load reached) over the last increment that failed: the failure is at the limit
load up to this ratio."""
_TURN = 0.1
"""Largest rotation of a rigid body in an increment [rad]."""
_UNTIMED = 0.02
"""Uncertain friction over the largest friction: an increment above this ratio is divided."""
_PASSAGE = 0.5
"""Motion of a contact in an increment over its width: an increment above this ratio is divided."""
_SHORTEST = 2.0**-6
"""Shortest fraction of an increment that is divided for these two reasons, or for its error."""
_FURTHER = 4
"""Number of parts into which such a fraction may still be cut if it fails."""


Way = tuple[float, float]
"""Times between which a program has one increment."""


class Followers(Protocol):
    """Neighbouring runs, which follow a run (`Converged.beside`): see `solver.derivatives`."""

    def between(self, ways: Sequence[Way]) -> None:
        """Set the way on which the next increments are, for the run and each neighbour."""

    def begun(
        self, before: Converged | None, balanced: Converged | None, time: float
    ) -> tuple[Converged, ...]:
        """Return the first increments of a lap after the lap that ended with ``before``.

        ``balanced`` is the increment that brings the initial stress into equilibrium.
        """

    def again(self, beside: Sequence[Converged], time: float) -> tuple[Converged, ...]:
        """Return the neighbours with the time at which the next lap begins."""

    def followed(
        self, before: Converged, now: Converged, *, friction: bool = True
    ) -> tuple[Converged, ...]:
        """Return the increments that follow ``now``, after those beside ``before``."""


class Stepper:
    """Advances a system from one time to another.

    Parameters
    ----------
    report : called after every increment
    watch : (converged increment) -> value kept in `Point.history`
    followers : neighbouring runs

    Attributes
    ----------
    place : (time) -> text for this time in messages
    """

    def __init__(
        self,
        system: System,
        control: Control,
        report: Report | None = None,
        watch: Watch | None = None,
        followers: Followers | None = None,
    ) -> None:
        self.system, self.followers = system, followers
        self.control = control
        self.place: Callable[[float], str] = "load factor {:.6g}".format
        self._report = report or (lambda: None)
        self._watch = watch
        self._predictor = Predictor(system)
        self._clock = clock.process_time()

    def rest(
        self, state: State, tally: Tally | None = None, beside: tuple[Converged, ...] = ()
    ) -> Point:
        """Return a state without contact forces as the first point of a lap."""
        at_rest = Increment(self.system, state, state.time, contact=False).solve()
        each = zip(self.system.parts, state.u, at_rest.responses, strict=True)
        stored = sum(elastic_energy(part, u, found, state.time) for part, u, found in each)
        stored += self.system.links.energy(state.links)
        scale = max(stored, self.system.least(state.time)[1])
        now = replace(
            at_rest, state=state, energy=Energy(stored=stored, scale=scale), beside=beside
        )
        return Point(now, (), tally or Tally(), self._watched((), now), _facing(state))

    def begin(
        self,
        state: State,
        time: float,
        tally: Tally | None = None,
        before: Converged | None = None,
    ) -> Point:
        """Return the first point of a lap: wheels are set down, overlapping bodies pushed apart.

        ``before`` is the last increment of the lap before, if any.

        The initial stress of each body is brought to equilibrium first. No load acts yet, so that a
        failure is not mistaken for a limit load. Raises `PathEnded` if overlapping bodies have no
        equilibrium, and `ModelError` if an initial stress has none.
        """
        balanced = self._balance(state)
        rest = state if balanced is None else self.system.at_rest(balanced.state)
        beside = self.followers.begun(before, balanced, time) if self.followers else ()
        point = self.rest(placed(self.system, rest, time), tally, beside)
        if not self.system.overlaps(point.now.state):
            return point
        try:
            pushed, friction = self._pushed_apart(point.now.state, time)
        except IncrementFailed as failure:
            error = NotConverged(
                "the overlap of the bodies before loading could not be pushed apart: "
                f"{failure}; move the bodies until they just touch"
            )
            raise PathEnded(error, replace(point, tally=self._timed(point.tally))) from failure
        pushed = replace(integrated(self.system, point.now, pushed), added=0.0)
        return self._after(point, self._worked(point.now, pushed), (), friction=friction)

    def _pushed_apart(self, state: State, time: float) -> tuple[Converged, bool]:
        """Return the increment that removes an overlap, and whether it has friction.

        It has no friction, because its slip is not a history of loading, unless the load at the
        beginning has no equilibrium without friction.
        """
        tolerances = self.control.tolerances
        try:
            smooth = Increment(self.system, state, time, friction=False, tolerances=tolerances)
            return smooth.solve(), False
        except IncrementFailed:
            return Increment(self.system, state, time, tolerances=tolerances).solve(), True

    def balanced(self, state: State) -> State:
        """Return the state in which the initial stress of each body is in equilibrium."""
        found = self._balance(state)
        return state if found is None else self.system.at_rest(found.state)

    def _balance(self, state: State) -> Converged | None:
        """Return the increment that brings the initial stress into equilibrium, if there is any."""
        if not self.system.prestressed:
            return None
        try:
            return Increment(self.system, state, state.time, contact=False).solve()
        except IncrementFailed as failure:
            raise ModelError(
                "initial_stress", f"that of {', '.join(self.system.prestressed)}",
                f"must have an equilibrium within the strength of the material: {failure}",
            ) from failure  # fmt: skip

    def again(self, point: Point, time: float) -> Point:
        """Return the first point of a later lap: wheels are set down, other bodies unchanged.

        With wheels, which are apart at rest, the energy counts from there.
        """
        state = point.now.state
        if self.system.rolls:
            begun = self.begin(state, time, point.tally, point.now)
            history, met = (*point.history, *begun.history), point.met | begun.met
            timing = point.now.timing.then(begun.now.timing)
            # the wheels are set down apart: to begin adds no error
            now = replace(begun.now, timing=timing, missed=point.now.missed)
            return replace(begun, now=now, history=history, met=met)
        now = replace(point.now, state=replace(state, time=time), added=0.0)
        if self.followers:
            now = replace(now, beside=self.followers.again(now.beside, time))
        return replace(point, now=now, past=())

    def reach(self, point: Point, target: float, *, contact: bool = True) -> Point:
        """Return the point at time ``target`` or raise `PathEnded`.

        An increment in which a rigid body rotates too far is divided, because friction forces
        rotate with its surface. An increment that fails is halved. One that is too coarse for
        contact or plastic flow is divided too, but accepted if its parts fail; later increments
        grow again.

        If windows of the bodies fail, whole bodies are tried only in the shortest increment and in
        parts of a coarse one: the half of another increment mostly converges in windows.
        """
        size, most = self._step_size(point, target), self.control.increment_error
        known, coarse = point.now.timing, None
        failed: list[Attempt] = []
        while (now := point.now.state.time) != target:
            close = abs(target - now) <= abs(size.step) * (1 + ROUNDING)
            time = target if close else now + size.step
            shortest = size.shortest(time - now)
            try:
                converged = self._increment(
                    point,
                    time,
                    contact=contact or time != target,
                    patient=shortest,
                    whole=shortest or coarse is not None,
                )
            except IncrementFailed as failure:
                in_windows = isinstance(failure, FailedInWindows)
                failed.append((time, None if in_windows else failure.why))
                if coarse is None:
                    tally = replace(point.tally, cuts=point.tally.cuts + 1)
                    point = replace(point, tally=self._timed(tally), past=())
                    if size.failed(time - now):
                        continue
                    end = self._longer(point, failed)
                    if not isinstance(end, Converged):
                        point = replace(point, tally=self._timed(point.tally))
                        raise PathEnded(self._ended(failure, point, *end), point) from failure
                    converged = integrated(self.system, point.now, end)
                else:
                    converged = coarse
                size.resumed(converged.state.time - now)
            else:
                doubt = doubtful(self.system, converged, min(most, INCREMENT_ERROR))
                half = self._half(point, converged) if doubt else None
                converged = integrated(self.system, point.now, converged, half)
                # shares of uncertain friction refer to the larger forces of the coarse increment
                known = converged.timing.beside(known)
                unknown = doubt and half is None
                halvings = max(int(_coarse(known) or unknown), _halvings(converged.added, most))
                if size.divided(time - now, halvings):
                    coarse = converged
                    continue
            size.converged(converged.state.time - now, grows=4 * converged.added <= most)
            remaining = abs(target - converged.state.time)
            failed = [each for each in failed if abs(target - each[0]) < remaining]
            past = (*point.past[1 - MEMORY :], point.now.state)
            point, coarse = self._after(point, self._worked(point.now, converged), past), None
            if converged.beyond_end:
                reached = converged.state.time
                message = f"{self.place(reached)}: {converged.beyond_end}"
                raise PathEnded(NotConverged(message, now, reached), point)
            self._report()
        return point

    def _half(self, point: Point, converged: Converged) -> Converged | None:
        """Return half of an increment, None if it does not converge."""
        middle = (point.now.state.time + converged.state.time) / 2
        try:
            return self._increment(point, middle, contact=True, patient=False, whole=False)
        except IncrementFailed:
            return None

    def _step_size(self, point: Point, target: float) -> _StepSize:
        """Return the step of the increments to a time.

        It is a part of the way if a rigid body rotates far, or if the error of the last increment
        predicts a too large one.
        """
        before, expected = point.now, 0.0
        begin = before.state.time
        rigid = (part for part in self.system.parts if isinstance(part, RigidPart))
        turn = max((part.turn(begin, target) for part in rigid), default=0.0)
        step = (target - begin) / max(1, math.ceil(turn / _TURN - ROUNDING))
        if before.added:
            expected = before.added * (step / (begin - before.start.time)) ** 2
        halvings = _halvings(expected, self.control.increment_error)
        return _StepSize(step, self.control.max_cuts, halvings)

    def _longer(
        self, point: Point, failed: Sequence[Attempt]
    ) -> Converged | tuple[float, Mechanism]:
        """Return a longer increment that converges, or the time and reason of the failure.

        The shortest increment has failed. Close to a limit load its failure may prove nothing, but
        a longer one to a load just above the limit does. Longer increments that failed only in
        windows are solved again with whole bodies; the path continues with one that converges.
        """
        now = point.now.state.time
        *longer, (time, last) = failed
        why = last or Mechanism()
        if why.limit:
            return time, why
        for attempted, known in reversed(longer):
            if abs(attempted - now) > _NEAR * abs(time - now) * (1 + ROUNDING):
                continue
            found = known or self._with_whole_bodies(point, attempted)
            if isinstance(found, Converged):
                return found
            if found.excludes:
                return attempted, found
        return time, why

    def _with_whole_bodies(self, point: Point, time: float) -> Converged | Mechanism:
        """Return the increment to a time with whole bodies, or the reason why it fails."""
        try:
            return self._increment(point, time, contact=True, patient=False, whole=True)
        except IncrementFailed as failure:
            return failure.why

    def _increment(
        self, point: Point, time: float, *, contact: bool, patient: bool, whole: bool
    ) -> Converged:
        """Return the increment to a time or raise `IncrementFailed`.

        It is solved in windows of the bodies; with whole bodies if windows are unsuitable, or if
        they fail and ``whole`` is set.

        If straight surfaces have moved too far for small sliding, the increment is repeated with
        finite sliding; if this does not converge, the first solution is kept.
        """
        state = self.system.joined(point.now.state, time)
        guess = self._predict(point.past, state, time) if contact else None

        tolerances = self.control.tolerances

        def solved(start: State, guess: State | None, whole: bool = whole) -> Converged:
            near = None
            try:
                if contact:
                    with one_thread():
                        near = narrowed(
                            self.system,
                            point.now,
                            start,
                            time,
                            guess=guess,
                            patient=patient,
                            tolerances=tolerances,
                        )
            except FailedInWindows:
                if not whole:
                    raise
            if near is not None:
                return near
            return Increment(
                self.system,
                start,
                time,
                guess=guess,
                contact=contact,
                elastic_first=guess is None,
                patient=patient,
                tolerances=tolerances.patient if whole else tolerances,
            ).solve()

        converged = solved(state, guess)
        following = followed(self.system, state, converged.state)
        if following is None:
            return converged
        try:
            return solved(following, None, whole=True)
        except IncrementFailed:
            return converged

    def elastic(self, point: Point, target: float) -> Point | None:
        """Return the point at time ``target`` in one increment; None if a point yields.

        One increment is exact if the state is independent of the history: `System.proportional`.
        """
        if not self.system.proportional:
            return None
        try:
            converged = Increment(
                self.system,
                point.now.state,
                target,
                elastic_only=True,
                tolerances=self.control.tolerances,
            ).solve()
        except (Yielded, IncrementFailed):
            return None
        # increments find the load at which this happens
        if converged.beyond_end or followed(self.system, point.now.state, converged.state):
            return None
        converged = self._worked(point.now, converged)
        self._report()
        return self._after(point, converged, ())

    def _predict(self, past: Sequence[State], now: State, time: float) -> State | None:
        """Return the state predicted for a time, or None.

        Under a load that moves along a body extrapolation would be wrong: the prediction is an
        earlier increment, shifted along with the load, if one corresponds.
        """
        if not self.system.moves:
            return extrapolate(past, now, time)
        with one_thread():
            return self._predictor.predicted(past, now, time)

    def _worked(self, before: Converged, now: Converged) -> Converged:
        """Return the increment ``now`` with the work since the lap began and its loss of state."""
        with one_thread():
            energy, forgotten = worked(self.system, before, now), lost(self.system, before, now)
        timing = before.timing.then(now.timing)
        return replace(now, energy=energy, lost=forgotten, timing=timing)

    def _after(
        self,
        point: Point,
        converged: Converged,
        past: tuple[State, ...],
        *,
        friction: bool = True,
    ) -> Point:
        """Return the point after one more increment."""
        if self.followers:
            beside = self.followers.followed(point.now, converged, friction=friction)
            converged = replace(converged, beside=beside)
        history = self._watched(point.history, converged)
        met = point.met | _facing(converged.state)
        return Point(converged, past, self._timed(point.tally.plus(converged)), history, met)

    def _watched(self, history: tuple[Any, ...], now: Converged) -> tuple[Any, ...]:
        return (*history, self._watch(now)) if self._watch else history

    def _ended(
        self, failure: IncrementFailed, point: Point, attempted: float, why: Mechanism
    ) -> NotConverged:
        reached = point.now.state.time
        way = f"between {self.place(reached)} and {self.place(attempted)}"
        growing = any(part.grows(reached, attempted) for part in self.system.parts)
        if why.limit and growing:
            return LimitLoad(f"no equilibrium {way}: {why}", reached, attempted)
        hint = spent(self.system, point.now.state)
        distorted = self.system.distorted(point.now.state)
        hint += "".join(f"; {each}" for each in distorted)
        if self.system.model.large and growing and not distorted:
            hint += f"; bodies of large strain may buckle, tip over or neck: {_MOVE}"
        return NotConverged(f"the increment {way} failed: {failure}{hint}", reached, attempted)

    def _timed(self, tally: Tally) -> Tally:
        """Return the tally with the CPU time spent since the last call."""
        now = clock.process_time()
        seconds, self._clock = tally.seconds + now - self._clock, now
        return replace(tally, seconds=seconds)


_MOVE = "prescribe a motion where a force acts, or reduce the load"


def placed(system: System, state: State, time: float) -> State:
    """Return the state in which a lap begins: wheels are set down, free bodies do not overlap."""
    state = system.set_down(state, time)
    return parted(system, state) if system.overlaps(state) else state


class _StepSize:
    """The step of increments to a target: halved after a failure, or divided and growing again.

    Attributes
    ----------
    step : step in time of the next increment, with its sign
    """

    def __init__(self, whole: float, cuts: int, halvings: int) -> None:
        self.step = max(whole / 2**halvings, whole * _SHORTEST, key=abs)
        self._whole, self._least = whole, abs(whole) / 2**cuts
        self._grows = self._expected = halvings > 0

    def shortest(self, step: float) -> bool:
        """Whether an increment of this size cannot be halved again."""
        return not self._expected and abs(step) < 2 * self._least * (1 - ROUNDING)

    def failed(self, step: float) -> bool:
        """Halve a step after a failure; return whether the half is permitted.

        If the step was divided only for an expected error, the whole step is tried instead.
        """
        if self._expected:
            self.step, self._grows, self._expected = self._whole, False, False
            return True
        self.step, self._grows = step / 2, False
        return abs(self.step) >= self._least * (1 - ROUNDING)

    def divided(self, step: float, halvings: int) -> bool:
        """Halve a step, as often as permitted; it may grow again. Return whether it is halved."""
        while halvings and abs(step) / 2**halvings < _SHORTEST * abs(self._whole) * (1 - ROUNDING):
            halvings -= 1
        if not halvings:
            return False
        self.step, self._grows = step / 2**halvings, True
        self._least = min(self._least, abs(self.step) / _FURTHER)
        return True

    def resumed(self, step: float) -> None:
        """Continue with a step that converged, after shorter ones had failed."""
        self.step = step

    def converged(self, step: float, *, grows: bool) -> None:
        """Double the next step, if steps may grow."""
        self._expected = False
        if self._grows and grows:
            self.step = min(2 * step, self._whole, key=abs)


def _halvings(error: float, most: float) -> int:
    """Return how often to halve an increment; its error is of second order in its length."""
    return math.ceil(math.log(error / most, 4) - ROUNDING) if error > most else 0


def _coarse(timing: Timing) -> bool:
    """Whether an increment is too long to resolve contact in time."""
    return timing.unknown > _UNTIMED or timing.passage > _PASSAGE


def _facing(state: State) -> frozenset[int]:
    """Return the numbers of the contact pairs whose surfaces face each other."""
    each = enumerate(state.contacts)
    return frozenset(k for k, contact in each if np.isfinite(contact.gap).any())


def extrapolate(past: Sequence[State], now: State, time: float) -> State | None:
    """Return the state at ``time`` extrapolated from the last two; None at a reversal.

    None also after a loss of contact: a body that only contact held would move without limit.
    """
    if not past or now.time == past[-1].time:
        return None
    if now.contacts and not any(contact.normal.any() for contact in now.contacts):
        return None
    before = past[-1]
    share = (time - now.time) / (now.time - before.time)
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
        links=now.links + share * (now.links - before.links),
    )


def turned(point: Point) -> Point:
    """Return the point without rates of gap and slip: another motion begins."""
    state = point.now.state
    contacts = tuple(contact.halted() for contact in state.contacts)
    return replace(point, now=replace(point.now, state=replace(state, contacts=contacts)))
