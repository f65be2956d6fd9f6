"""Pressure and shear on the lower body of a run, from contact or prescribed."""

from __future__ import annotations

from typing import Any

import numpy as np

from solver.contact.state import Converged
from solver.contact.system import System
from solver.fem.wheel import Wheel
from solver.model.motion import TravellingPressure
from solver.results.contact_result import ContactResult, contact_result
from solver.results.fields import Remembered, Solved
from solver.results.view import ALONG_X, Axis
from solver.typing import Array


class SurfaceTractions:
    """Pressure and shear on the lower body, whose surface runs along x; here there are none."""

    def along(self, converged: Any, x: Array) -> tuple[Array, Array, Array]:
        """Return pressure, shear along +x [MPa] and gap [mm], each (n,), at positions x (n,) [mm].

        They are NaN beyond the surface, and without contact along a line. The gap is also NaN for
        separated bodies and for a prescribed pressure.
        """
        nowhere = np.full_like(x, np.nan)
        return nowhere, nowhere, nowhere

    def extent(self, converged: Any) -> tuple[float, float]:
        """Return the half-width of the contact [mm] and the peak pressure [MPa]."""
        return np.nan, np.nan

    def force(self, converged: Any) -> float:
        """Return the tangential force along +x [N]."""
        return np.nan

    def centre(self, converged: Any) -> float:
        """Return the position of the load along x [mm]."""
        return 0.0

    def points(self, converged: Any) -> ContactResult | None:
        """Return the result at the vertices of a contact along x; None without contact."""
        return None


class PairTractions(SurfaceTractions):
    """Tractions of the first contact pair of a system along ``axis``.

    ``symmetric`` means that only one half of the contact is computed.
    """

    def __init__(self, system: System, *, symmetric: bool, axis: Axis = ALONG_X) -> None:
        self._system = system
        self._symmetric = symmetric
        self._axis = axis
        self._goes_on = system.interfaces[0].slave_surface.goes_on
        self._points: Remembered[ContactResult] = Remembered()

    def points(self, converged: Converged) -> ContactResult:
        """See `SurfaceTractions`."""
        return self._points.of(
            converged, "", lambda: contact_result(self._system, converged).along(self._axis)
        )

    def along(self, converged: Converged, x: Array) -> tuple[Array, Array, Array]:
        """See `SurfaceTractions`."""
        found = self.points(converged)
        gap = found.gap if found.closed.any() else np.full_like(found.gap, np.nan)

        def sampled(values: Array, beyond: Array) -> Array:
            left, right = beyond
            return np.asarray(np.interp(x, found.s, values, left=left, right=right))

        # beyond the pair pressure is zero if the surface of the body continues
        free = np.where(self._goes_on, 0.0, np.nan)
        chain = self._system.interfaces[0].slave_surface
        first, last = self._axis.reached(chain.X[:, chain.vertices[[0, -1]]])
        free = free if first < last else free[::-1]
        nowhere = np.full(2, np.nan)
        return sampled(found.pressure, free), sampled(found.shear, free), sampled(gap, nowhere)

    def extent(self, converged: Converged) -> tuple[float, float]:
        """See `SurfaceTractions`."""
        found = self.points(converged)
        patches = found.patches
        if not patches:
            return 0.0, float(found.pressure.max())
        start, end = patches[0][0], patches[-1][1]
        return end if self._symmetric else (end - start) / 2, float(found.pressure.max())

    def force(self, converged: Converged) -> float:
        """See `SurfaceTractions`."""
        return -float(converged.state.contacts[0].tangential.sum())

    def centre(self, converged: Converged) -> float:
        """See `SurfaceTractions`."""
        parts = zip(self._system.parts, converged.state.u, strict=True)
        return next(
            (
                part.frame.centre[0] + part.motion_of(u).x
                for part, u in parts
                if isinstance(part, Wheel)
            ),
            0.0,
        )


class PrescribedTractions(SurfaceTractions):
    """A travelling pressure."""

    def __init__(self, travelling: TravellingPressure) -> None:
        self._travelling = travelling

    def along(self, converged: Solved, x: Array) -> tuple[Array, Array, Array]:
        """See `SurfaceTractions`."""
        pressure, ratio = self._travelling.at(converged.state.time, x)
        return pressure, ratio * pressure, np.full_like(x, np.nan)

    def extent(self, converged: Solved) -> tuple[float, float]:
        """See `SurfaceTractions`."""
        share, _, _ = self._travelling.now(converged.state.time)
        return self._travelling.half_width, share * self._travelling.peak

    def force(self, converged: Solved) -> float:
        """See `SurfaceTractions`."""
        _, _, ratio = self._travelling.now(converged.state.time)
        width, peak = self.extent(converged)
        return np.pi / 2 * width * peak * ratio

    def centre(self, converged: Solved) -> float:
        """See `SurfaceTractions`."""
        _, centre, _ = self._travelling.now(converged.state.time)
        return centre


def tractions_of(system: System, *, symmetric: bool, axis: Axis = ALONG_X) -> SurfaceTractions:
    """Return the tractions between the bodies of a system, or on one of them."""
    if system.interfaces:
        return PairTractions(system, symmetric=symmetric, axis=axis)
    for body in system.model.bodies:
        if body.travelling is not None:
            return PrescribedTractions(body.travelling)
    return SurfaceTractions()
