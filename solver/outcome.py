"""How an increment is judged, and how it may end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from solver.errors import SolverError
from solver.flow import Flow

if TYPE_CHECKING:
    from solver.constitutive import Response
    from solver.state import State


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Converged:
    """A converged increment.

    ``iterations`` of Newton; ``elastic`` when no point yielded; ``plastic_work`` of the increment
    [N mm] and the least ``dissipation`` at a point [N mm/mm3]; ``pivoted`` and ``blended`` count
    the iterations whose inner problem needed the fallback or a blended tangent; ``strayed`` says
    where contact has come to the end of a surface that goes on, empty where it has not.
    """

    state: State
    responses: tuple[Response, ...]
    iterations: int
    elastic: bool
    plastic_work: float
    dissipation: float
    pivoted: int
    blended: int
    strayed: str = ""


class Yielded(SolverError):
    """An increment that was to stay elastic did not."""


class IncrementFailed(SolverError):
    """The increment did not converge; ``flow`` is the softest of its late steps."""

    def __init__(self, message: str, flow: Flow | None = None) -> None:
        super().__init__(message)
        self.flow = flow or Flow()
