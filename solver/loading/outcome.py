"""The failure of an increment, the result of a program and of its cycles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from solver.contact.state import Converged, State
from solver.errors import NotConverged, SolverError
from solver.tensors import AXES
from solver.typing import Array, Ints

_CLOSE = 1e-3
"""Relative distance between a load and the excluded load above it: a closer load is at the
limit."""


class Yielded(SolverError):
    """A point yielded in an increment that had to stay elastic."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mechanism:
    """A motion in which bodies flow, strained most in ``body`` at ``place`` [mm].

    ``ratio`` is the power of the load over the largest power that can resist it. If it ``slides``,
    the motion is a rigid one of ``body`` along its contacts, which only friction resists.
    """

    ratio: float = 0.0
    body: str = ""
    place: tuple[float, ...] = (0.0, 0.0)
    slides: bool = False

    def __lt__(self, other: Mechanism) -> bool:
        """Whether the other mechanism is closer to a proof."""
        return self.ratio < other.ratio

    @property
    def limit(self) -> bool:
        """Whether the load is above the limit load, or within `_CLOSE` of it."""
        return self.ratio > 1 - _CLOSE

    @property
    def excludes(self) -> bool:
        """Whether equilibrium is excluded from any other state, as `limit`, for any history.

        A slide excludes it only for its normal forces, which may differ in another state.
        """
        return self.limit and not self.slides

    def __str__(self) -> str:
        if self.slides:
            return (
                f"body {self.body!r} slides on all its contacts: its load is {self.ratio:.4g} "
                "times the largest friction"
            )
        at = ", ".join(f"{axis} = {x:.4g}" for axis, x in zip(AXES, self.place, strict=False))
        return (
            f"body {self.body!r} flows around {at} mm, where the load does "
            f"{self.ratio:.4g} times the largest work of plastic flow and friction"
        )


class IncrementFailed(SolverError):
    """The increment did not converge; ``why`` is the mechanism closest to a proof."""

    def __init__(self, message: str, why: Mechanism | None = None) -> None:
        super().__init__(message)
        self.why = why or Mechanism()


@dataclass(frozen=True, slots=True)
class Tally:
    """Cost and plastic work so far.

    Attributes
    ----------
    iterations : Newton iterations of each increment
    cuts : number of increments that failed and were halved
    pivoted, blended : as in `Converged`
    seconds : CPU time
    plastic_work : [N mm]
    dissipation : least plastic dissipation at a point in an increment [N mm/mm3]
    lost : largest loss of state between two increments (`history.lost`)
    beside : plastic work of the neighbouring runs, if there are any [N mm]
    """

    iterations: tuple[int, ...] = ()
    cuts: int = 0
    pivoted: int = 0
    blended: int = 0
    seconds: float = 0.0
    plastic_work: float = 0.0
    dissipation: float = 0.0
    lost: float = 0.0
    beside: tuple[float, ...] = ()

    def plus(self, converged: Converged) -> Tally:
        """Return the tally with one more increment."""
        return replace(
            self,
            iterations=(*self.iterations, converged.iterations),
            pivoted=self.pivoted + converged.pivoted,
            blended=self.blended + converged.blended,
            plastic_work=self.plastic_work + converged.plastic_work,
            dissipation=float(np.minimum(self.dissipation, converged.dissipation)),
            lost=float(np.maximum(self.lost, converged.lost)),
            beside=tuple(
                each.plastic_work + (self.beside[k] if self.beside else 0.0)
                for k, each in enumerate(converged.beside)
            ),
        )


@dataclass(frozen=True, slots=True)
class Point:
    """A converged state, the states before it (for predictions), and the cost so far.

    ``history`` are the values that ``watch`` returned for the increments; ``met`` are the numbers
    of the contact pairs whose surfaces have faced each other.
    """

    now: Converged
    past: tuple[State, ...]
    tally: Tally
    history: tuple[Any, ...] = ()
    met: frozenset[int] = frozenset()


class PathEnded(Exception):
    """The walk cannot continue: the error, and the last point reached."""

    def __init__(self, error: NotConverged, point: Point) -> None:
        super().__init__(error, point)
        self.error = error
        self.point = point


@dataclass(frozen=True, slots=True, kw_only=True)
class Settled:
    """The refinement of increments with which a program was solved.

    Attributes
    ----------
    times : number of increments per increment of the program
    error : estimated remaining error, in the unit of `StepRefinement.measure`; NaN if unknown
    failed : the same number in the attempt that failed; 0 if none failed
    """

    times: int = 1
    error: float = np.nan
    failed: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """The result of a program.

    Attributes
    ----------
    tally : its cost
    last : last state reached
    points : states at the ends of the stages of the last lap, by name
    traces : values that the walker's ``trace`` returned, one for each complete lap
    cycles : cycles of repeated stages
    history : values that its ``watch`` returned, for the first state and after each increment
    error : reason why the program did not reach its end; None if it did
    settled : refinement of its increments
    """

    tally: Tally
    last: Any
    points: Mapping[str, Any] = field(default_factory=dict)
    traces: tuple[Any, ...] = ()
    cycles: tuple[Cycle, ...] = ()
    history: tuple[Any, ...] = ()
    error: NotConverged | None = None
    settled: Settled = field(default_factory=Settled)

    @property
    def beside(self) -> list[Outcome]:
        """The outcomes of the neighbouring runs, without traces and history; none if one failed."""
        return [
            replace(
                self,
                tally=replace(self.tally, plastic_work=self.tally.beside[k]),
                last=self.last.beside[k],
                points=points,
                cycles=tuple(cycle.beside[k] for cycle in self.cycles),
                traces=(),
                history=(),
            )
            for k, points in enumerate(self._points_beside())
        ]

    def _points_beside(self) -> list[dict[str, Any]]:
        each = zip(*(found.beside for found in self.points.values()), strict=False)
        return [dict(zip(self.points, found, strict=True)) for found in each]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cycle:
    """A cycle of repeated stages.

    Attributes
    ----------
    points : (n,) numbers of the points that flow in the cycle, counted over all parts
    accumulated : (n,) equivalent plastic strain accumulated in the cycle
    net : (n,) equivalent of the change of the signed plastic strain
    dissipated : plastic work and work of friction [N mm]; for a closed cycle the area of all loops
        of force over displacement
    before : largest plastic strain accumulated before the cycle
    beside : the same cycle of the neighbouring runs, if there are any
    """

    points: Ints
    accumulated: Array
    net: Array
    dissipated: float
    before: float
    beside: tuple[Cycle, ...] = ()

    @classmethod
    def between(cls, start: Converged, end: Converged) -> Self:
        """Return the cycle between two converged states."""
        both = list(zip(start.state.plastic, end.state.plastic, strict=True))
        more = np.concatenate([new.accumulated - old.accumulated for old, new in both])
        flow = np.hstack([new.plastic_strain - old.plastic_strain for old, new in both])
        points = np.flatnonzero(more)
        terms = (
            getattr(at.energy, name) for at in (start, end) for name in ("plastic", "friction")
        )
        plastic, friction, plastic_after, friction_after = terms
        return cls(
            points=points,
            accumulated=more[points],
            net=np.sqrt(2 / 3 * (flow[:, points] ** 2).sum(axis=0)),
            dissipated=plastic_after + friction_after - plastic - friction,
            before=max(float(old.accumulated.max(initial=0.0)) for old, _ in both),
            beside=tuple(map(cls.between, start.beside, end.beside)),
        )
