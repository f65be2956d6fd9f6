"""What a steady pass asks of the body that a load passes over."""

from __future__ import annotations

from typing import Any, Protocol, Self, TypeVar

from solver.materials.law import Law
from solver.materials.state import PlasticState
from solver.typing import Array


class LeftState(Protocol):
    """The state of a body before and after a pass, constant along x."""

    @property
    def accumulated(self) -> Array:
        """Accumulated plastic strain (n_rows,)."""

    @property
    def mirrored(self) -> Self:
        """The same state, seen along -x."""


S = TypeVar("S", bound=LeftState)
S_co = TypeVar("S_co", bound=LeftState, covariant=True)


class FlowPast(Protocol[S_co]):
    """Material that flows past a load with given strains; see `solver.rolling.flow.RowFlow`."""

    @property
    def force(self) -> Array:
        """What balances the plastic strain that the pass adds, as the body solves for it."""

    @property
    def states(self) -> PlasticState:
        """Internal variables (..., n_rows, n_columns)."""

    @property
    def ago(self) -> PlasticState:
        """Internal variables at the beginning of the last increment before each column."""

    @property
    def most_added(self) -> float:
        """Largest accumulated plastic strain that the pass adds at a point."""

    @property
    def beyond(self) -> str:
        """Where the window is too small; empty if nowhere."""

    def along(self, added: Array) -> Array:
        """Return the change of ``force`` for a change of the strains."""

    def left(self) -> tuple[PlasticState, S_co]:
        """Return internal variables (..., n, n_columns) at the surface, and the state behind."""


class PassedBody(Protocol[S]):
    """An elastic body with rows of points around a load; each kind has its own kind of field u."""

    @property
    def weights(self) -> Array:
        """Volume of the points (n_rows, n_columns) [mm3]."""

    @property
    def at_rest(self) -> Any:
        """The field without plastic strain and load."""

    @property
    def rough(self) -> Self:
        """The same body with fewer digits, for Newton's equation, which is solved to one."""

    def solve(self, force: Array) -> Any:
        """Return the field of a ``force`` of `FlowPast`, without the load."""

    def strain(self, u: Any) -> Array:
        """Return the strains (n_rows, n_columns, n_components) of a field, Mandel."""

    def flow(self, law: Law, before: S, added: Array, parts: int) -> FlowPast[S]:
        """Return the flow of a material along the rows."""
