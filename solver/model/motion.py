"""What drives a body in time: a wheel's axle, or a pressure that travels.

Time orders events; a program is piecewise linear between its knots.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class AxleProgram:
    """Knots of a wheel's controls.

    Attributes
    ----------
    time : (n,) not decreasing
    force : (n,) vertical force on the axle, positive when pressing down [N]
    moment : (n,) moment on the axle, positive counter-clockwise [N mm]
    advance : (n,) position of the axle along x from where it was meshed [mm]
    rotation : (n,) rotation of the hub, when it is prescribed instead of the moment [rad]
    """

    time: NDArray[np.float64]
    force: NDArray[np.float64]
    moment: NDArray[np.float64]
    advance: NDArray[np.float64]
    rotation: NDArray[np.float64] | None = None

    def at(self, time: float, name: str) -> float:
        """Return the value of a control at a time."""
        return float(np.interp(time, self.time, getattr(self, name)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Axle:
    """Makes an elastic body a wheel that turns about ``centre``.

    Attributes
    ----------
    centre : (x, y) of the hub where the body is meshed [mm]
    radius : of the rim [mm]; moments act as force at this radius
    program : what the axle does in time
    turned : rotation at the start that brings the meshed rim to the track [rad]
    """

    centre: tuple[float, float]
    radius: float
    program: AxleProgram
    turned: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TravellingPressure:
    """A Hertz pressure with proportional shear, translated along a boundary facing up.

    Attributes
    ----------
    boundary : name of the boundary it acts on
    half_width, peak : a [mm] and p0 [MPa]
    time, amplitude, position, shear_ratio : knots (n,) of what happens in time: share of the
        pressure, position of its centre [mm], shear along +x over pressure
    """

    boundary: str
    half_width: float
    peak: float
    time: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    position: NDArray[np.float64]
    shear_ratio: NDArray[np.float64]

    def now(self, time: float) -> tuple[float, float, float]:
        """Return the share of the pressure, its centre [mm] and the ratio of shear to it."""
        knots = (self.amplitude, self.position, self.shear_ratio)
        amplitude, centre, ratio = (float(np.interp(time, self.time, each)) for each in knots)
        return amplitude, centre, ratio

    def at(
        self, time: float, x: NDArray[np.float64], period: float = 0.0
    ) -> tuple[NDArray[np.float64], float]:
        """Return the pressure at positions x [MPa] and the ratio of shear to it.

        On a periodic body the pressure comes back after each ``period`` [mm].
        """
        amplitude, centre, ratio = self.now(time)
        away = x - centre
        if period:
            away -= period * np.round(away / period)
        inside = 1 - (away / self.half_width) ** 2
        return amplitude * self.peak * np.sqrt(np.maximum(inside, 0.0)), ratio
