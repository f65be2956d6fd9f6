"""The state between two increments, and the results of a converged increment."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from solver.contact.problem import OPEN, STICK
from solver.fem.window import Region
from solver.materials.state import PlasticState, Response
from solver.typing import Array, Bools, Ints


@dataclass(frozen=True, slots=True)
class ContactState:
    """Variables of a contact pair that one increment passes to the next, one per slave vertex.

    Attributes
    ----------
    normal, tangential : (n,) forces [N]; the tangential one acts on the slave, along its tangent
    status : (n,) as in `solver.contact.problem`
    touching : (n,) whether the vertex is in contact, so that its friction has a history
    gap : (n,) [mm]; inf where no master faces the vertex
    rates : (2, n) rates of gap and slip in the last increment [mm]; NaN where not known
    earlier : (3, n) gaps at the beginning of the last increment and of the one before, and slip
        over change of the gap in the latter; NaN unless contact grew in both
    finite : whether the surfaces are paired in their current positions, or always as before loading
    slipped : (3, n) accumulated since the first increment, while in contact: length of slip [mm],
        normal force and friction over it, spread under the hats [N mm]
    """

    normal: Array
    tangential: Array
    status: Ints
    touching: Bools
    gap: Array
    rates: Array
    earlier: Array
    finite: bool
    slipped: Array

    @classmethod
    def at_rest(
        cls,
        gap: Array,
        touching: Bools,
        *,
        finite: bool,
        before: ContactState | None,
    ) -> ContactState:
        """Return the state without forces, in which vertices that touch stick.

        It keeps the accumulated slip of the state ``before``.
        """
        n = len(touching)
        slipped = np.zeros((3, n)) if before is None else before.slipped
        status = np.where(touching, STICK, OPEN)
        rates, earlier = np.full((2, n), np.nan), np.full((3, n), np.nan)
        nothing = np.zeros(n), np.zeros(n)
        return cls(*nothing, status, touching, gap, rates, earlier, finite, slipped)

    def halted(self) -> ContactState:
        """Return the state without rates and earlier gaps: another motion begins."""
        unknown = {name: np.full_like(getattr(self, name), np.nan) for name in ("rates", "earlier")}
        return replace(self, **unknown)


@dataclass(frozen=True, slots=True)
class State:
    """A converged state of the whole system; never changed, only replaced.

    ``time`` is the load factor of loads without an amplitude. ``force_scale`` is the largest force
    level so far, the scale of tolerances [N]. ``links`` are the forces of the conditions of links
    (`solver.contact.links`) [N].
    """

    time: float
    u: tuple[Array, ...]
    plastic: tuple[PlasticState, ...]
    contacts: tuple[ContactState, ...]
    force_scale: float = 0.0
    links: Array = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Energy:
    """Energy at the beginning of a lap, and the work since then [N mm].

    Attributes
    ----------
    stored : elastic energy of the bodies at the beginning
    external : work of loads, of prescribed motions and of heat
    plastic : work of stress on plastic strain, by the mean of stress before and after
    friction : work of friction on slip, positive
    contact : work against contact of points that open or close within an increment, an integration
        error; and the work of contact forces that vanish when bodies are separated
    supplied : sum of the external work of increments in which it is positive: like integration
        errors it grows with every cycle
    scale : largest of these terms so far, at least the rounding level of `System.least`
    """

    stored: float = 0.0
    external: float = 0.0
    plastic: float = 0.0
    friction: float = 0.0
    contact: float = 0.0
    supplied: float = 0.0
    scale: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class BodyState:
    """A whole body in a state, as results and audit see it.

    Attributes
    ----------
    time : time of the state
    u : (n,) displacements node by node, those of a wheel in its hub's frame [mm]
    stress : (n_components, n_points) Mandel stress [MPa]
    strain : (n_components, n_points) Mandel strain: elastic, plastic and thermal
    plastic : internal variables at the points
    """

    time: float
    u: Array
    stress: Array
    strain: Array
    plastic: PlasticState


def _none() -> Array:
    return np.zeros(1)


_LITTLE = 0.01
"""Force of a pair over the largest force of all pairs: the timing of a weaker pair is ignored."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Timing:
    """Resolution of contact in time by the increments; all (n_pairs,) [N].

    Attributes
    ----------
    untimed : uncertain friction, of vertices that touched at unknown times: sum over the increments
        since the pair was last open, limited by ``stuck``
    friction : largest friction that the contact could carry since then
    passed : largest normal force x (distance that the contact moved in an increment / its width)
    normal : largest normal force
    stuck : friction that the sticking vertices can carry; that of slipping vertices is known
    """

    untimed: Array = field(default_factory=_none)
    friction: Array = field(default_factory=_none)
    passed: Array = field(default_factory=_none)
    normal: Array = field(default_factory=_none)
    stuck: Array = field(default_factory=_none)

    @property
    def unknown(self) -> float:
        """Uncertain friction over the largest friction, of the worst pair."""
        return _worst(self.untimed, self.friction)

    @property
    def passage(self) -> float:
        """Motion of a contact in an increment over its width, of the worst pair."""
        return _worst(self.passed, self.normal)

    def beside(self, other: Timing) -> Timing:
        """Return this timing with the larger reference forces of both, pair by pair."""
        friction, normal = (
            np.maximum(getattr(self, name), getattr(other, name)) for name in ("friction", "normal")
        )
        return replace(self, friction=friction, normal=normal)

    def then(self, now: Timing) -> Timing:
        """Return the timing after one more increment."""
        closed = now.normal > 0
        return Timing(
            untimed=np.where(closed, np.minimum(self.untimed, now.stuck) + now.untimed, 0.0),
            friction=np.where(closed, np.maximum(self.friction, now.friction), 0.0),
            passed=np.maximum(self.passed, now.passed),
            normal=np.maximum(self.normal, now.normal),
            stuck=now.stuck,
        )


