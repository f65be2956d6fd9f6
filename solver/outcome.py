"""How an increment is judged, and how it may end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from solver.errors import SolverError

if TYPE_CHECKING:
    from solver.constitutive import Response
    from solver.state import State

_FLOWING = 0.02


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
    the iterations whose inner problem needed the fallback or a blended tangent.
    """

    state: State
    responses: tuple[Response, ...]
    iterations: int
    elastic: bool
    plastic_work: float
    dissipation: float
    pivoted: int
    blended: int


class Yielded(SolverError):
    """An increment that was to stay elastic did not."""


class IncrementFailed(SolverError):
    """The increment did not converge.

    ``stiffness`` is the least share of the elastic stiffness left along a late step; next to
    nothing means that the structure flows.
    """

    def __init__(self, message: str, stiffness: float) -> None:
        super().__init__(message)
        self.stiffness = stiffness

    @property
    def flowing(self) -> bool:
        """Whether a late step was a plastic mechanism."""
        return self.stiffness < _FLOWING
