"""An elastic wheel that rolls on a track, in the frame of its axle.

Material of both bodies flows upstream to downstream through the contact, in which nothing changes.
The *slip* of a contact point is the relative displacement of the two materials while the axle
advances by one element h: with the tangential row T of the point, its displacement fields u, and S
the shift of a field by one element upstream,

    slip = T (u - S u) of track and wheel + rigid rolling
           + h * creepage * T (motion of the rim's material per arc)

Gap and slip depend linearly on the contact forces through the compliances of the two surfaces. The
result is the frictional problem of `solver.contact.problem`, with a compliance that is not
symmetric.

J.J. Kalker, Three-Dimensional Elastic Bodies in Rolling Contact (1990), section 4.2.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from solver.contact.complementarity import change_of, solve_contact
from solver.contact.geometry import pair
from solver.contact.problem import OPEN, ContactProblem, ContactSolution
from solver.errors import NoContact, NotConverged, WindowTooSmall
from solver.model.friction import FrictionLaw, pressure_lines
from solver.rolling.plane.rim import Rim, flowed
from solver.rolling.plane.touching import RollingContact
from solver.rolling.plane.track import Track
from solver.typing import Array, Ints

_ROUNDS = 40
_NEAR = 0.01
"""Ratio of the expected change of a contact force to the load; up to it the expected contact is the
initial guess."""
_COVERED = 0.999
"""Share of a vertex's hat that must face the rim; below it the vertex is no contact point."""
_SETTLED = 1e-7
"""Ratio of the change of contact forces to the load; below it the contact geometry converged."""


@dataclass(frozen=True, slots=True)
class _Linearisation:
    """An approximate contact, about which the next contact problem is linearised.

    ``on_track`` and ``on_wheel`` are nodal forces on the surfaces, ``tilt`` is the vertical
    component of the tangential forces on the wheel.
    """

    on_track: Array
    on_wheel: Array
    height: float
    tilt: float
    status: Ints


@dataclass(frozen=True, slots=True)
class _Geometry:
    """Gaps and slips of the contact points ``at``, linear in displacements.

    ``gap`` (n,) is that without displacements; ``creeping`` (n,) is the tangential motion of the
    rim's material per arc. For track and wheel, ``rows`` are the derivatives (2n, n_unknowns) of
    gaps and tangential displacements, ``moves`` those of gaps and slips.
    """

    at: Ints
    area: Array
    gap: Array
    creeping: Array
    rows: list[Array]
    moves: list[Array]


