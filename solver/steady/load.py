"""What passes over a track, as displacements that may depend on the shape of its surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class AppliedLoad:
    """A load on a track whose m unknowns its operator keeps.

    Attributes
    ----------
    force : (n,) nodal forces, on all nodes of the track [N]
    u : (m,) displacements with it [mm]
    along : their change (m,) for a change of those without it (m,)
    """

    force: Array
    u: Array
    along: Callable[[Array], Array]


class PassingLoad(Protocol):
    """Something that passes over a track along +x."""

    def on(self, u: Array) -> AppliedLoad:
        """Return the load on a track that has these displacements (m,) without it."""

    def scaled(self, share: float) -> PassingLoad:
        """Return the same load with a share of its forces."""

    def driven(self, share: float) -> PassingLoad:
        """Return the same load, driven or braked by a share of its moment."""

    @property
    def moment(self) -> float:
        """Given moment that drives or, if positive, brakes it / radius [N]; 0 where none is."""

    @property
    def slipping(self) -> PassingLoad:
        """The same load, driven or braked by what full slip bears, if a moment does it."""


@dataclass(frozen=True, slots=True)
class Given:
    """Nodal forces (n,) [N] that depend on nothing, and the displacements (m,) they make [mm]."""

    force: Array
    u: Array

    def on(self, u: Array) -> AppliedLoad:
        """See `PassingLoad`."""
        return AppliedLoad(self.force, u + self.u, lambda change: change)

    def scaled(self, share: float) -> Given:
        """See `PassingLoad`."""
        return Given(share * self.force, share * self.u)

    def driven(self, share: float) -> Given:
        """See `PassingLoad`; its shear is no moment."""
        return self

    @property
    def moment(self) -> float:
        """See `PassingLoad`."""
        return 0.0

    @property
    def slipping(self) -> Given:
        """See `PassingLoad`."""
        return self