def _worst(part: Array, whole: Array) -> float:
    """Return the largest ratio of ``part`` to ``whole``, of the pairs whose force counts."""
    part, whole = np.broadcast_arrays(part, whole)
    counts = (whole > 0) & (whole >= _LITTLE * whole.max(initial=0.0))
    return float((part[counts] / whole[counts]).max(initial=0.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Converged:
    """A converged increment, from ``start`` to ``state``.

    Attributes
    ----------
    forces : for each part, forces of loads, supports and prescribed motions on its unknowns; they
        balance the contact forces [N]
    contact_forces : forces of contact and links on the unknowns of each part [N]
    responses : stress and internal variables of each part at its points
    iterations : number of Newton iterations
    plastic_work : plastic work of the increment [N mm]
    dissipation : least dissipation at any point [N mm/mm3]
    contact_work : work of friction, and work against contact, in the increment [N mm]
    pivoted, blended : iterations whose contact problem needed pivoting, or whose tangent was
        blended with the elastic stiffness
    beyond_end : message that contact has reached the end of a surface; empty if it has not
    separated : whether the bodies were separated in the increment
    energy : work since the lap began
    timing : how well contact was resolved in time since then
    added : error of stress by the length of the increment, over the yield stress
    missed : for each part, the remaining sum of these errors since the path began (n_components,
        n_points) [MPa]; None if nothing has flowed
    lost : difference between the beginning of this increment and the end of the previous one
    windows : for each part, the region of the window in which it was solved; None without
    beside : the same increment of the neighbouring runs (`solver.derivatives`), if there are any
    near : of a neighbouring run, the nearest switch since the path began, in differences of its
        parameter: see `solver.derivatives.neighbours`
    """

    start: State
    state: State
    forces: tuple[Array, ...]
    contact_forces: tuple[Array, ...]
    contact_work: tuple[float, float]
    responses: tuple[Response, ...]
    iterations: int
    plastic_work: float
    dissipation: float
    pivoted: int
    blended: int
    beyond_end: str = ""
    separated: bool = False
    energy: Energy = field(default_factory=Energy)
    timing: Timing = field(default_factory=Timing)
    added: float = 0.0
    missed: tuple[Array | None, ...] = ()
    lost: float = 0.0
    windows: tuple[Region | None, ...] = ()
    beside: tuple[Converged, ...] = ()
    near: float = np.inf
