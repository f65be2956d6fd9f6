"""Where the work of the loads goes: stored, dissipated by flow, rubbed away.

Each term is integrated by the trapezoidal rule over increments. Virtual work then makes

    external work = change of stored energy + plastic work + work of friction and against contact

exact where contact keeps its directions (small sliding); where these turn, what is missing is the
error of the path.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.outcome import Converged
    from solver.system import Part


@dataclass(frozen=True, slots=True, kw_only=True)
class Energy:
    """Work along a path [N mm].

    Attributes
    ----------
    stored : elastic energy of the bodies where the path began
    external : of loads, and of what holds a body that is moved
    plastic : of stress on plastic strain, by the mean of its stress before and after
    friction : of friction on slip, positive
    contact : against contact where points open or close in an increment: an error of the path
    """

    stored: float = 0.0
    external: float = 0.0
    plastic: float = 0.0
    friction: float = 0.0
    contact: float = 0.0

    def after(self, parts: Sequence[Part], before: Converged, now: Converged) -> Energy:
        """Return the work when an increment has gone from ``before`` to ``now``."""
        moves = zip(before.state.u, now.state.u, before.forces, now.forces, strict=True)
        work = sum(float((f0 + f1) @ (u1 - u0)) / 2 for u0, u1, f0, f1 in moves)
        return Energy(
            stored=self.stored,
            external=self.external + work,
            plastic=self.plastic + _plastic_work(parts, before, now),
            friction=self.friction + now.contact_work[0],
            contact=self.contact + now.contact_work[1],
        )


def _plastic_work(parts: Sequence[Part], before: Converged, now: Converged) -> float:
    each = zip(parts, now.start.plastic, before.responses, now.responses, strict=True)
    work = 0.0
    for part, plastic, old, new in each:
        flow = new.state.plastic_strain - plastic.plastic_strain
        if flow.any():
            work += float(((old.stress + new.stress) * flow).sum(axis=0) @ part.volumes) / 2
    return work
