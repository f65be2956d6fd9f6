"""The body that a load passes over, as a steady pass uses it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, Generic, Protocol, Self, TypeVar

import numpy as np

from solver.materials.law import Law
from solver.materials.state import PlasticState
from solver.rolling.flow import Sweep
from solver.typing import Array

LOADED, RELEASED = 0.0, 1.0
"""Times of the states under the load and after it."""


@dataclass(frozen=True, slots=True)
class LeftState(ABC):
    """The state of a body before and after a pass, constant along x; never changed, only replaced.

    Attributes
    ----------
    state : internal variables of the law at n points across
    """

    state: PlasticState

    @property
    def plastic_strain(self) -> Array:
        """Plastic strain (n, n_components), Mandel."""
        return np.ascontiguousarray(self.state.plastic_strain.T)

    @property
    def accumulated(self) -> Array:
        """Accumulated plastic strain (n,)."""
        return self.state.accumulated

    @property
    @abstractmethod
    def mirrored(self) -> Self:
        """The same state, seen along -x."""


S = TypeVar("S", bound=LeftState)


class FlowPast(ABC, Generic[S]):
    """Material that flows past a load along rows of points with given strains.

    Attributes
    ----------
    states : internal variables (..., n_rows, n_columns)
    force : force or eigenstress equivalent to the plastic strain that the pass adds, as the body
        takes it
    """

    force: Array

    def __init__(self, law: Law, begin: S, sweep: Sweep) -> None:
        self._law, self._begin, self._sweep = law, begin, sweep
        self.states = sweep.states

    @property
    def ago(self) -> PlasticState:
        """Internal variables at the beginning of the last increment before each column."""
        return self._sweep.ago

    @property
    def added(self) -> Array:
        """Accumulated plastic strain (n_rows, n_columns) added since the beginning of the rows."""
        return np.asarray(self.states.accumulated - self._begin.accumulated[:, None])

    @property
    def most_added(self) -> float:
        """Largest accumulated plastic strain that the pass adds at a point."""
        return float(self.added.max())

    @property
    def beyond(self) -> str:
        """Side where the window is too small, since points yield there; else empty."""
        return ""

    @abstractmethod
    def along(self, added: Array) -> Array:
        """Return the change of ``force`` for a change of the strains."""

    @abstractmethod
    def left(self) -> tuple[PlasticState, S]:
        """Return internal variables (..., n, n_columns) at the surface, and the state behind."""


class PassedBody(Protocol[S]):
    """An elastic body with rows of points around a load; each kind of body has its own field u."""

    @property
    def weights(self) -> Array:
        """Volume of the points (n_rows, n_columns) [mm3]."""

    @property
    def at_rest(self) -> Any:
        """The field without plastic strain and load."""

    @property
    def rough(self) -> Self:
        """The same body in lower precision, for Newton's equation, which is solved to one digit."""

    def solve(self, force: Array) -> Any:
        """Return the field of a ``force`` of `FlowPast`, without the load."""

    def strain(self, u: Any) -> Array:
        """Return the strains (n_rows, n_columns, n_components) of a field, Mandel."""

    def flow(self, law: Law, before: S, added: Array, parts: int) -> FlowPast[S]:
        """Return the flow of a material along the rows."""
