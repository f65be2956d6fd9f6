"""Loss of stiffness and strength, by heat and by removal of elements.

The removal of an element lowers its stiffness gradually. The forces on its neighbours so decrease
to zero along a path with an equilibrium at every point, and their work is known. The share `_GHOST`
of the stiffness remains: the nodes follow, and the equations keep their form. The yield stress is
constant, so that the element does not yield meanwhile.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.errors import ModelError
from solver.fem.loads import Superposed
from solver.fem.nodes import Nodes
from solver.materials import Law
from solver.materials.heated import Heated
from solver.typing import Array, Bools, Ints

_LEAST = 0.05
"""Young's modulus, and yield stress, over its cold value: least permitted ratio."""
_GHOST = 1e-7
"""Stiffness of a removed element over its value before."""


@dataclass(frozen=True, slots=True)
class Softening:
    """Relative losses (n,) of Young's modulus and yield stress at places, by load.

    ``removed`` is 1 in the elements that a load removes.
    """

    modulus: Superposed
    strength: Superposed
    removed: Superposed

    @classmethod
    def of(cls, part: Nodes, x: Array, elements: Ints | None = None) -> Softening | None:
        """Return the losses that the loads of a body cause at places x (2, n); None without any.

        ``elements`` (n,) are the elements of the places; without them nothing is removed.
        """
        body, n = part.body, x.shape[1]
        both = [(load, load.softening(x)) for load in body.every_load]
        lost = [(load, shares) for load, shares in both if shares is not None]
        gone = [
            (load, np.isin(elements, body.region(load.removes)).astype(float))
            for load in body.every_load
            if load.removes and elements is not None
        ]
        if not (lost or gone):
            return None
        return cls(
            Superposed.of(n, ((load, modulus) for load, (modulus, _) in lost)),
            Superposed.of(n, ((load, strength) for load, (_, strength) in lost)),
            Superposed.of(n, gone),
        )

    def law(self, cold: Law, time: float) -> Law:
        """Return the law at a time; the cold law itself while nothing has changed."""
        present = 1 - (1 - _GHOST) * np.minimum(self.removed.at(time), 1.0)
        stiff = present * _remaining(self.modulus, "modulus_drop", time)
        strong = self.strong(time)
        unchanged = (stiff == 1).all() and (strong == 1).all()
        return cold if unchanged else Heated(law=cold, stiff=stiff, strong=strong)

    def gone(self, time: float) -> Bools:
        """Return whether elements at the places (n,) are removed at a time."""
        return np.asarray(self.removed.at(time) >= 1)

    def strong(self, time: float) -> Array:
        """Return the ratio (n,) of the yield stress at a time to its cold value."""
        return _remaining(self.strength, "yield_drop", time)


def _remaining(lost: Superposed, name: str, time: float) -> Array:
    """Return the remaining ratios at a time; raise `ModelError` if one is below `_LEAST`."""
    share = 1 - lost.at(time)
    if not share.min() >= _LEAST:
        allowed = f"must be at least {_LEAST:g} at every temperature (time {time:.6g})"
        raise ModelError(f"1 - {name} * rise", round(float(share.min()), 6), allowed)
    return np.asarray(share)
