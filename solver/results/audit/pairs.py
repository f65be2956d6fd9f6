"""Figures of each contact pair, measured on the deformed bodies."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.contact.system import LEAST
from solver.model.friction import ContactPlaces, lines_of
from solver.results.audit.surfaces import Surfaces

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from solver.contact.state import Converged, State
    from solver.contact.system import System
    from solver.model.model import ContactPair
    from solver.results.audit.surfaces import PairState

    Array = NDArray[np.float64]

_PRESSED = 1e-6
"""Ratio of the normal force to the force level, below which a vertex counts as open."""
_GAP = 2e-3
"""Largest gap allowed / elastic approach."""
_OVERLAP = (0.02, 2.5e-3)
"""Largest overlap allowed / elastic approach, and / side of an element; the larger one counts."""
_COARSE = 0.36
"""Largest edge allowed / width of the contact of curved surfaces: three vertices across it, which
tell Hertz's pressure to 4 %."""
_LITTLE = 0.01
"""Ratio of the force to the force level, below which it does not count how well a contact is
resolved."""
_STILL = 1e-3
"""Least slip / elastic approach, in the work that wrong slip is compared with."""


class LeftOut(NamedTuple):
    """What small sliding leaves out, means weighted with the force.

    Attributes
    ----------
    way : motion along the partner [mm]; ``sides`` the same / side of an element, ``length`` the
        same / length of the contact
    off : error of the gap / elastic approach
    x, y : where most of the motion is [mm]
    """

    way: float
    sides: float
    length: float
    off: float
    x: float
    y: float


_LEFT_OUT = LeftOut(way=np.inf, sides=1.0, length=0.01, off=5e-3, x=np.nan, y=np.nan)
"""What it may leave out; of the length of the contact where a surface is curved."""


def untouched(system: System, states: Iterable[Converged]) -> tuple[str, ...]:
    """Return a warning for each pair that touches in none of the states."""
    every = [converged.state for converged in states]
    return tuple(
        f"{_words(pair)} touch at the end of no stage: move them together, or take the pair out"
        for k, pair in enumerate(system.model.contacts)
        if not any(_closed(state, k).any() for state in every)
    )


def _closed(state: State, number: int) -> NDArray[np.bool_]:
    return np.asarray(state.contacts[number].normal > _PRESSED * state.force_scale)


def _words(pair: ContactPair) -> str:
    return f"{'.'.join(pair.slave)} and {'.'.join(pair.master)}"


