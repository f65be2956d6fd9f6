"""A loading history as data: laps, their stages, the increments of the stages; how it is solved.

Loads and motions follow amplitudes over time, declared with the bodies. Without an amplitude the
time is the load factor, which returns to zero when the load is released.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby, pairwise, takewhile
from typing import Any

from solver.errors import ModelError
from solver.parameters import AtLeastOne, Checked, Infinite, NotNegative, Positive, check
from solver.typing import Array

ROUNDING = 1e-9
"""Relative difference of two times: times that differ by less are equal."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """A part of a loading history, from the end of the previous stage to a time.

    Attributes
    ----------
    name : name of the state at its end
    target : time at its end
    steps : number of equal increments, if ``step`` is 0
    step : if not 0, increments end at its multiples, and the last one at the target
    apart : whether the last increment separates the bodies
    turns : whether another motion begins: previous rates of gap and slip are then not used
    refined : whether `Program.refined` divides its increments
    stops : times between start and target, in order, at which increments end too, for example where
        an amplitude bends. ``steps`` are distributed over the intervals, at least one each
    cycle : number of the repetition, from 1, of a repeated stage; 0 for another stage. The state at
        its end is kept under its name, that of the repetition before as ``NAME_before``
    """

    name: str
    target: float
    steps: AtLeastOne = 1
    step: NotNegative = 0.0
    apart: bool = False
    turns: bool = False
    refined: bool = False
    stops: tuple[float, ...] = ()
    cycle: int = 0

    def __post_init__(self) -> None:
        check(self, f"{self.name}.")
        if self.stops and self.step:
            raise ModelError(f"{self.name}.step", self.step, "must be 0 with stops: give steps")

    def times(self, start: float) -> list[float]:
        """Return the times at which its increments end."""
        if self.stops:
            ends = (start, *self.stops, self.target)
            if len({later > earlier for earlier, later in pairwise(ends)}) > 1 or start in ends[1:]:
                allowed = f"must be between its start {start:g} and its target, in order"
                raise ModelError(f"{self.name}.stops", self.stops, allowed)
            shares = [(end - begin) / (self.target - start) for begin, end in pairwise(ends)]
            counts = [max(1, math.ceil(self.steps * share - ROUNDING)) for share in shares]
            return [
                begin + (end - begin) * k / count if k < count else end
                for (begin, end), count in zip(pairwise(ends), counts, strict=True)
                for k in range(1, count + 1)
            ]
        if not self.step:
            way, steps = self.target - start, self.steps
            if self.target == 0.0:  # equal shares of the time at the start
                return [*(start * (1 - k / steps) for k in range(1, steps)), 0.0]
            return [*(start + way * k / steps for k in range(1, steps)), self.target]
        way = 1 if self.target >= start else -1
        end = way * self.target
        times, now = [], way * start
        while now + self.step < end - ROUNDING * abs(end):
            now = (round(now / self.step) + 1) * self.step
            times.append(way * now)
        return [*times, self.target]

    def refine(self, times: int) -> Stage:
        """Return the stage with ``times`` as many increments."""
        return replace(self, steps=self.steps * times, step=self.step / times)


@dataclass(frozen=True, slots=True)
class Lap:
    """A group of stages from a time on. It begins with wheels set down at their positions."""

    stages: tuple[Stage, ...]
    start: float = 0.0

    def __post_init__(self) -> None:
        each = [
            (cycle, tuple(stage.name for stage in own))
            for cycle, own in groupby(self.stages, key=lambda stage: stage.cycle)
        ]
        numbers, names = (
            [cycle for cycle, _ in each if cycle],
            {own for cycle, own in each if cycle},
        )
        apart = any(not cycle for cycle, _ in each[1:-1])
        if numbers != list(range(1, len(numbers) + 1)) or len(names) > 1 or apart:
            allowed = "must be 1, 2, ... of stages that follow one another, with the same names"
            raise ModelError("cycle", [cycle for cycle, _ in each], allowed)

    def targets(self, first: bool) -> Iterator[Target]:
        """Yield the ends of its increments; ``first`` says whether it is the first lap."""
        now, begins = self.start, None if first else self.start
        following = [*self.stages[1:], None]
        for stage, after in zip(self.stages, following, strict=True):
            times = stage.times(now)
            for k, time in enumerate(times):
                last = k + 1 == len(times)
                yield Target(
                    time=time,
                    begins=begins,
                    turns=stage.turns and k == 0,
                    apart=stage.apart and last,
                    keeps=stage.name if last else "",
                    closes=last and after is None,
                    cycle=stage.cycle,
                    repeats=last and stage.cycle > 0 and (not after or after.cycle != stage.cycle),
                )
                begins = None
            now = stage.target

    @property
    def count(self) -> int:
        """Number of its increments."""
        starts = [self.start, *(stage.target for stage in self.stages[:-1])]
        pairs = zip(self.stages, starts, strict=True)
        return sum(
            len(stage.times(now)) if stage.step or stage.stops else stage.steps
            for stage, now in pairs
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """The end of an increment of a program.

    Attributes
    ----------
    time : time at its end
    begins : time at which a lap after the first one begins with this increment; None otherwise
    turns, apart, cycle : as in `Stage`
    keeps : name of the stage that ends with it; empty otherwise
    closes, repeats : whether the lap, or a cycle, ends with it
    """

    time: float
    begins: float | None = None
    turns: bool = False
    apart: bool = False
    keeps: str = ""
    closes: bool = False
    cycle: int = 0
    repeats: bool = False


@dataclass(frozen=True)
class Program:
    """A loading history.

    Attributes
    ----------
    laps : the laps, in their order
    cycle : number of laps after which the loading repeats; 0 if it does not. If nothing yields in a
        whole cycle, later laps repeat its states and are not computed
    retraces : whether the program is one lap of two stages, loading and unloading: elastic bodies
        then need one increment, and return to their first state
    place : (time) -> text for this time in messages
    beside : programs of the neighbouring runs (`solver.derivatives`), which have the same targets
        at other times
    """

    laps: tuple[Lap, ...]
    cycle: int = 0
    retraces: bool = False
    place: Callable[[float], str] = field(default="load factor {:.6g}".format, compare=False)
    beside: tuple[Program, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        if not self.laps or not all(lap.stages for lap in self.laps):
            raise ModelError("laps", self.laps, "must be at least one, of one stage or more each")
        if self.retraces:
            (lap, *more) = self.laps
            if more or len(lap.stages) != 2 or lap.stages[1].target != lap.start:
                allowed = "needs one lap of two stages that ends at the time at which it starts"
                raise ModelError("retraces", self.retraces, allowed)

    @property
    def targets(self) -> list[Target]:
        """The ends of its increments, in their order."""
        return [t for k, lap in enumerate(self.laps) for t in lap.targets(first=k == 0)]

    @property
    def count(self) -> int:
        """Number of its increments."""
        return sum(lap.count for lap in self.laps)

    def refined(self, times: int) -> Program:
        """Return the program with ``times`` as many increments in its `refined` stages."""

        def cut(lap: Lap) -> Lap:
            stages = (stage.refine(times) if stage.refined else stage for stage in lap.stages)
            return replace(lap, stages=tuple(stages))

        beside = tuple(program.refined(times) for program in self.beside)
        return replace(self, laps=tuple(map(cut, self.laps)), beside=beside)

    @property
    def ways(self) -> list[tuple[tuple[float, float], ...]]:
        """Times at both ends of each increment, of this program and of those beside it."""
        each = zip(*(program._ways() for program in (self, *self.beside)), strict=True)
        return list(each)

    def _ways(self) -> list[tuple[float, float]]:
        starts = [self.laps[0].start, *(target.time for target in self.targets)]
        return [
            (start if target.begins is None else target.begins, target.time)
            for start, target in zip(starts, self.targets, strict=False)
        ]


def shared(one: Program, other: Program) -> int:
    """Return the number of increments that two programs have in common at their beginning."""
    count = 0
    for k, (mine, its) in enumerate(zip(one.laps, other.laps, strict=False)):
        if mine == its:
            count += mine.count
            continue
        if mine.start == its.start:
            pairs = zip(mine.targets(first=k == 0), its.targets(first=k == 0), strict=False)
            count += sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))
        return count
    return count


def walked(programs: Sequence[Program]) -> int:
    """Return the number of increments of programs; successive ones share their common beginning."""
    before = (shared(one, other) for one, other in pairwise(programs))
    return sum(program.count for program in programs) - sum(before)


def load_cycles(load: float, step: float, unload_steps: int, cycles: int) -> Program:
    """Return the program that applies and removes a load factor ``cycles`` times.

    Unloading begins a new motion, and each lap ends with the bodies separated.
    """
    loaded = Stage(name="loaded", target=load, step=step)
    unloaded = Stage(name="unloaded", target=0.0, steps=unload_steps, apart=True, turns=True)
    return Program(laps=(Lap((loaded, unloaded)),) * cycles)


def load_and_release(load: float, step: float, unload_steps: int) -> Program:
    """Return the program that raises the load factor to ``load``, then unloads and separates."""
    loaded = Stage(name="loaded", target=load, step=step)
    unloaded = Stage(name="unloaded", target=0.0, steps=unload_steps, apart=True)
    return Program(laps=(Lap((loaded, unloaded)),), retraces=True)


HALVINGS = 6
"""Most halvings of the increments by `StepRefinement`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepRefinement:
    """Increments are halved while this changes the result of the first lap.

    Backward Euler in the plastic strain is of first order in the increment, so the change by the
    last halving estimates the remaining error.

    Attributes
    ----------
    measure : (trace of a lap) -> numbers that must converge
    tolerance : largest change accepted
    """

    measure: Callable[[Any], Array]
    tolerance: float


