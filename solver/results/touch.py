"""Pressure and shear on the lower body of a run: of contact, or prescribed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from solver.contact.pressure import contact_pressure
from solver.contact.problem import STICK
from solver.fem.wheel import Wheel
from solver.results.view import ALONG_X, Axis

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.contact.state import Converged
    from solver.contact.system import System
    from solver.model.motion import TravellingPressure
    from solver.results.samples import Solved

    Array = NDArray[np.float64]


class Touch(Protocol):
    """Pressure and shear on the lower body, whose surface runs along x."""

    def along(self, converged: Any, x: Array) -> tuple[Array, Array, Array]:
        """Return pressure, shear along +x [MPa] and gap [mm] at positions x (n,).

        NaN beyond the surface. The gap is NaN also for bodies taken apart and for a prescribed
        pressure.
        """

    def extent(self, converged: Any) -> tuple[float, float]:
        """Return the half-width of the contact [mm] and the peak pressure [MPa]."""

    def force(self, converged: Any) -> float:
        """Return the tangential force along +x [N]."""

    def centre(self, converged: Any) -> float:
        """Return where the load is along x [mm]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactPoints:
    """What acts at the contact points of a surface, in the order of x; arrays (n,).

    Attributes
    ----------
    x : position along the surface before loading [mm]
    pressure, shear : [MPa], shear that on the lower body along +s
    closed : whether the bodies touch there
    sticking : whether they touch without slip; nowhere without friction
    """

    x: Array
    pressure: Array
    shear: Array
    closed: NDArray[np.bool_]
    sticking: NDArray[np.bool_]


class SceneContact:
    """The first interface of a system.

    In every scene s grows against the tangent of the slave, along ``axis``. ``symmetric`` means
    that the other half of the contact is not computed.
    """

    def __init__(self, system: System, *, symmetric: bool, axis: Axis = ALONG_X) -> None:
        self._system = system
        self._symmetric = symmetric
        self._interface = system.interfaces[0]
        chain = self._interface.slave_surface
        self._x = axis.reached(chain.X[:, chain.vertices])

    def points(self, converged: Converged) -> ContactPoints:
        """Return what acts at the vertices of the slave."""
        contact, order = converged.state.contacts[0], np.argsort(self._x)
        pressure, shear = contact_pressure(self._system, converged.state, 0)
        closed = contact.normal > 0
        stuck = closed & (contact.status == STICK) & self._interface.rough
        return ContactPoints(
            x=self._x[order],
            pressure=pressure[order],
            shear=-shear[order],
            closed=closed[order],
            sticking=stuck[order],
        )

    def along(self, converged: Converged, x: Array) -> tuple[Array, Array, Array]:
        """See `Touch`."""
        state, order = converged.state, np.argsort(self._x)
        pressure, shear = contact_pressure(self._system, state, 0)
        gap = self._interface.pairing(state.u, state.time, finite=state.contacts[0].finite).gap
        known = np.isfinite(gap) & state.contacts[0].normal.any()
        gap = np.where(known, gap, np.nan)

        def sampled(values: Array, beyond: Array) -> Array:
            left, right = beyond
            found = np.interp(x, self._x[order], values[order], left=left, right=right)
            return np.asarray(found)

        # zero pressure beyond the surface of the pair, where the surface of the body goes on
        free = np.where(self._interface.slave_surface.goes_on, 0.0, np.nan)
        free = free if self._x[0] < self._x[-1] else free[::-1]
        nowhere = np.full(2, np.nan)
        return sampled(pressure, free), sampled(-shear, free), sampled(gap, nowhere)

    def extent(self, converged: Converged) -> tuple[float, float]:
        """See `Touch`."""
        pressure, _ = contact_pressure(self._system, converged.state, 0)
        x = self._x[converged.state.contacts[0].normal > 0]
        width = float(x.max() if self._symmetric else np.ptp(x) / 2) if len(x) else 0.0
        return width, float(pressure.max())

    def force(self, converged: Converged) -> float:
        """See `Touch`."""
        return -float(converged.state.contacts[0].tangential.sum())

    def centre(self, converged: Converged) -> float:
        """See `Touch`."""
        parts = zip(self._system.parts, converged.state.u, strict=True)
        return next(
            (part.centre[0] + part.hub(u).x for part, u in parts if isinstance(part, Wheel)), 0.0
        )


class Prescribed:
    """A travelling pressure; its surface repeats itself after ``period``, unless that is 0."""

    def __init__(self, travelling: TravellingPressure, period: float) -> None:
        self._travelling = travelling
        self._period = period

    def along(self, converged: Solved, x: Array) -> tuple[Array, Array, Array]:
        """See `Touch`."""
        pressure, ratio = self._travelling.at(converged.state.time, x, self._period)
        return pressure, ratio * pressure, np.full_like(x, np.nan)

    def extent(self, converged: Solved) -> tuple[float, float]:
        """See `Touch`."""
        share, _, _ = self._travelling.now(converged.state.time)
        return self._travelling.half_width, share * self._travelling.peak

    def force(self, converged: Solved) -> float:
        """See `Touch`."""
        _, _, ratio = self._travelling.now(converged.state.time)
        width, peak = self.extent(converged)
        return np.pi / 2 * width * peak * ratio

    def centre(self, converged: Solved) -> float:
        """See `Touch`."""
        _, centre, _ = self._travelling.now(converged.state.time)
        return centre


class Nothing:
    """No contact and no travelling pressure: such a scene lists no output of contact."""

    def along(self, converged: Solved, x: Array) -> tuple[Array, Array, Array]:
        """See `Touch`."""
        nowhere = np.full_like(x, np.nan)
        return nowhere, nowhere, nowhere

    def extent(self, converged: Solved) -> tuple[float, float]:
        """See `Touch`."""
        return np.nan, np.nan

    def force(self, converged: Solved) -> float:
        """See `Touch`."""
        return np.nan

    def centre(self, converged: Solved) -> float:
        """See `Touch`."""
        return 0.0


def touch_of(system: System, *, symmetric: bool, axis: Axis = ALONG_X) -> Touch:
    """Return what acts between the bodies of a system, or on one of them."""
    if system.interfaces:
        return SceneContact(system, symmetric=symmetric, axis=axis)
    for body in system.model.bodies:
        if body.travelling is not None:
            return Prescribed(body.travelling, system.full(body.name).period)
    return Nothing()


def contact_points(touch: Touch, converged: Any) -> ContactPoints | None:
    """Return what acts at the points of a contact; None where pressure does not come of contact."""
    return touch.points(converged) if isinstance(touch, SceneContact) else None
