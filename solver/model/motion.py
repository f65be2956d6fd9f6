"""Moving loads: the axle of a wheel, and a travelling pressure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from solver.model.amplitude import Amplitude
from solver.typing import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Axle:
    """Makes an elastic body a wheel that rotates about ``centre``.

    Attributes
    ----------
    centre : (x, y) of the hub in the mesh [mm]
    radius : radius of the rim [mm]
    force : vertical force on the axle, positive downwards [N]
    moment : moment on the axle, positive counter-clockwise [N mm]
    position : displacement of the axle along x from its place in the mesh [mm]
    rotation : prescribed rotation of the hub, instead of the moment [rad]
    turned : rotation at the start, so that the fine part of the rim reaches the track [rad]
    """

    centre: tuple[float, float]
    radius: float
    force: Amplitude
    moment: Amplitude
    position: Amplitude
    rotation: Amplitude | None = None
    turned: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TravellingPressure:
    """A Hertz pressure with proportional shear that moves along a boundary facing upwards.

    Attributes
    ----------
    boundary : name of the boundary
    half_width, peak : a [mm] and p0 [MPa]
    amplitude : factor of the pressure
    position : position of its centre along x [mm]
    shear_ratio : ratio of the shear along +x to the pressure
    """

    boundary: str
    half_width: float
    peak: float
    amplitude: Amplitude
    position: Amplitude
    shear_ratio: Amplitude

    def now(self, time: float) -> tuple[float, float, float]:
        """Return the factor of the pressure, its centre [mm] and the shear ratio at a time."""
        return self.amplitude.at(time), self.position.at(time), self.shear_ratio.at(time)

    def at(self, time: float, x: Array) -> tuple[Array, float]:
        """Return the pressure at positions x [MPa] and the ratio of shear to it."""
        amplitude, centre, ratio = self.now(time)
        inside = 1 - ((x - centre) / self.half_width) ** 2
        return amplitude * self.peak * np.sqrt(np.maximum(inside, 0.0)), ratio

    def pushing(self, time: float) -> Callable[[Array, Array], Array]:
        """Return its traction at a time, as a function like `solver.model.loads.Load.push`."""

        def push(x: Array, along: Array) -> Array:
            pressure, ratio = self.at(time, x[0])
            return pressure * (np.stack([-along[1], along[0]]) - ratio * along)

        return push
