"""Plastic strain and dissipated work of a cycle of repeated stages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from solver.contact.state import Converged
from solver.typing import Array, Ints


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cycle:
    """A cycle of repeated stages.

    Attributes
    ----------
    points : (n,) numbers of the points that flow in the cycle, counted over all parts
    accumulated : (n,) equivalent plastic strain accumulated in the cycle
    net : (n,) equivalent of the change of the signed plastic strain
    dissipated : plastic work and work of friction [N mm]; for a closed cycle the area of all loops
        of force over displacement
    before : largest plastic strain accumulated before the cycle
    beside : the same cycle of the neighbouring runs, if there are any
    """

    points: Ints
    accumulated: Array
    net: Array
    dissipated: float
    before: float
    beside: tuple[Cycle, ...] = ()

    @classmethod
    def between(cls, start: Converged, end: Converged) -> Self:
        """Return the cycle between two converged states."""
        both = list(zip(start.state.plastic, end.state.plastic, strict=True))
        more = np.concatenate([new.accumulated - old.accumulated for old, new in both])
        flow = np.hstack([new.plastic_strain - old.plastic_strain for old, new in both])
        points = np.flatnonzero(more)
        terms = (
            getattr(at.energy, name) for at in (start, end) for name in ("plastic", "friction")
        )
        plastic, friction, plastic_after, friction_after = terms
        return cls(
            points=points,
            accumulated=more[points],
            net=np.sqrt(2 / 3 * (flow[:, points] ** 2).sum(axis=0)),
            dissipated=plastic_after + friction_after - plastic - friction,
            before=max(float(old.accumulated.max(initial=0.0)) for old, _ in both),
            beside=tuple(map(cls.between, start.beside, end.beside)),
        )
