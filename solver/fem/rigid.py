"""A rigid body as the increments use it: three unknowns, finite rotation; its moving frame.

Its unknowns are those of a `MovingFrame`, whose radius is the distance of the farthest point. A
motion with a force (`Pushed`) is free, a motion with a value (`Moved`) is prescribed.

Its three unknowns q are the displacement c = (x, y) of its centre and the arc w = R x rotation. A
point at X before loading, displaced by d in the frame, is at ``c0 + c + Q(w / R) (X - c0 + d)``.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from scipy import sparse

from solver.fem.loads import Superposed
from solver.fem.part import Part
from solver.fem.surface import Surface
from solver.mesh.rounding import ROUNDED
from solver.model.rigid import Moved, Pushed, RigidBody
from solver.typing import Array, Ints


class RigidPart(Part):
    """A part with the unknowns x, y and the arc of its rotation.

    Parameters
    ----------
    reach : largest distance from its centre to boundaries that it moves by links [mm]
    """

    body: RigidBody

    def __init__(self, body: RigidBody, axisymmetric: bool, reach: float = 0.0) -> None:
        self.body = body
        self.n = 3
        self._axisymmetric = axisymmetric
        centre = np.asarray(body.centre, dtype=float)
        points = [np.asarray(curve.points, dtype=float) for curve in body.surfaces.values()]
        self.nodes = np.hstack([np.zeros((2, 0)), *points])
        self._first = dict(zip(
            body.surfaces, np.cumsum([0, *(p.shape[1] for p in points)]).tolist(), strict=False
        ))  # fmt: skip
        away = np.linalg.norm(self.nodes - centre[:, None], axis=0)
        arm = float(away.max(initial=reach)) or 1.0
        self.frame = MovingFrame(centre=centre, radius=arm)
        # a moment acts as a force at the arm
        scale = np.diag([1.0, 1.0, arm])
        moved = [isinstance(motion, Moved) for motion in body.every_load]
        each = list(zip(body.every_load, moved, np.eye(3), scale, strict=True))
        self.loads = Superposed.of(3, ((m, m.value * e / s.sum()) for m, held, e, s in each
                                       if not held))  # fmt: skip
        self.driven = Superposed.of(3, ((m, m.value * s) for m, held, _, s in each if held))
        self._held = np.array(moved)
        self._locked = np.full(3, np.nan)
        self.free = np.flatnonzero(~self._held)
        self.active = np.zeros(0, dtype=np.int64)
        self.rigid = np.eye(3)[:, self.free]

    def during(self, time: float, u: Array) -> Self:
        """Return the part for an increment from a time and unknowns u, which may be locked."""
        each = self.body.every_load
        stays = np.array([isinstance(m, Pushed) and m.locked <= time for m in each])
        if not stays.any():
            return self
        here = copy(self)
        here._locked = np.where(stays, u, np.nan)
        here.free = self.free[~stays[self.free]]
        here.rigid = np.eye(3)[:, here.free]
        return here

    # -- its surfaces --------------------------------------------------------------------------

    def chain(self, boundary: str, any_shape: bool = False) -> Surface:
        """Return a surface by its name."""
        curve = self.body.surfaces[boundary]
        count = np.asarray(curve.points).shape[1]
        step = 2 if curve.quadratic else 1
        starts = np.arange(0, count - 1, step)
        ends = (starts, starts + step, starts + 1)[: 3 if curve.quadratic else 2]
        nodes = self._first[boundary] + np.arange(count)
        X = self.nodes[:, nodes]
        depth = None if self._axisymmetric else self.body.thickness
        on_axis = (np.abs(X[0, [0, -1]]) < ROUNDED * self.frame.radius) & self._axisymmetric
        start, end = (on and not axis for on, axis in zip(curve.goes_on, on_axis, strict=True))
        return Surface(nodes, np.stack(ends, axis=1), X, depth, (start, end))

    # -- kinematics ----------------------------------------------------------------------------

    def motion_of(self, u: Array) -> RigidMotion:
        """Return the motion of the body."""
        return self.frame.motion(u)

    def linear(self, X: Array) -> Array:
        """Return the displacements (2 n, 3) of places X (2, n) per unknown, for small rotations."""
        x, y = (X - self.frame.centre[:, None]) / self.frame.radius
        one, zero = np.ones_like(x), np.zeros_like(x)
        each = np.array([[one, zero, -y], [zero, one, x]])
        return np.asarray(np.moveaxis(each, -1, 0).reshape(-1, 3))

    def motion(self, surface: Surface, u: Array) -> Array:
        """Return the displacements (2, n_nodes) of a surface's nodes [mm]."""
        return self.frame.displacements(u, surface.X)

    def pull_back(self, surface: Surface, u: Array, block: Array, gaps: int) -> tuple[Ints, Array]:
        """Return the three unknowns and derivative rows (n_rows, 3) on them."""
        return np.arange(3), self.frame.rows(u, block, self.frame.passing(surface.X))

    def moved(self, u: Array, time: float) -> Array:
        """Return ``u`` with prescribed motions at their values at a time."""
        u = np.where(np.isnan(self._locked), u, self._locked)
        return np.where(self._held, self.driven.at(time), u)

    def turn(self, before: float, after: float) -> float:
        """Return the prescribed rotation between two times [rad]; 0 if rotation is free."""
        if not self._held[2]:
            return 0.0
        return float(abs(self.driven.at(after)[2] - self.driven.at(before)[2])) / self.frame.radius

    def start(self) -> Array:
        """Return the unknowns (3,) before any load."""
        return self.moved(np.zeros(3), 0.0)

    def elastic_matrix(self) -> sparse.csr_array:
        """Return the stiffness (3, 3), which is zero."""
        return sparse.csr_array((3, 3))


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

    def within(self, q: Array, X: Array, u: Array) -> Array:
        """Return the displacements (2, n) in the frame of points X displaced by u in space [mm]."""
        from_centre = X + u - (self.centre + q[:2])[:, None]
        return np.asarray(self.turned(q).T @ from_centre - (X - self.centre[:, None]))

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
