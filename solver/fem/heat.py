"""Temperature-dependent material: heat lowers Young's modulus and the yield stress."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.errors import ModelError
from solver.fem.loads import Superposed
from solver.materials.heated import Heated

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.fem.nodes import Nodes
    from solver.materials import Law

_LEAST = 0.05
"""Least permitted ratio of Young's modulus, and of the yield stress, to its value when cold."""


@dataclass(frozen=True, slots=True)
class Heat:
    """Relative losses (n,) of Young's modulus and of the yield stress at places, times loads."""

    modulus: Superposed
    strength: Superposed

    @classmethod
    def of(cls, part: Nodes, x: NDArray[np.float64]) -> Heat | None:
        """Return the losses that the loads of a body cause at places x (2, n); None if none."""
        both = [(load, load.softening(x)) for load in part.body.every_load]
        lost = [(load, shares) for load, shares in both if shares is not None]
        if not lost:
            return None
        return cls(
            Superposed.of(x.shape[1], ((load, modulus) for load, (modulus, _) in lost)),
            Superposed.of(x.shape[1], ((load, strength) for load, (_, strength) in lost)),
        )

    def law(self, cold: Law, time: float) -> Law:
        """Return the law at a time; the cold law itself while nothing has changed."""
        stiff = _left(self.modulus, "modulus_drop", time)
        strong = self.strong(time)
        unchanged = (stiff == 1).all() and (strong == 1).all()
        return cold if unchanged else Heated(law=cold, stiff=stiff, strong=strong)

    def strong(self, time: float) -> NDArray[np.float64]:
        """Return the ratio (n,) of the yield stress at a time to its value when cold."""
        return _left(self.strength, "yield_drop", time)


def _left(lost: Superposed, name: str, time: float) -> NDArray[np.float64]:
    """Return the remaining ratios at a time, or raise `ModelError` if one is below `_LEAST`."""
    share = 1 - lost.at(time)
    if not share.min() >= _LEAST:
        allowed = f"must be at least {_LEAST:g} at every temperature (time {time:.6g})"
        raise ModelError(f"1 - {name} * rise", round(float(share.min()), 6), allowed)
    return np.asarray(share)
