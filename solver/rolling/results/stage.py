"""A body in the frame of the load that passes over it, as results see bodies; its states."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np

from solver.contact.state import State
from solver.materials.state import PlasticState, Response
from solver.rolling.passing import Pass
from solver.typing import Array

LOADED, RELEASED = 0.0, 1.0
"""Times of the states under the load and after it."""


@dataclass(frozen=True, slots=True)
class PassStage:
    """A state of the body.

    Attributes
    ----------
    state : displacements and internal variables; its time is `LOADED` or `RELEASED`
    response : stress and internal variables at the points
    touching : the contact in the frame of the load, or None
    lowest : (n_components,) smallest stress components around the load, None if not known [MPa]
    """

    state: State
    response: Response
    touching: Any = None
    lowest: Array | None = None

    @classmethod
    def of(
        cls, time: float, u: Array, stress: Array, plastic: PlasticState, touching: Any = None,
        lowest: Array | None = None,
    ) -> PassStage:  # fmt: skip
        """Return a state with displacements (n,), stress and internal variables at points."""
        n = len(stress)
        response = Response(stress, np.zeros((n, n, 0)), plastic, np.zeros(0, dtype=bool))
        return cls(State(time, (u,), (plastic,), ()), response, touching, lowest)


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

    def full(self, name: str) -> Any:
        """Return the body."""
        return self.part

    def response(self, name: str, converged: PassStage) -> Response:
        """Return stress and internal variables at the points."""
        return converged.response

    def strain(self, name: str, converged: PassStage) -> Array:
        """Return the strain (n_components, n, Mandel) at the points."""
        found = converged.response
        return self.part.body.law.elastic_strain(found.stress) + found.state.plastic_strain

    def displacement(self, name: str, state: State) -> Array:
        """Return the displacements (n,) [mm]."""
        return state.u[0]
