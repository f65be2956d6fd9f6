"""Passes over a track: set down, drive, roll, release, return.

One pass takes the times

====================  =====================================================================
0 to 1                the load grows where the pass begins
1 to 2                the moment grows (left out where there is none)
then one a millimetre the axle advances to the other end
then 1                the load is released, and the bodies are taken apart
then 1                the axle goes to where the next pass begins
====================  =====================================================================
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.contact.state import ContactState, State
from solver.errors import ModelError
from solver.fem.wheel import Wheel
from solver.loading.stepper import PathControl, Stepper, Stopped, Tally

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from solver.contact.state import Converged
    from solver.contact.system import System
    from solver.errors import NotConverged
    from solver.loading.stepper import Point, Report

_NOTHING = 1e-6
_ROUNDING = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """The timetable of ``n`` passes.

    Attributes
    ----------
    n : number of passes
    track : length rolled in a pass, centred on x = 0 [mm]
    step : advance of an increment [mm]
    directions : (n,) +1 or -1, the way each pass goes along x
    driven : whether a moment acts
    press, release : increments of loading and of unloading
    """

    n: int
    track: float
    step: float
    directions: tuple[int, ...]
    driven: bool
    press: int = 8
    release: int = 4

    def __post_init__(self) -> None:
        if self.half_steps < 1:
            raise ModelError("step", self.step, f"must be at most {self.track / 2:g} mm")

    @property
    def half_steps(self) -> int:
        """Increments from the start to mid-track."""
        return round(self.track / 2 / self.step)

    @property
    def advance(self) -> float:
        """Advance of an increment, which divides half the track [mm]."""
        return self.track / (2 * self.half_steps)

    def refined(self, times: int) -> Schedule:
        """Return the timetable with that many increments of advance in place of one."""
        return replace(self, step=self.advance / times)

    @property
    def cycle(self) -> int:
        """Passes after which the same load comes again."""
        return len(set(self.directions))

    @property
    def marks(self) -> tuple[float, ...]:
        """Times within a pass: loaded, driven, arrived, released, returned."""
        driven = 2.0 if self.driven else 1.0
        return 1.0, driven, driven + self.track, driven + self.track + 1, driven + self.track + 2

    @property
    def duration(self) -> float:
        """Time of a pass."""
        return self.marks[-1]

    def place(self, time: float) -> str:
        """Return in words where a time is."""
        number = int(time / self.duration + _ROUNDING)
        since = max(0.0, time - number * self.duration)
        loaded, driven, arrived, released, _ = self.marks
        stages = ((loaded, "set down by"), (driven, "driven by"), (released, "released by"))
        where = f"rolled {since - driven:.4g} mm"
        if not driven - _ROUNDING <= since <= arrived + _ROUNDING:
            end, words = next((s for s in stages if since <= s[0] + _ROUNDING), stages[-1])
            where = f"{words} {1 - (end - since):.0%}"
        return f"pass {number + 1}, {where}"

    def knots(self) -> dict[str, NDArray[np.float64]]:
        """Return time, share of the load, share of the moment and position, knot by knot."""
        loaded, driven, arrived, released, _ = self.marks
        time, load, moment, position = [], [], [], []
        for k, way in enumerate(self.directions):
            start = k * self.duration
            time += [start + t for t in (0.0, loaded, driven, arrived, released)]
            load += [0.0, 1.0, 1.0, 1.0, 0.0]
            moment += [0.0, 0.0, float(self.driven), float(self.driven), 0.0]
            half = way * self.track / 2
            position += [-half, -half, -half, half, half]
        values = (time, load, moment, position)
        names = ("time", "load", "moment", "position")
        return {name: np.array(v) for name, v in zip(names, values, strict=True)}


@dataclass(frozen=True, slots=True, kw_only=True)
class PassResult:
    """One pass: under load at mid-track and at the end, and released.

    ``creepage`` is 1 + R d(rotation) / d(advance) over the second half of the track.
    """

    number: int
    tally: Tally
    travel: float
    mid_track: Converged | None = None
    loaded: Converged | None = None
    unloaded: Converged | None = None
    creepage: float = np.nan
    error: NotConverged | None = None


class Passes:
    """Walks the passes of a schedule over one system."""

    def __init__(
        self, system: System, schedule: Schedule, control: PathControl, report: Report
    ) -> None:
        self.system = system
        self.schedule = schedule
        wheels = [i for i, part in enumerate(system.parts) if isinstance(part, Wheel)]
        self._wheel = wheels[0] if wheels else None
        self._stepper = Stepper(
            system,
            control,
            report,
            self._move if wheels else (lambda before, now, load: None),
            elastic_first=True,
            place=schedule.place,
        )

    def results(self, tally: Tally | None = None) -> Iterator[PassResult]:
        """Yield the result of each pass; the last one carries the error that ended the path.

        The cost of the passes is added to ``tally``.

        After a cycle of passes in each of which nothing yielded (a millionth of the plastic work
        so far, or less) all are like those of that cycle, and are not computed again.
        """
        state, tally = self.system.initial(), tally or Tally()
        cycle: deque[tuple[PassResult, bool]] = deque(maxlen=self.schedule.cycle)
        for number in range(self.schedule.n):
            if len(cycle) == cycle.maxlen and not any(yielded for _, yielded in cycle):
                result, yielded = replace(cycle[0][0], number=number, tally=tally), False
            else:
                result = self._one(number, state, tally)
                work = result.tally.plastic_work
                yielded = work - tally.plastic_work > _NOTHING * work
            yield result
            if result.unloaded is None:
                return
            cycle.append((result, yielded))
            state, tally = result.unloaded.state, result.tally

    def _one(self, number: int, state: State, tally: Tally) -> PassResult:
        schedule = self.schedule
        begin = number * schedule.duration
        loaded, driven, arrived, released, _ = (begin + mark for mark in schedule.marks)
        n = schedule.half_steps
        point = replace(self._stepper.rest(self._set_down(state, begin)), tally=tally)
        result = PassResult(number=number, tally=tally, travel=0.0)
        try:
            for k in range(1, schedule.press + 1):
                point = self._stepper.advance(point, begin + k / schedule.press)
            if schedule.driven:
                point = _halted(point)
                for k in range(1, schedule.press + 1):
                    point = self._stepper.advance(point, loaded + k / schedule.press)
            point = _halted(point)
            rolling = np.linspace(driven, arrived, 2 * n + 1)
            for k in range(1, 2 * n + 1):
                point = self._stepper.advance(point, float(rolling[k]))
                result = replace(result, travel=float(rolling[k]) - driven)
                if k == n:
                    result = replace(result, mid_track=point.now)
            creepage = self._creepage(result.mid_track, point.now)
            result = replace(result, loaded=point.now, creepage=creepage)
            for k in range(1, schedule.release):
                point = self._stepper.advance(point, arrived + k / schedule.release)
            point = self._stepper.advance(point, released, contact=False)
        except Stopped as stopped:
            return replace(result, tally=stopped.point.tally, error=stopped.error)
        return replace(result, tally=point.tally, unloaded=point.now)

    @property
    def _part(self) -> Wheel:
        assert self._wheel is not None
        wheel = self.system.parts[self._wheel]
        assert isinstance(wheel, Wheel)
        return wheel

    def _creepage(self, first: Converged | None, last: Converged) -> float:
        if self._wheel is None or first is None:
            return np.nan
        wheel = self._part
        moved = last.state.u[self._wheel] - first.state.u[self._wheel]
        return float(1 + moved[wheel.rim + 2] / moved[wheel.rim])

    def _move(self, before: State | None, now: State, load: float) -> State:
        """Predict that the wheel rolls on as it is."""
        del before
        assert self._wheel is not None
        u = list(now.u)
        u[self._wheel] = self._part.moved(u[self._wheel], load)
        return replace(now, u=tuple(u))

    def _set_down(self, state: State, time: float) -> State:
        """Return the state with the wheel where the pass begins, just touching."""
        if self._wheel is None:
            return replace(state, load=time)
        wheel = self._part
        u = list(state.u)
        u[self._wheel] = wheel.placed(time)
        (interface,) = self.system.interfaces
        gap = interface.pairing(tuple(u)).gap
        u[self._wheel][wheel.rim + 1] -= gap.min()
        touching = gap < gap.min() + 1e-9 * wheel.radius
        contacts = (ContactState.at_rest(gap, touching),)
        return replace(state, load=time, u=tuple(u), contacts=contacts)


def _halted(point: Point) -> Point:
    """Return the point where time begins to mean another motion."""
    state = point.now.state
    contacts = tuple(contact.halted() for contact in state.contacts)
    return replace(point, now=replace(point.now, state=replace(state, contacts=contacts)))
