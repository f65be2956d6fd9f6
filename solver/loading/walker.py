"""Walk programs on one system: solve them lap by lap, stage by stage.

Programs that begin with the same increments share them: a **branch** starts from the state after
the last common increment. The result of a program does not depend on the other programs: it equals,
bit for bit, that of the program walked alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import Any

import numpy as np

from solver.contact.state import Converged
from solver.contact.system import System
from solver.errors import LimitLoad, ModelError, NotConverged
from solver.loading.checks import check_freed, excess_shear
from solver.loading.outcome import Cycle, Outcome, PathEnded, Point, Settled, Tally
from solver.loading.program import HALVINGS, Control, Program, StepRefinement, Target, shared
from solver.loading.stepper import Followers, Report, Stepper, Watch, turned

Points = Mapping[str, Converged]


_NOTHING = 1e-6
"""Plastic work of a lap over the plastic work so far: the lap is elastic up to this ratio."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Walk:
    """A walk so far.

    ``points`` are the states at the ends of stages of the present lap, ``work`` is the plastic work
    before it [N mm]; ``past`` has the points of earlier laps, and whether anything yielded in them;
    ``cycles`` are the cycles of repeated stages, ``cycle`` is the state at the beginning of the
    present one.
    """

    point: Point
    points: Points = field(default_factory=dict)
    traces: tuple[Any, ...] = ()
    work: float = 0.0
    past: tuple[tuple[Points, bool], ...] = ()
    cycles: tuple[Cycle, ...] = ()
    cycle: Converged | None = None
    error: NotConverged | None = None


