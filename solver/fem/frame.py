"""A moving frame: the finite motion of rigid bodies and of wheels.

Its three unknowns q are the displacement c = (x, y) of its centre and the arc w = R x rotation. A
point at X before loading, displaced by d in the frame, is at ``c0 + c + Q(w / R) (X - c0 + d)``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from solver.typing import Array


class RigidMotion(NamedTuple):
    """Displacement of the centre along x and y [mm], counter-clockwise rotation [rad]."""

    x: float
    y: float
    rotation: float


def turning(angle: float) -> Array:
    """Return the matrix (2, 2) that rotates vectors by an angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


@dataclass(frozen=True, slots=True, kw_only=True)
class MovingFrame:
    """The frame that moves with a rigid body or with the hub of a wheel.

    Attributes
    ----------
    centre : (2,) c0, the centre of rotation before loading [mm]
    radius : R, arc over rotation [mm]
    """

    centre: Array
    radius: float

    def motion(self, q: Array) -> RigidMotion:
        """Return displacement and rotation for the unknowns (3,)."""
        x, y, arc = (float(value) for value in q)
        return RigidMotion(x, y, arc / self.radius)

    def turned(self, q: Array) -> Array:
        """Return the matrix Q (2, 2) from vectors in the frame to vectors in space."""
        return turning(self.motion(q).rotation)

    def displacements(self, q: Array, X: Array, d: Array | float = 0.0) -> Array:
        """Return the displacements (2, n) of points X, displaced by d in the frame [mm]."""
        from_centre = self.turned(q) @ (X - self.centre[:, None] + d)
        return np.asarray(from_centre + (self.centre + q[:2])[:, None] - X)

    def passing(self, X: Array) -> Array:
        """Return the derivative (2, n) of the positions X by the arc, in the frame."""
        x, y = X - self.centre[:, None]
        return np.stack([-y, x]) / self.radius

    def rows(self, q: Array, block: Array, passing: Array) -> Array:
        """Return derivative rows (m, 3) on the unknowns, from rows (m, 2 n) on displacements.

        ``passing`` (2, n) is the derivative of the positions by the arc, in the frame.
        """
        shifts = np.tile(np.eye(2), (passing.shape[1], 1))
        return np.asarray(block @ np.column_stack([shifts, (self.turned(q) @ passing).T.ravel()]))

    def swinging(self, q: Array, X: Array) -> Array:
        """Return the second derivative (2 n,) of places X (2, n) by the arc [1/mm]."""
        turned = self.turned(q) @ (self.centre[:, None] - X)
        return np.asarray(turned.T.ravel() / self.radius**2)