class RollingWheel:
    """A wheel pressed on a track.

    Parameters
    ----------
    track : the track on which it rolls
    rim : the part of the wheel that may touch the track
    friction : friction law; it must not depend on slip or plastic strain here
    strength : initial shear yield stress of the track [MPa]
    force : vertical force on the axle [N]
    drive : moment on the axle over radius, positive when braking [N]; None if `creepage` is given
    creepage : 1 + R d(rotation) / d(advance)
    """

    def __init__(
        self,
        track: Track,
        rim: Rim,
        *,
        friction: FrictionLaw,
        force: float,
        strength: float = np.inf,
        drive: float | None = None,
        creepage: float = 0.0,
    ) -> None:
        self._track, self._rim, self._friction, self._force = track, rim, friction, force
        self._drive = drive if friction.rough else None
        self._strength = strength
        self._creepage = creepage
        surface = track.surface
        self._length = float(np.ptp(surface.X[0]) / len(surface.edges))
        self._compliance = track.compliance, rim.compliance
        self._flowed = flowed(surface, +1), flowed(rim.surface, -1)
        self._rolled = rim.rolled(self._length)
        self._up = np.tile([0.0, 1.0], rim.surface.X.shape[1])
        self._found: tuple[Array, _Geometry, ContactProblem, ContactSolution] | None = None
        self._known = _Linearisation(
            on_track=np.zeros(len(surface.dofs)),
            on_wheel=np.zeros(len(rim.surface.dofs)),
            height=0.0,
            tilt=0.0,
            status=np.full(len(surface.vertices), OPEN),
        )

    def scaled(self, share: float) -> RollingWheel:
        """See `Load`."""
        other = self.driven(share)
        other._force *= share
        return other

    def driven(self, share: float) -> RollingWheel:
        """See `Load`."""
        other = copy(self)
        if other._drive is not None:
            other._drive *= share
        return other

    @property
    def moment(self) -> float:
        """See `Load`."""
        return self._drive or 0.0

    @property
    def slipping(self) -> RollingWheel:
        """See `Load`."""
        other = copy(self)
        if self.moment:
            other._drive, other._creepage = None, float(np.sign(self.moment))
        return other

    def on(self, u: Array) -> RollingContact:
        """See `Load`.

        Raises
        ------
        NoContact, NotConverged
            if no contact forces are found
        """
        track = self._track
        surface, at = track.surface, track.at_surface
        geometry, problem, found = self._solve(u[at])

        def along(change: Array) -> Array:
            forces, _ = change_of(problem, found, geometry.moves[0] @ change[at])
            return np.asarray(change + track.under(geometry.rows[0].T @ forces))

        every = np.zeros((2, len(surface.vertices)))
        every[:, geometry.at] = found.forces.reshape(2, -1)
        gap, bound = np.full((2, len(surface.vertices)), np.nan)
        bound[geometry.at] = problem.lines.least(found.forces[: len(geometry.at)])
        moved = problem.moved(found.forces, found.rigid)
        gap[geometry.at] = moved[: len(geometry.at)]
        turns = self._drive is not None
        return RollingContact(
            force=self._nodal(self._known.on_track),
            u=u + track.under(self._known.on_track),
            along=along,
            x=surface.X[0, surface.vertices],
            normal=every[0],
            tangential=every[1],
            area=geometry.area,
            gap=gap,
            status=self._known.status,
            bound=bound,
            creepage=float(found.rigid[1]) / self._length if turns else self._creepage,
            height=self._known.height,
            moment=-float(geometry.creeping @ found.forces[len(geometry.at) :]),
        )

    def _solve(self, shape: Array) -> tuple[_Geometry, ContactProblem, ContactSolution]:
        """Solve the contact with a surface of this shape (2 n_nodes,) [mm].

        Returns the geometry, the contact problem and its solution.
        """
        known = self._expected(shape)
        for _ in range(_ROUNDS):
            geometry = self._geometry(shape, known)
            problem = self._problem(geometry, shape, known)
            found = solve_contact(problem, known.status[geometry.at])
            if found is None:
                raise NoContact("no contact forces were found in a steady pass")
            before, known = known, self._following(geometry, found)
            if np.abs(known.on_track - before.on_track).max() < _SETTLED * self._force:
                if (known.status[[0, -1]] != OPEN).any():
                    raise WindowTooSmall("the contact reaches the ends of the surface")
                self._known, self._found = known, (shape, geometry, problem, found)
                return geometry, problem, found
        raise NotConverged("the geometry of the contact was not found in a steady pass")

    def _expected(self, shape: Array) -> _Linearisation:
        """Return the contact expected for this shape, by linearisation of the last one found."""
        if self._found is None:
            return self._known
        before, geometry, problem, found = self._found
        forces, rigid = change_of(problem, found, geometry.moves[0] @ (shape - before))
        if np.abs(forces).max(initial=0.0) > _NEAR * self._force:
            return self._known
        return self._following(
            geometry, replace(found, forces=found.forces + forces, rigid=found.rigid + rigid)
        )

    def _geometry(self, shape: Array, known: _Linearisation) -> _Geometry:
        """Return how gaps and slips depend on displacements, linearised at a known contact."""
        u = self._compliance[0] @ known.on_track + shape
        bent = self._compliance[1] @ known.on_wheel
        d = bent + known.height * self._up
        surface, rim = self._track.surface, self._rim.surface
        pairing = pair(surface, u.reshape(-1, 2).T, rim, d.reshape(-1, 2).T)
        at = np.flatnonzero(pairing.covered > _COVERED)
        normal = [block[at] for block in pairing.normal]
        tangent = [block[at] for block in pairing.tangent]
        slips = [block @ flowed for block, flowed in zip(tangent, self._flowed, strict=True)]
        return _Geometry(
            at=at,
            area=pairing.area,
            gap=pairing.gap[at] - normal[0] @ u - normal[1] @ d,
            creeping=tangent[1] @ self._rim.passing(bent),
            rows=[np.vstack(both) for both in zip(normal, tangent, strict=True)],
            moves=[np.vstack(both) for both in zip(normal, slips, strict=True)],
        )

    def _following(self, geometry: _Geometry, found: ContactSolution) -> _Linearisation:
        """Return the contact of a solution of the contact problem."""
        n = len(geometry.at)
        track, wheel = geometry.rows
        status = np.full(len(self._track.surface.vertices), OPEN)
        status[geometry.at] = found.status
        return _Linearisation(
            on_track=track.T @ found.forces,
            on_wheel=wheel.T @ found.forces,
            height=float(found.rigid[0]),
            tilt=float(found.forces[n:] @ (wheel[n:] @ self._up)),
            status=status,
        )

    def _problem(self, geometry: _Geometry, shape: Array, known: _Linearisation) -> ContactProblem:
        """Return the frictional problem; ``shape`` is that of the surface without the wheel."""
        n = len(geometry.at)
        track, wheel = geometry.rows
        normal, tangent = wheel[:n], wheel[n:]
        ahead = np.tile([1.0, 0.0], len(shape) // 2)
        offset = geometry.moves[0] @ shape
        offset[:n] += geometry.gap
        offset[n:] += tangent @ self._rolled - self._length * (track[n:] @ ahead)
        motions = [np.concatenate([normal @ self._up, np.zeros(n)])]
        balance = [known.tilt - self._force]
        if self._drive is None:
            offset[n:] += self._creepage * self._length * geometry.creeping
        else:
            motions.append(np.concatenate([np.zeros(n), geometry.creeping]))
            balance.append(self._drive)
        sides = zip(geometry.moves, self._compliance, geometry.rows, strict=True)
        W = np.sum([moves @ C @ rows.T for moves, C, rows in sides], axis=0)
        lines = pressure_lines(self._friction, n, self._strength)
        return ContactProblem(
            W=W,
            offset=offset,
            lines=lines.over(geometry.area[geometry.at]),
            A=np.stack(motions, axis=1),
            balance=np.array(balance),
        )

    def _nodal(self, force: Array) -> Array:
        """Return the forces (n,) on all nodes of the track from those on its surface."""
        whole = np.zeros(self._track.part.n)
        whole[self._track.surface.dofs] = force
        return whole
