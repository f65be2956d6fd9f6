"""A loading history as data: laps of stages, and the increments of these.

Loads and motions are amplitudes over time, declared with the bodies. Where the pressures of bodies
have no amplitude, time is the load factor, and goes back to zero when they are released.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from itertools import pairwise, takewhile
from typing import TYPE_CHECKING

from solver.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

ROUNDING = 1e-9
"""Relative difference below which two times are the same."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """A part of a loading history, from the end of the stage before to a time.

    Attributes
    ----------
    name : name of the state at its end
    target : time at its end
    steps : number of equal increments, where ``step`` is 0
    step : if not 0, increments end at its multiples, and the last one at the target
    apart : whether the last increment takes the bodies apart
    turns : whether another motion begins, for which the rates of gap and slip so far mean nothing
    refined : whether `Program.refined` divides its increments
    """

    name: str
    target: float
    steps: int = 1
    step: float = 0.0
    apart: bool = False
    turns: bool = False
    refined: bool = False

    def __post_init__(self) -> None:
        if self.steps < 1:
            raise ModelError(f"{self.name}.steps", self.steps, "must be at least 1")
        if not self.step >= 0:
            raise ModelError(f"{self.name}.step", self.step, "must not be negative")
        if not math.isfinite(self.target):
            raise ModelError(f"{self.name}.target", self.target, "must be finite")

    def times(self, start: float) -> list[float]:
        """Return the times at which its increments end."""
        if not self.step:
            way, steps = self.target - start, self.steps
            if self.target == 0.0:  # shares of what there was
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
        """Return the stage with ``times`` increments in place of one."""
        return replace(self, steps=self.steps * times, step=self.step / times)


@dataclass(frozen=True, slots=True)
class Lap:
    """Stages from a time on. At its beginning wheels are set down at their position."""

    stages: tuple[Stage, ...]
    start: float = 0.0

    def targets(self, first: bool) -> Iterator[Target]:
        """Yield the ends of its increments; ``first`` tells whether no lap is before it."""
        now, begins = self.start, None if first else self.start
        for stage in self.stages:
            times = stage.times(now)
            for k, time in enumerate(times):
                last = k + 1 == len(times)
                yield Target(
                    time=time,
                    begins=begins,
                    turns=stage.turns and k == 0,
                    apart=stage.apart and last,
                    keeps=stage.name if last else "",
                    closes=last and stage is self.stages[-1],
                )
                begins = None
            now = stage.target

    @property
    def count(self) -> int:
        """Number of its increments."""
        starts = [self.start, *(stage.target for stage in self.stages[:-1])]
        pairs = zip(self.stages, starts, strict=True)
        return sum(len(stage.times(now)) if stage.step else stage.steps for stage, now in pairs)


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """The end of an increment of a program, and what is special about it.

    ``begins`` (time) opens a lap after the first one, ``keeps`` (name) is the stage that it ends,
    ``closes`` says that the lap ends with it.
    """

    time: float
    begins: float | None = None
    turns: bool = False
    apart: bool = False
    keeps: str = ""
    closes: bool = False


@dataclass(frozen=True)
class Program:
    """A loading history.

    Attributes
    ----------
    laps : in their order
    cycle : laps after which the same loading repeats itself; 0 if it does not. When nothing yields
        in a whole cycle, later laps repeat its states and are not computed
    retraces : whether it is one lap of two stages whose loads grow with time in the first and go
        back in the second: elastic bodies then need one increment, and return to their first state
    place : (time) -> words for it in messages
    """

    laps: tuple[Lap, ...]
    cycle: int = 0
    retraces: bool = False
    place: Callable[[float], str] = field(default="load factor {:.6g}".format, compare=False)

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
        """Return the program with ``times`` increments in place of one, in `refined` stages."""

        def cut(lap: Lap) -> Lap:
            stages = (stage.refine(times) if stage.refined else stage for stage in lap.stages)
            return replace(lap, stages=tuple(stages))

        return replace(self, laps=tuple(map(cut, self.laps)))


def shared(one: Program, other: Program) -> int:
    """Return how many increments two programs have in common, from the first one on."""
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
    """Return how many increments it takes to walk programs, those of two in a row shared once."""
    before = (shared(one, other) for one, other in pairwise(programs))
    return sum(program.count for program in programs) - sum(before)


def load_cycles(load: float, step: float, unload_steps: int, cycles: int) -> Program:
    """Return the program that puts a load factor on and takes it away, as many times as asked.

    Each way is a motion of its own, and each lap ends with the bodies apart.
    """
    loaded = Stage(name="loaded", target=load, step=step)
    unloaded = Stage(name="unloaded", target=0.0, steps=unload_steps, apart=True, turns=True)
    return Program(laps=(Lap((loaded, unloaded)),) * cycles)


def load_and_release(load: float, step: float, unload_steps: int) -> Program:
    """Return the program that raises a load factor to ``load``, removes it and parts the bodies."""
    loaded = Stage(name="loaded", target=load, step=step)
    unloaded = Stage(name="unloaded", target=0.0, steps=unload_steps, apart=True)
    return Program(laps=(Lap((loaded, unloaded)),), retraces=True)
