"""A body in the frame of the load that passes over it, as results see bodies; its states."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

from solver.contact.state import BodyState
from solver.materials.state import PlasticState
from solver.results.fields import StressCycle
from solver.rolling.passing import Pass
from solver.typing import Array


@dataclass(frozen=True, slots=True)
class PassStage:
    """A state under the load of a pass or after it.

    Attributes
    ----------
    state : the body; its time is `LOADED` or `RELEASED`
    touching : the contact in the frame of the load, or None
    lowest : (n_components,) smallest stress components around the load, None if not known [MPa]
    found : the pass of a state under the load, if its cycle is not all in the state
    """

    state: BodyState
    touching: Any = None
    lowest: Array | None = None
    found: Any = None


class SteadyBody(ABC):
    """The only body of steady passes; see `solver.results.fields.Bodies`.

    Parameters
    ----------
    part : its nodes and points
    n_unknowns : number of displacement unknowns
    """

    def __init__(self, part: Any, n_unknowns: int) -> None:
        self.part, self.n_unknowns = part, n_unknowns
        self.names = (part.body.name,)

    @abstractmethod
    def under_load(self, found: Pass[Any]) -> PassStage:
        """Return the state under the load of a pass."""

    @abstractmethod
    def left_by(self, found: Pass[Any]) -> PassStage:
        """Return the state after a pass."""

    @abstractmethod
    def cycle(self, loaded: PassStage) -> StressCycle:
        """Return what a pass does at the points, along their rows."""

    def full(self, name: str) -> Any:
        """Return the body."""
        return self.part

    def state(self, name: str, converged: PassStage) -> BodyState:
        """Return the state of the body."""
        return converged.state

    def state_of(self, time: float, u: Array, stress: Array, plastic: PlasticState) -> BodyState:
        """Return a state with displacements (n,), stress and internal variables at points."""
        strain = self.part.body.law.elasticity.strain(stress) + plastic.plastic_strain
        return BodyState(time, u, stress, strain, plastic)
