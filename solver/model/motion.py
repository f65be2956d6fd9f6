"""The axle of a wheel that rolls."""

from __future__ import annotations

from dataclasses import dataclass

from solver.model.amplitude import Amplitude


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