class AuditedPair:
    """A contact pair in a converged increment.

    Attributes
    ----------
    touching : gaps, slips and nodal forces, from the bodies
    normal, tangential : the contact forces (n,) of the state [N]
    """

    def __init__(self, system: System, number: int, converged: Converged) -> None:
        self._system = system
        self._pair: ContactPair = system.model.contacts[number]
        self._number = number
        contact, self._start = converged.state.contacts[number], converged.start
        self.normal, self.tangential = contact.normal, contact.tangential
        self._state = converged.state
        self._closed = _closed(converged.state, number)
        self.surfaces = Surfaces(system, number, finite=contact.finite)
        self.touching: PairState = self.surfaces.touching(
            converged.state, converged.start, self.normal, self.tangential
        )

    @property
    def bodies(self) -> tuple[str, str]:
        """Names of slave and master body."""
        return self._pair.slave[0], self._pair.master[0]

    @property
    def approach(self) -> float:
        """How far contact presses the bodies into each other elastically [mm].

        The peak pressure over the contact modulus E*, times the width of the contact.
        """
        closed, area = self._closed & (self.touching.area > 0), self.touching.area
        if not closed.any():
            return 0.0
        pressure = float((self.normal[closed] / area[closed]).max())
        return pressure * self._compliance * float(self.touching.edge[closed].sum())

    @property
    def _compliance(self) -> float:
        """One over the contact modulus E* [1/MPa]."""
        moduli = (self._system.model.body(name).material.elasticity for name in self.bodies)
        return sum(1 / elasticity.plane_strain_modulus for elasticity in moduli)

    @property
    def rounding(self) -> float:
        """Gap or slip that is nothing to speak of for the forces that act in the model [mm]."""
        depth = self.touching.area.sum() / self.touching.edge.sum()
        closer = self._state.force_scale * self._compliance / depth if depth else 0.0
        return max(LEAST * closer, self._system.touching)

    @property
    def force(self) -> float:
        """Sum of the normal forces [N]."""
        return float(self.normal[self._closed].sum())

    @property
    def limits(self) -> dict[str, float]:
        """The largest gap and overlap allowed for this pair [mm], and its coarsest contact."""
        edges = self.touching.edge[self._closed] if self._closed.any() else self.touching.edge
        overlap = max(_OVERLAP[0] * self.approach, _OVERLAP[1] * float(edges.mean()))
        return {
            "audit_closed_gap": max(_GAP * self.approach, self.rounding),
            "audit_overlap": max(overlap, self.rounding),
            "audit_contact_resolution": _COARSE,
        }

    @cached_property
    def left_out(self) -> LeftOut | None:
        """What small sliding leaves out; None where nothing slides, or sliding is finite."""
        if self.surfaces.finite or self.force <= 0.0:
            return None
        share = np.where(self._closed, self.normal, 0.0) / self.force
        edge, touching = self.touching.edge, self.touching
        moved = np.abs(np.nan_to_num(touching.way)) * share
        way = float(moved.sum())
        off = float(np.abs(np.nan_to_num(touching.true_gap - touching.gap)) @ share)
        slave = self.surfaces.slave
        x, y = slave.X[:, slave.vertices[moved.argmax()]]
        return LeftOut(
            way=way,
            sides=way / float(edge @ share),
            length=way / float(edge[self._closed].sum()),
            off=off / (self.approach or np.inf),
            x=float(x),
            y=float(y),
        )

    @property
    def outside(self) -> tuple[str, ...]:
        """What small sliding leaves out, where that is more than the side of an element."""
        left_out = self.left_out
        return (self._told(left_out),) if left_out and left_out.sides > _LEFT_OUT.sides else ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """What small sliding leaves out, where that is less and yet matters."""
        left_out = self.left_out
        if not left_out or self.outside:
            return ()
        far = self.surfaces.curved and left_out.length > _LEFT_OUT.length
        return (self._told(left_out),) if far or left_out.off > _LEFT_OUT.off else ()

    def _told(self, left_out: LeftOut) -> str:
        slave, master = (".".join(side) for side in (self._pair.slave, self._pair.master))
        return (
            f"{slave} moved {left_out.way:.2g} mm along {master}, mostly at ({left_out.x:z.4g}, "
            f"{left_out.y:z.4g}): {left_out.sides:.2g} sides of an element, "
            f"{left_out.length:.1%} of the length of contact; gaps differ by {left_out.off:.1%} of "
            "the elastic approach. Small sliding leaves this out: give this pair "
            'sliding = "finite"'
        )

    @cached_property
    def _bound(self) -> Array:
        """The largest tangential forces (n,), under the area and strength found here [N]."""
        places = ContactPlaces(
            n=len(self.normal),
            find_strength=lambda: self.touching.strength,
            find_plastic_strain=lambda: self._system.plastic_strain(self._number, self._start),
            find_slip=lambda: self._start.contacts[self._number].slipped,
        )
        return lines_of(self._pair.law, places).over(self.touching.area).least(self.normal)

    @cached_property
    def figures(self) -> dict[str, float]:
        """The figures of the pair; lengths in mm, forces in N."""
        gap, true = np.nan_to_num(self.touching.gap), np.nan_to_num(self.touching.true_gap)
        pressed = np.where(self._closed, self.normal, 0.0)
        pressed /= max(float(pressed.sum()), 1e-300)
        # mean over the area: at a sharp corner the overlap of the last vertex is mostly distortion
        deep = np.maximum(-np.minimum(gap, true), 0.0) @ self.touching.area
        area = float(self.touching.area[self._closed].sum() or self.touching.area.sum())
        return {
            "audit_overlap": max(float(deep) / (area or 1.0), float(np.abs(true) @ pressed)),
            "audit_closed_gap": float(np.abs(gap) @ pressed),
            "audit_tension": max(0.0, -float(self.normal.min(initial=0.0))),
            "audit_friction_excess": float(
                (np.abs(self.tangential) - self._bound).max(initial=0.0)
            ),
            "audit_slip": self._wrong_slip(),
            "audit_contact_resolution": self._coarseness(),
        }

    def _coarseness(self) -> float:
        """Return the longest edge in a contact of curved surfaces / its width; 0 where flat.

        Where no vertex bears and the bodies overlap, the contact is as wide as their overlap.
        """
        if not self.surfaces.curved:
            return 0.0
        if not self._closed.any():
            deep = self.touching.point_gap < -self.limits["audit_overlap"]
            width = float(self.touching.point_length[deep].sum())
            return float(self.touching.edge.max()) / width if width else 0.0
        little = _LITTLE * self._state.force_scale
        if self.force <= little:
            return 0.0
        return self.surfaces.coarseness(self._state, np.where(self._closed, self.normal, 0.0))

    def _wrong_slip(self) -> float:
        """Return the friction work that is missing in slip / the work it should do.

        Slip is wrong where the shear is below its bound, and where it has the direction of the
        shear: nothing may slip below the bound, and friction opposes slip. Vertices new in contact
        are left out.
        """
        before = self._start.contacts[self._number].touching
        judged = self._closed & before & (self.touching.area > 0)
        bound, slip = self._bound[judged], np.nan_to_num(self.touching.slip[judged])
        least = max(_STILL * self.approach, self.rounding)
        should = float(bound @ np.maximum(np.abs(slip), least))
        if should == 0.0:
            return 0.0
        does = -float(self.tangential[judged] @ slip)
        return (float(bound @ np.abs(slip)) - does) / should
