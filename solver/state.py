"""What an increment starts from and what it gives when it has converged."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.contact.complementarity import OPEN, STICK

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.constitutive import PlasticState


@dataclass(frozen=True, slots=True)
class ContactState:
    """What a contact pair carries from one increment to the next, a value a slave vertex.

    ``normal``, ``tangential`` are forces [N], the tangential one on the slave along the
    surface's tangent; ``status`` as in `solver.contact.complementarity`; ``touching`` tells
    whether the vertex had contact, so that its friction has a history. ``approach`` (3, n) is
    the gap [mm], and the rates of gap and slip with the load in the last increment, NaN where
    not known; ``gap`` (n,) is the gap whether near contact or not, inf where nothing faces.
    """

    normal: NDArray[np.float64]
    tangential: NDArray[np.float64]
    status: NDArray[np.int64]
    touching: NDArray[np.bool_]
    approach: NDArray[np.float64]
    gap: NDArray[np.float64]

    @classmethod
    def at_rest(cls, gap: NDArray[np.float64], touching: NDArray[np.bool_]) -> ContactState:
        """Return the state of vertices without forces, those that touch sticking."""
        n = len(touching)
        status = np.where(touching, STICK, OPEN)
        approach = np.stack([gap, np.full(n, np.nan), np.full(n, np.nan)])
        return cls(np.zeros(n), np.zeros(n), status, touching, approach, gap)

    def halted(self) -> ContactState:
        """Return the state where another motion begins: rates so far mean nothing."""
        approach = self.approach.copy()
        approach[1:] = np.nan
        return replace(self, approach=approach)


@dataclass(frozen=True, slots=True)
class State:
    """A converged state of the whole system; never changed, only replaced.

    ``load`` is the load factor, ``force_scale`` the largest force level met so far, to which
    tolerances refer [N].
    """

    load: float
    u: tuple[NDArray[np.float64], ...]
    plastic: tuple[PlasticState, ...]
    contacts: tuple[ContactState, ...]
    force_scale: float = 0.0
