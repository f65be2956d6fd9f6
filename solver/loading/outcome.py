"""How an increment may fail, and what comes of a program."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.errors import NotConverged, SolverError
from solver.loading.flow import Flow

if TYPE_CHECKING:
    from collections.abc import Mapping

    from solver.contact.state import Converged, State


class Yielded(SolverError):
    """An increment that was to stay elastic did not."""


class IncrementFailed(SolverError):
    """The increment did not converge; ``flow`` is the softest of its late steps."""

    def __init__(self, message: str, flow: Flow | None = None) -> None:
        super().__init__(message)
        self.flow = flow or Flow()


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


class PathEnded(Exception):
    """A path has come to its end: why, and its last point."""

    def __init__(self, error: NotConverged, point: Point) -> None:
        super().__init__(str(error))
        self.error = error
        self.point = point


@dataclass(frozen=True, slots=True, kw_only=True)
class Settled:
    """How finely a program was walked in the end.

    Attributes
    ----------
    times : increments in place of one
    error : estimated error that these leave, in the unit of what was measured; NaN where unknown
    failed : increments in place of one that failed, 0 where none did
    """

    times: int = 1
    error: float = np.nan
    failed: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What came of a program.

    Attributes
    ----------
    tally : what it cost
    last : the last state reached
    points : states at the ends of the stages of the last lap, by name
    traces : what was taken of each lap that came to its end
    error : why the path ended before its program did
    settled : how finely it was walked
    """

    tally: Tally
    last: Converged
    points: Mapping[str, Converged] = field(default_factory=dict)
    traces: tuple[Any, ...] = ()
    error: NotConverged | None = None
    settled: Settled = field(default_factory=Settled)
