"""Walks a loading path: increments, cuts, and an unloading branch at every load asked for.

The trunk visits multiples of the load step. A branch leaves it at the last multiple below its
load, goes to exactly that load, and unloads; the trunk then goes on from where the branch
left. So what a branch returns does not depend on which other branches are asked for: a sweep
over load on one path gives bit for bit what separate runs give.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.errors import LimitLoad, ModelError, NotConverged
from solver.increment import Increment
from solver.outcome import Converged, IncrementFailed, Tolerances, Yielded
from solver.system import State

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from solver.system import ContactState, System

    Report = Callable[[float, str], None]

_ROUNDING = 1e-9


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
            dissipation=min(self.dissipation, converged.dissipation),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Branch:
    """One load reached and released.

    ``loaded`` and ``unloaded`` are None, and ``error`` tells why, where the path ended before.
    """

    load: float
    tally: Tally
    loaded: Converged | None = None
    unloaded: Converged | None = None
    error: NotConverged | None = None


@dataclass(frozen=True, slots=True)
class _Point:
    """A state on the path, the one before it for extrapolation, and the cost so far."""

    now: Converged
    before: State | None
    tally: Tally


class _Stopped(Exception):
    """A path has ended: why, and its last point."""

    def __init__(self, error: NotConverged, point: _Point) -> None:
        super().__init__(str(error))
        self.error = error
        self.point = point


class Path:
    """The loading path of one system."""

    def __init__(self, system: System, control: PathControl, report: Report | None = None) -> None:
        self.system = system
        self.control = control
        self._report = report or (lambda load, message: None)
        self._clock = time.process_time()

    def branches(self, loads: Sequence[float]) -> Iterator[Branch]:
        """Yield a branch for every load factor, in increasing order."""
        trunk = self._start()
        error: NotConverged | None = None
        for load in sorted(loads):
            direct = self._elastic(load)
            if direct is not None:
                yield direct
                continue
            while error is None and trunk.now.state.load + self.control.load_step < load * (
                1 - _ROUNDING
            ):
                step = round(trunk.now.state.load / self.control.load_step) + 1
                try:
                    trunk = self._advance(trunk, step * self.control.load_step)
                except _Stopped as stopped:
                    error, trunk = stopped.error, stopped.point
            if error is not None:
                yield Branch(load=load, tally=trunk.tally, error=error)
                continue
            yield self._branch(trunk, load)

    def _branch(self, trunk: _Point, load: float) -> Branch:
        loaded = None
        try:
            loaded = self._advance(trunk, load)
            unloaded = self._unload(loaded)
        except _Stopped as stopped:
            now = loaded.now if loaded else None
            tally = stopped.point.tally
            return Branch(load=load, tally=tally, loaded=now, error=stopped.error)
        return Branch(load=load, tally=unloaded.tally, loaded=loaded.now, unloaded=unloaded.now)

    def _start(self) -> _Point:
        state = self.system.initial()
        at_rest = Increment(self.system, state, 0.0, contact=False).solve()
        return _Point(replace(at_rest, state=state), None, Tally())

    def _elastic(self, load: float) -> Branch | None:
        """Return the branch of a load that yields nothing, in one increment, or None.

        Without yielding, unloading restores the virgin state exactly. One increment is exact
        where the history of friction cannot matter: no friction, or surfaces that fit before
        loading, where everything grows in proportion.
        """
        if not self.system.proportional:
            return None
        start = self._start()
        try:
            converged = Increment(
                self.system,
                start.now.state,
                load,
                elastic_only=True,
                tolerances=self.control.tolerances,
            ).solve()
        except (Yielded, IncrementFailed):
            return None
        self._report(load, f"load {load:.4g}: elastic")
        tally = self._timed(start.tally.plus(converged))
        return Branch(load=load, tally=tally, loaded=converged, unloaded=start.now)

    def _unload(self, loaded: _Point) -> _Point:
        load, steps = loaded.now.state.load, self.control.unload_steps
        point = replace(loaded, before=None)
        for k in range(1, steps):
            point = self._advance(point, load * (1 - k / steps))
        return self._advance(point, 0.0, contact=False)

    def _advance(self, point: _Point, target: float, *, contact: bool = True) -> _Point:
        """Return the point at load ``target``, halving increments that fail."""
        start = point.now.state.load
        step = target - start
        least = abs(step) / 2**self.control.max_cuts
        while point.now.state.load != target:
            state = point.now.state
            close = abs(target - state.load) <= abs(step) * (1 + _ROUNDING)
            load = target if close else state.load + step
            last = load == target
            try:
                converged = Increment(
                    self.system,
                    state,
                    load,
                    guess=extrapolate(point.before, state, load) if contact else None,
                    contact=contact or not last,
                    tolerances=self.control.tolerances,
                ).solve()
            except IncrementFailed as failure:
                tally = replace(point.tally, cuts=point.tally.cuts + 1)
                point = replace(point, tally=self._timed(tally), before=None)
                step = (load - state.load) / 2
                if abs(step) < least * (1 - _ROUNDING):
                    raise _Stopped(_ended(failure, state.load, load), point) from failure
                continue
            point = _Point(converged, state, self._timed(point.tally.plus(converged)))
            self._report(load, f"load {load:.4g}: {converged.iterations} iterations")
        return point

    def _timed(self, tally: Tally) -> Tally:
        now = time.process_time()
        spent, self._clock = now - self._clock, now
        return replace(tally, seconds=tally.seconds + spent)


def _ended(failure: IncrementFailed, reached: float, attempted: float) -> NotConverged:
    if failure.flowing and abs(attempted) > abs(reached):
        return LimitLoad(
            f"no equilibrium between load factors {reached:.6g} and {attempted:.6g}: the "
            f"structure flows with {failure.stiffness:.1%} of its elastic stiffness",
            reached,
            attempted,
        )
    return NotConverged(
        f"the increment from load factor {reached:.6g} to {attempted:.6g} failed: {failure}",
        reached,
        attempted,
    )


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
