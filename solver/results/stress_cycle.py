"""What a cycle of a run does at points: stress, strain, and the plastic strain that it adds."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol, runtime_checkable

from solver.typing import Array, Ints


class StressCycle(NamedTuple):
    """Different cycles of the points of a body.

    Attributes
    ----------
    stress, strain : (n, n_instants, n_components), tensor components; NaN where not known
    grown : (n,) plastic strain that the cycle accumulates
    net : (n,) equivalent of the signed plastic strain that it leaves
    of : (n_points,) the cycle of each point
    """

    stress: Array
    strain: Array
    grown: Array
    net: Array
    of: Ints


@runtime_checkable
class Passed(Protocol):
    """A body of which one state under the load is a whole cycle."""

    def cycle(self, loaded: Any) -> StressCycle:
        """Return the cycle of a pass."""
