"""An elastic wheel: its rim condensed, its rotation finite.

Unknowns are the elastic displacements d of the rim's nodes in the frame of the hub, the
displacement (cx, cy) of the hub and the arc w = R * rotation. A rim node is at
``c0 + c + Q(w / R) (X - c0 + d)``; the hub is rigid. The condensed stiffness acts on d alone and
never changes; rotation enters through the contact rows only. The axle's advance is prescribed;
its height is free and balances the vertical force; rotation is free and balances the moment, or
is prescribed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.fem.operators import Dense, Fixed
from solver.fem.substructure import Substructure

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.fem.discretisation import Discretisation
    from solver.fem.surface import Surface
    from solver.materials import Response


class Wheel(Substructure):
    """A part whose unknowns are rim displacements in the hub's frame, then (cx, cy, w)."""

    def __init__(self, whole: Discretisation, surfaces: list[Surface], linear_solver: str) -> None:
        super().__init__(whole, surfaces, linear_solver)
        axle = whole.body.axle
        assert axle is not None
        self.centre = np.asarray(axle.centre, dtype=float)
        self.radius = axle.radius
        self.turned = axle.turned
        self.program = program = axle.program
        self.rim = self.n
        self.n = self.rim + 3
        self.load = np.zeros(self.n)
        moving = [1] if program.rotation is not None else [1, 2]
        self.rigid = np.zeros((self.n, len(moving)))
        self.rigid[self.rim + np.array(moving), np.arange(len(moving))] = 1.0
        self.free = np.concatenate([self.free, self.rim + np.array(moving)])

    def operators(self, surfaces: list[Surface], linear_solver: str) -> Fixed:
        """Return the one operator of the rim; the hub has no stiffness."""
        del surfaces, linear_solver
        S = self._condensed.stiffness[np.ix_(self.active, self.active)]
        return Fixed(Dense(S, self.active, self.n))

    def external(self, load: float) -> NDArray[np.float64]:
        """Return the force and moment on the hub at a time."""
        force = np.zeros(self.n)
        force[self.rim + 1] = -self.program.at(load, "force")
        if self.program.rotation is None:
            force[self.rim + 2] = self.program.at(load, "moment") / self.radius
        return force

    def grows(self, before: float, after: float) -> bool:
        """Whether force or moment on the axle grow from one time to another."""
        return any(
            abs(self.program.at(after, name)) > abs(self.program.at(before, name))
            for name in ("force", "moment")
        )

    def residual(
        self, load: float, u: NDArray[np.float64], response: Response
    ) -> NDArray[np.float64]:
        """Return external minus internal forces (n,) [N]."""
        del response
        force = self.external(load)
        force[: self.rim] -= self._condensed.stiffness @ u[: self.rim]
        return force

    def stiffness_along(self, step: NDArray[np.float64], response: Response) -> tuple[float, float]:
        """Return the quadratic form of a step twice [N mm]."""
        del response
        energy = float(step[: self.rim] @ self._condensed.stiffness @ step[: self.rim])
        return energy, energy

    def expand(self, u: NDArray[np.float64], load: float) -> NDArray[np.float64]:
        """Return the elastic displacements of the whole wheel in the hub's frame [mm]."""
        return super().expand(u[: self.rim], 0.0)

    # -- kinematics ----------------------------------------------------------------------------

    def _frame(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the rotation matrix."""
        angle = u[self.rim + 2] / self.radius
        c, s = np.cos(angle), np.sin(angle)
        return np.array([[c, -s], [s, c]])

    def _passing(self, surface: Surface, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far material moves along a rim of constant shape for an arc (2, n_nodes)."""
        x, y = surface.X - self.centre[:, None]
        starts, middles = surface.edges[:, :1], surface.edges[:, 2:]
        chain = np.append(np.hstack([starts, middles]), surface.edges[-1, 1])
        arc = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(surface.X[:, chain]), axis=0)))
        d = u[surface.dofs].reshape(-1, 2).T
        out = np.stack([-y, x]) / self.radius
        out[:, chain] += np.gradient(d[:, chain], arc, axis=1)
        return out

    def motion(self, surface: Surface, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the displacements (2, n_nodes) of a surface's nodes [mm]."""
        Q = self._frame(u)
        hub = u[self.rim : self.rim + 2, None]
        d = u[surface.dofs].reshape(-1, 2).T
        return Q @ (surface.X - self.centre[:, None] + d) + self.centre[:, None] + hub - surface.X

    def pull_back(
        self, surface: Surface, u: NDArray[np.float64], block: NDArray[np.float64], gaps: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return rows on rim, hub and rotation from rows on a surface's displacements.

        The rotation turns the wheel under the shape that its rim has. That takes no work from
        a round elastic wheel, and changes no gap: moment comes from friction alone, on the arm
        with which material passes. Turned with the displacements it has, the wheel changes gaps
        as well, and pressure gets a moment: in the continuum what makes up for the other arm,
        on a mesh of ten points of contact 1e-4 of force times radius more or less, which would
        turn a wheel that less friction holds.
        """
        Q = self._frame(u)
        nodal = block.reshape(len(block), block.shape[1] // 2, 2)
        turning = (nodal * (Q @ self._passing(surface, u)).T).sum(axis=(1, 2))
        turning[:gaps] = 0.0
        hub = nodal.sum(axis=1)
        rows = np.hstack([(nodal @ Q).reshape(block.shape), hub, turning[:, None]])
        return np.append(surface.dofs, self.rim + np.arange(3)), rows

    def moved(self, u: NDArray[np.float64], time: float) -> NDArray[np.float64]:
        """Return ``u`` with the hub where it has to be at a time, rolling along with it."""
        out = u.copy()
        out[self.rim] = self.program.at(time, "advance")
        if self.program.rotation is None:
            out[self.rim + 2] -= out[self.rim] - u[self.rim]
        else:
            out[self.rim + 2] = self.radius * self.program.at(time, "rotation")
        return out

    def start(self) -> NDArray[np.float64]:
        """Return the wheel where the first pass begins."""
        return self.placed(float(self.program.time[0]))

    def placed(self, time: float) -> NDArray[np.float64]:
        """Return the undeformed wheel where the program wants it.

        A wheel free to turn stands as if it had rolled there from where it was meshed.
        """
        u = np.zeros(self.n)
        u[self.rim + 2] = self.radius * self.turned
        return self.moved(u, time)
