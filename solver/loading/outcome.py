"""How an increment is judged, and how it may end."""

from __future__ import annotations

from dataclasses import dataclass

from solver.errors import SolverError
from solver.loading.flow import Flow


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerances:
    """When an increment counts as converged.

    Attributes
    ----------
    residual : out-of-balance force over the largest force level met so far
    contact : violation of the contact conditions as a force, over the same level
    iterations : most Newton iterations before the increment is given up
    """

    residual: float = 1e-8
    contact: float = 1e-7
    iterations: int = 40


class Yielded(SolverError):
    """An increment that was to stay elastic did not."""


class IncrementFailed(SolverError):
    """The increment did not converge; ``flow`` is the softest of its late steps."""

    def __init__(self, message: str, flow: Flow | None = None) -> None:
        super().__init__(message)
        self.flow = flow or Flow()
