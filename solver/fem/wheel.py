"""An elastic wheel, condensed to its rim, with finite rotation.

Unknowns are the elastic displacements d of the rim's nodes in the frame of the rigid hub, and the
three unknowns of this `MovingFrame`. The condensed stiffness acts on d only and is constant;
rotation enters through the derivatives of gap and slip. The advance of the axle is prescribed. Its
height is free and balances the vertical force. Rotation is free and balances the moment, or is
prescribed.
"""

from __future__ import annotations

import numpy as np

from solver.fem.discretisation import Discretisation
from solver.fem.loads import Superposed
from solver.fem.nodes import vectors
from solver.fem.part import same_unknowns
from solver.fem.rigid import MovingFrame, RigidMotion, turning
from solver.fem.substructure import Substructure
from solver.fem.surface import Surface
from solver.typing import Array, Ints

_X, _Y, _TURN = range(3)


class Wheel(Substructure):
    """A part whose unknowns are rim displacements in the hub's frame, then (cx, cy, w)."""

    def __init__(self, whole: Discretisation, surfaces: list[Surface], linear_solver: str) -> None:
        super().__init__(whole, surfaces, linear_solver)
        axle = whole.body.axle
        assert axle is not None
        self.frame = MovingFrame(centre=np.asarray(axle.centre, dtype=float), radius=axle.radius)
        self.axle = axle
        self._hub = self.n
        self.n += 3
        self.loads = Superposed.of(self.n, ())
        free = [_Y] if axle.rotation is not None else [_Y, _TURN]
        self.rigid = np.zeros((self.n, len(free)))
        self.rigid[self._hub + np.array(free), np.arange(len(free))] = 1.0
        self.free = np.concatenate([self.free, self._hub + np.array(free)])

    def external(self, time: float, u: Array | None = None) -> Array:
        """Return the external nodal forces (n,) at a time [N]: force and moment on the hub."""
        force = np.zeros(self.n)
        force[self._hub + _Y] = -self.axle.force.at(time)
        if self.axle.rotation is None:
            force[self._hub + _TURN] = self.axle.moment.at(time) / self.frame.radius
        return force

    def grows(self, before: float, after: float) -> bool:
        """Whether the force or the moment on the axle grows from one time to another."""
        loads = (self.axle.force, self.axle.moment)
        return any(abs(load.at(after)) > abs(load.at(before)) for load in loads)

    def motion_of(self, u: Array) -> RigidMotion:
        """Return the motion of the hub."""
        return self.frame.motion(u[self._hub :])

    # -- kinematics ----------------------------------------------------------------------------

    def passing(self, surface: Surface, d: Array) -> Array:
        """Return the derivative (2, n_nodes) of positions by the arc while the rim keeps its shape.

        ``d`` (2, n_nodes) are the displacements of its nodes in the frame of the hub [mm].
        """
        starts, middles = surface.edges[:, :1], surface.edges[:, 2:]
        chain = np.append(np.hstack([starts, middles]), surface.edges[-1, 1])
        arc = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(surface.X[:, chain]), axis=0)))
        out = self.frame.passing(surface.X)
        out[:, chain] += np.gradient(d[:, chain], arc, axis=1)
        return out

    def motion(self, surface: Surface, u: Array) -> Array:
        """Return the displacements (2, n_nodes) of a surface's nodes [mm]."""
        d = vectors(u[surface.dofs], 2)
        return self.frame.displacements(u[self._hub :], surface.X, d)

    def pull_back(self, surface: Surface, u: Array, block: Array, gaps: int) -> tuple[Ints, Array]:
        """Return the unknowns of rim, hub and rotation, and derivative rows on them.

        Rotation moves material along the rim, which keeps its shape (`passing`). In a round elastic
        wheel this needs no work and changes no gap: only friction has a moment, and its lever arm
        is the motion of the material along the rim per angle. If the displacements rotated with the
        wheel, gaps would change too, and pressure would have a moment. In the continuum this moment
        compensates the different lever arm of friction; on a mesh with ten points in contact its
        error is 1e-4 of force times radius, enough to turn a wheel that little friction holds.
        """
        d, q = vectors(u[surface.dofs], 2), u[self._hub :]
        hub = self.frame.rows(q, block, self.passing(surface, d))
        hub[:gaps, _TURN] = 0.0
        rim = block.reshape(-1, 2) @ self.frame.turned(q)
        rows = np.hstack([rim.reshape(block.shape), hub])
        return np.append(surface.dofs, self._hub + np.arange(3)), rows

    def moved(self, u: Array, time: float) -> Array:
        """Return ``u`` with the hub at its position at a time.

        If rotation is free, the wheel rolls there; a prescribed rotation takes its value.
        """
        out = u.copy()
        x, turn = self._hub + _X, self._hub + _TURN
        out[x] = self.axle.position.at(time)
        if self.axle.rotation is None:
            out[turn] -= out[x] - u[x]
        else:
            out[turn] = self.frame.radius * self.axle.rotation.at(time)
        return out

    def way(self, before: float, after: float) -> float:
        """Return the motion of the axle along x between two times [mm]."""
        return self.axle.position.at(after) - self.axle.position.at(before)

    def passed(self, before: Array, after: Array) -> float:
        """Return the motion of the contact along the rim [mm]: 0 if the wheel is locked."""
        turn = self._hub + _TURN
        return float(before[turn] - after[turn])

    def sources(self, way: float) -> Ints:
        """Return for each unknown the one at the arc ``way`` [mm] behind it along the rim, or -1.

        The source of an unknown of the hub is itself. Displacement vectors are not rotated: over an
        element side the rotation is less than the error of a prediction.
        """
        centre = self.frame.centre[:, None]
        places = turning(-way / self.frame.radius) @ (self.nodes - centre) + centre
        rim = same_unknowns(self.nodes, places)
        return np.concatenate([rim, self._hub + np.arange(3)])

    def lowered(self, u: Array, by: float) -> Array:
        """Return ``u`` with the hub lowered by a distance [mm]."""
        out = u.copy()
        out[self._hub + _Y] -= by
        return out

    def start(self) -> Array:
        """Return the unknowns of the undeformed wheel at the beginning of its motion."""
        return self.placed(float(self.axle.position.time[0]))

    def placed(self, time: float) -> Array:
        """Return the unknowns of the undeformed wheel at its position at a time.

        If rotation is free, the wheel has rolled there from its position in the mesh.
        """
        u = np.zeros(self.n)
        u[self._hub + _TURN] = self.frame.radius * self.axle.turned
        return self.moved(u, time)
