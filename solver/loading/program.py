"""A loading history as data: laps of stages, and the increments of these.

Loads and motions are amplitudes over time, declared with the bodies. Where the pressures of bodies
have no amplitude, time is the load factor, and goes back to zero when they are released.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

from solver.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Callable

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

    def times(self, start: float) -> list[float]:
        """Return the times at which its increments end."""
        if not self.step:
            way = self.target - start
            shares = [1 - k / self.steps for k in range(1, self.steps)]
            return [*(self.target - way * share for share in shares), self.target]
        times, now = [], start
        while now + self.step < self.target * (1 - ROUNDING):
            now = (round(now / self.step) + 1) * self.step
            times.append(now)
        return [*times, self.target]


@dataclass(frozen=True, slots=True)
class Lap:
    """Stages from a time on. At its beginning wheels are set down at their position."""

    stages: tuple[Stage, ...]
    start: float = 0.0


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
    retraces : whether there is one lap whose loads grow with time in the first stage and go back
        in the others: elastic bodies then need one increment, and return to their first state
    place : (time) -> words for it in messages
    """

    laps: tuple[Lap, ...]
    cycle: int = 0
    retraces: bool = False
    place: Callable[[float], str] = field(default="load factor {:.6g}".format, compare=False)

    @cached_property
    def targets(self) -> tuple[Target, ...]:
        """The ends of its increments, in their order."""
        out: list[Target] = []
        for lap in self.laps:
            now = lap.start
            begins = now if out else None
            for stage in lap.stages:
                times = stage.times(now)
                for k, time in enumerate(times):
                    last = k + 1 == len(times)
                    out.append(
                        Target(
                            time=time,
                            begins=begins,
                            turns=stage.turns and k == 0,
                            apart=stage.apart and last,
                            keeps=stage.name if last else "",
                            closes=last and stage is lap.stages[-1],
                        )
                    )
                    begins = None
                now = stage.target
        return tuple(out)

    def refined(self, times: int) -> Program:
        """Return the program with ``times`` increments in place of one, in `refined` stages."""

        def cut(stage: Stage) -> Stage:
            return replace(stage, steps=stage.steps * times) if stage.refined else stage

        laps = (replace(lap, stages=tuple(map(cut, lap.stages))) for lap in self.laps)
        return replace(self, laps=tuple(laps))


def shared(one: Program, other: Program) -> int:
    """Return how many increments two programs have in common, from the first one on."""
    pairs = zip(one.targets, other.targets, strict=False)
    if one.laps[0].start != other.laps[0].start:
        return 0
    return next((i for i, (a, b) in enumerate(pairs) if a != b),
                min(len(one.targets), len(other.targets)))  # fmt: skip


def load_and_release(load: float, step: float, unload_steps: int) -> Program:
    """Return the program that raises a load factor to ``load``, removes it and parts the bodies."""
    loaded = Stage(name="loaded", target=load, step=step)
    unloaded = Stage(name="unloaded", target=0.0, steps=unload_steps, apart=True)
    return Program(laps=(Lap((loaded, unloaded)),), retraces=True)