class Walker:
    """Walks programs over a system.

    Parameters
    ----------
    trace : (states at the ends of a lap's stages, by name) -> value kept in `Outcome.traces`
    refinement : criterion by which increments are halved; without it those of the program are used
    until : (cycles of repeated stages so far) -> whether the other cycles may be left out
    watch : (converged increment) -> value kept in `Outcome.history`
    report : called after every increment
    followers : neighbouring runs; a program has those of its neighbours `beside` it
    """

    def __init__(
        self,
        system: System,
        control: Control,
        *,
        trace: Callable[[Points], Any] | None = None,
        refinement: StepRefinement | None = None,
        until: Callable[[Sequence[Cycle]], bool] | None = None,
        report: Report | None = None,
        watch: Watch | None = None,
        followers: Followers | None = None,
    ) -> None:
        self._system, self._until = system, until
        self._trace = trace
        self._refinement = refinement
        self._followers = followers
        self._stepper = Stepper(system, control, report, watch, followers)

    def walk(
        self, programs: Iterable[Program], largest: Program | None = None
    ) -> Iterator[Outcome]:
        """Yield the outcome of each program, in order, as soon as it is known.

        The cost is least if each program shares as many increments as possible with the previous
        one, as programs of increasing loads do.

        With ``largest`` a program may depend on the outcome of the one before it, and is requested
        only then. Two programs must share no more increments with each other than one of them
        shares with ``largest``. The states at which programs left ``largest`` are kept, for the two
        furthest ones, so that a program between others can start there.

        Raises
        ------
        ModelError
            if a load of a program would move a body that nothing holds
        """
        ahead = _with_next(map(self._checked, programs), largest)
        first_pair = next(ahead, None)
        if first_pair is None:
            return
        last, settled = first_pair[0], Settled()
        self._stepper.place = last.place
        if self._refinement is None:
            known = {0: self._start(last)}
        else:
            settled, first = self._settle(last)
            last = last.refined(settled.times)
            known = {last.laps[0].count: first}
        for pair in chain([first_pair], ahead):
            program, following = pair
            if self._refinement is not None:
                program = program.refined(settled.times)
                following = following and following.refined(settled.times)
            alike = shared(last, program)
            known = {at: walk for at, walk in known.items() if at <= alike}
            if not known:
                known = {0: self._start(program)}
            walk = self._directly(program, known.get(0))
            if walk is None:
                at = max(known)
                fork = shared(program, following) if following else 0
                if fork > at:
                    kept = {min(known)} if largest is None else {min(known), at}
                    forked = self._along(known[at], program, at, fork)
                    known = {each: known[each] for each in kept} | {fork: forked}
                    at = fork
                walk = self._along(known[at], program, at, program.count)
                last = program
            yield Outcome(
                tally=walk.point.tally,
                last=walk.point.now,
                points=walk.points,
                traces=walk.traces,
                cycles=walk.cycles,
                history=walk.point.history,
                error=walk.error or self._never_facing(walk.point),
                settled=settled,
            )

    def _checked(self, program: Program) -> Program:
        check_freed(self._system, program)
        return program

    def _never_facing(self, point: Point) -> NotConverged | None:
        """Return the error if the surfaces of a pair have never faced each other, else None."""
        for k, contact in enumerate(self._system.model.contacts):
            if k not in point.met:
                slave, master = (".".join(side) for side in (contact.slave, contact.master))
                time = point.now.state.time
                return NotConverged(
                    f"{slave} and {master} never faced each other, so they could not touch; check "
                    "the boundaries, the positions of the bodies and their motion",
                    time, time,
                )  # fmt: skip
        return None

    def _start(self, program: Program, tally: Tally | None = None) -> _Walk:
        """Return the walk at the beginning of a program."""
        if self._followers:
            self._followers.between(program.ways[0])
        try:
            point = self._stepper.begin(self._system.initial(), program.laps[0].start, tally)
        except PathEnded as ended:
            return _Walk(point=ended.point, error=ended.error)
        return _Walk(point=point, work=point.tally.plastic_work)

    def _directly(self, program: Program, start: _Walk | None) -> _Walk | None:
        """Return the walk of a program in one increment if nothing yields, else None.

        Without yielding, unloading restores the unloaded state exactly.
        """
        proportional = program.retraces and not self._system.has_amplitude
        if not proportional or start is None or start.error is not None:
            return None
        stages = program.laps[0].stages
        if self._followers:
            ways, last = program.ways, [bool(t.keeps) for t in program.targets].index(True)
            ends = zip(ways[0], ways[last], strict=True)
            self._followers.between([(first[0], end[1]) for first, end in ends])
        reached = self._stepper.elastic(start.point, stages[0].target)
        if reached is None:
            return None
        history = (*reached.history, *start.point.history[-1:])
        unloaded = _as_near(start.point.now, reached.now)
        back = replace(
            start.point, now=unloaded, tally=reached.tally, history=history, met=reached.met
        )
        points = {stages[0].name: reached.now, stages[-1].name: unloaded}
        return self._closed(replace(start, point=back, points=points), program)

    def _along(self, walk: _Walk, program: Program, first: int, end: int) -> _Walk:
        """Return the walk over the targets of a program from number ``first`` to ``end``."""
        at = first
        targets, ways = program.targets, program.ways if self._followers else []
        if walk.error is None:
            error = excess_shear(self._system, [target.time for target in targets[first:end]])
            walk = replace(walk, error=error)
        while at < end and walk.error is None:
            quiet = len(walk.past) == program.cycle and not any(y for _, y in walk.past)
            if targets[at].begins is not None and program.cycle and quiet:
                walk = _repeated(walk, program.cycle)
                at += next(k for k, t in enumerate(targets[at:], 1) if t.closes)
                continue
            if self._followers:
                self._followers.between(ways[at])
            try:
                walk = self._to(walk, targets[at])
            except PathEnded as ended:
                return replace(walk, point=ended.point, error=ended.error)
            if targets[at].closes:
                walk = self._closed(walk, program)
            if targets[at].repeats and self._until and self._until(walk.cycles):
                rest = range(at + 1, len(targets))
                after = next((k for k in rest if not targets[k].cycle), len(targets))
                if after <= end:  # continue with the loads at the end of the last cycle
                    point = self._stepper.again(walk.point, targets[after - 1].time)
                    walk, at = replace(walk, point=point), after - 1
            at += 1
        return walk

    def _to(self, walk: _Walk, target: Target) -> _Walk:
        """Return the walk at the next target."""
        if target.begins is not None:
            point = self._stepper.again(walk.point, target.begins)
            walk = replace(walk, point=point, points={}, work=point.tally.plastic_work)
        begun = walk.cycle or walk.point.now if target.cycle else None
        point = turned(walk.point) if target.turns else walk.point
        point = self._stepper.reach(point, target.time, contact=not target.apart)
        points = dict(walk.points)
        if target.keeps:
            if target.cycle and target.keeps in points:
                points[f"{target.keeps}_before"] = points[target.keeps]
            points[target.keeps] = point.now
        cycles = walk.cycles
        if target.repeats and begun:
            cycles, begun = (*cycles, Cycle.between(begun, point.now)), None
        return replace(walk, point=point, points=points, cycles=cycles, cycle=begun)

    def _closed(self, walk: _Walk, program: Program) -> _Walk:
        """Return the walk with the results of its complete lap."""
        work = walk.point.tally.plastic_work
        yielded = work - walk.work > _NOTHING * work
        past = (*walk.past, (walk.points, yielded))[-program.cycle :] if program.cycle else ()
        traces = (*walk.traces, self._trace(walk.points)) if self._trace else ()
        return replace(walk, past=past, traces=traces)

    def _settle(self, program: Program) -> tuple[Settled, _Walk]:
        """Walk the first lap with ever smaller increments until its result converges.

        If smaller increments fail, the result of the larger ones is kept.
        """
        assert self._refinement is not None
        tolerance = self._refinement.tolerance
        if not any(stage.refined for stage in program.laps[0].stages):
            allowed = "needs a stage of the first lap whose increments may be divided (refined)"
            raise ModelError("refinement", tolerance, allowed)
        settled, taken, coarse, tally = Settled(), None, None, Tally()
        for halved in range(HALVINGS + 1 if tolerance else 1):
            times = 2**halved
            refined = program.refined(times)
            walk = self._along(self._start(refined, tally), refined, 0, refined.laps[0].count)
            failed = walk.error is not None and not isinstance(walk.error, LimitLoad)
            if failed and coarse is not None:
                settled = replace(settled, failed=times)
                break
            taken, settled = walk, replace(settled, times=times)
            if walk.error is None:
                fine = self._refinement.measure(walk.traces[0])
                if coarse is not None:
                    settled = replace(settled, error=float(np.abs(fine - coarse).max()))
                if settled.error <= tolerance:
                    break
                coarse = fine
            elif not failed:
                break
            # the tally keeps the time that the larger increments took
            tally = Tally(seconds=walk.point.tally.seconds)
        assert taken is not None
        return settled, taken


def _with_next(
    programs: Iterator[Program], largest: Program | None
) -> Iterator[tuple[Program, Program | None]]:
    """Yield each program with the next one, or with ``largest`` without requesting the next."""
    program = next(programs, None)
    while program is not None:
        if largest is not None:
            yield program, largest
            program = next(programs, None)
        else:
            following = next(programs, None)
            yield program, following
            program = following


def _repeated(walk: _Walk, cycle: int) -> _Walk:
    """Return the walk after a lap that repeats the one a cycle before."""
    points, _ = walk.past[0]
    return replace(
        walk,
        points=points,
        traces=(*walk.traces, walk.traces[-cycle]) if walk.traces else (),
        past=(*walk.past[1:], (points, False)),
    )


def _as_near(now: Converged, loaded: Converged) -> Converged:
    """Return a state whose neighbours have come as near to a switch as those under load."""
    both = zip(now.beside, loaded.beside, strict=False)  # none under load if one has failed there
    return replace(now, beside=tuple(replace(own, near=other.near) for own, other in both))