INCREMENT_ERROR = 0.006
"""Error of stress by the length of an increment, over the yield stress, at most: the errors of all
increments of a load then sum to one or two percent. The number of increments grows as
1 / sqrt(error)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerances(Checked):
    """When an increment counts as converged.

    Attributes
    ----------
    residual : largest out-of-balance force over the largest force level so far
    contact : largest violation of the contact conditions, as a force, over the same level
    iterations : largest number of Newton iterations of an increment. 1.5 times as many are allowed
        in windows of the bodies, where an iteration is cheap, and in the last attempt
    """

    residual: Positive = 1e-8
    contact: Positive = 1e-7
    iterations: AtLeastOne = 40

    @property
    def patient(self) -> Tolerances:
        """The same with 1.5 times as many iterations."""
        return replace(self, iterations=3 * self.iterations // 2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Control(Checked):
    """How a program is solved.

    Attributes
    ----------
    max_cuts : how often an increment may be halved before the run ends with an error
    increment_error : largest error of stress, over the yield stress, that the length of an
        increment may add before it is divided, inf if none is: see `solver.loading.integration`
    tolerances : of an increment
    """

    max_cuts: int = 4
    increment_error: Positive | Infinite = INCREMENT_ERROR
    tolerances: Tolerances = field(default_factory=Tolerances)


@dataclass(frozen=True, slots=True, kw_only=True)
class PathControl(Control):
    """How a load factor is raised and removed.

    Attributes
    ----------
    load_step : step of the load factor; increments of loading end at its multiples
    unload_steps : number of equal increments from full load to zero; the last separates the bodies
    max_cuts : how often an increment may be halved before the run ends with an error
    increment_error : see `Control`
    tolerances : of an increment
    """

    load_step: Positive = 0.05
    unload_steps: AtLeastOne = 5

    def program(self, load: float) -> Program:
        """Return the program that raises the load factor to ``load`` and removes it."""
        return load_and_release(load, self.load_step, self.unload_steps)
