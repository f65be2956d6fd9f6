"""Tolerances of an increment, and the division of a load into increments."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from solver.loading.program import Program, load_and_release
from solver.parameters import AtLeastOne, Checked, Infinite, Positive

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
