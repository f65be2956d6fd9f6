"""The state an increment starts from, and what it gives when it has converged."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.contact.problem import OPEN, STICK

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.materials.state import PlasticState, Response


@dataclass(frozen=True, slots=True)
class ContactState:
    """What a contact pair carries from one increment to the next, one value per slave vertex.

    ``normal``, ``tangential`` are forces [N], the tangential one on the slave along the
    surface's tangent; ``status`` as in `solver.contact.problem`; ``touching`` tells
    whether the vertex had contact, so that its friction has a history. ``approach`` (3, n) is
    the gap of candidates [mm], and the rates of gap and slip over time in the last increment, NaN
    where not known; ``gap`` (n,) is the gap of all vertices, inf where no master faces them.
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
        unknown = np.full(n, np.nan)
        approach = np.stack([np.where(np.isfinite(gap), gap, np.nan), unknown, unknown])
        return cls(np.zeros(n), np.zeros(n), status, touching, approach, gap)

    def halted(self) -> ContactState:
        """Return the state without its rates: another motion begins."""
        approach = self.approach.copy()
        approach[1:] = np.nan
        return replace(self, approach=approach)


@dataclass(frozen=True, slots=True)
class State:
    """A converged state of the whole system; never changed, only replaced.

    ``time`` is the load factor where the pressures of the bodies have no amplitude.
    ``force_scale`` is the largest force level met so far, to which tolerances refer [N].
    """

    time: float
    u: tuple[NDArray[np.float64], ...]
    plastic: tuple[PlasticState, ...]
    contacts: tuple[ContactState, ...]
    force_scale: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Energy:
    """Energy at the beginning of a lap, and the work since then [N mm].

    Attributes
    ----------
    stored : elastic energy of the bodies at the beginning
    external : work of loads, of prescribed motions and of heat
    plastic : work of stress on plastic strain, by the mean of stress before and after
    friction : work of friction on slip, positive
    contact : work against contact where points open or close within an increment: an error of
        integration
    """

    stored: float = 0.0
    external: float = 0.0
    plastic: float = 0.0
    friction: float = 0.0
    contact: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Converged:
    """A converged increment, from ``start`` to ``state``.

    Attributes
    ----------
    forces : on each part, in balance with contact: loads, and the forces of supports and
        prescribed motions [N]
    contact_forces : of contact on the unknowns of each part [N]
    responses : of each part at its points
    iterations : Newton iterations
    plastic_work : of the increment [N mm]
    dissipation : least at a point [N mm/mm3]
    contact_work : work of friction, and against contact, in the increment [N mm]
    pivoted, blended : iterations whose contact problem needed pivoting, or whose tangent was
        blended with the elastic stiffness
    strayed : message that contact has reached the end of a surface; empty if it has not
    energy : work since the lap began
    lost : how far its beginning is from what the increment before has left
    """

    start: State
    state: State
    forces: tuple[NDArray[np.float64], ...]
    contact_forces: tuple[NDArray[np.float64], ...]
    contact_work: tuple[float, float]
    responses: tuple[Response, ...]
    iterations: int
    plastic_work: float
    dissipation: float
    pivoted: int
    blended: int
    strayed: str = ""
    energy: Energy = field(default_factory=Energy)
    lost: float = 0.0
