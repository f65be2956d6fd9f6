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

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from solver.contact.complementarity import change_of, solve_contact
from solver.contact.geometry import pair
from solver.contact.problem import OPEN, ContactProblem, ContactSolution
from solver.errors import NoContact, NotConverged, WindowTooSmall
from solver.fem.discretisation import Discretisation
from solver.fem.operators import operators_of
from solver.fem.rigid import turning
from solver.fem.surface import Surface, extract
from solver.fem.wheel import Wheel
from solver.model.body import Body
from solver.model.friction import FrictionLaw, pressure_lines
from solver.rolling.load import AppliedLoad, PassingLoad
from solver.rolling.plane.layers import Layers
from solver.rolling.plane.track import Track
from solver.typing import Array, Ints


class Rim:
    """The part of a wheel's rim that may touch a track, in the frame of the hub.

    Parameters
    ----------
    body : the wheel, with its axle; its lowest point is at x = 0, and elements along the rim are as
        long as those of the track
    boundary : name of the part of the rim that may touch the track

    Attributes
    ----------
    wheel : the wheel condensed to this part of the rim
    surface : the rim as a chain of edges
    """

    def __init__(self, body: Body, boundary: str) -> None:
        whole = Discretisation(body)
        chain = extract(whole, boundary)
        self.wheel = Wheel(whole, [chain], "auto")
        self.surface = self.wheel.surface(chain)

    def rolled(self, length: float) -> Array:
        """Return the displacements (n,) of a rigid wheel that rolls over a length [mm].

        Material moves along the arc. Along the tangent it would leave the rim by
        ``length^2 / (2 R)``, and have an apparent slip of x / R of that at a contact at x: with
        elements of a quarter of the half-width, 2 % of the slip at 30 % braking.
        """
        frame = self.wheel.frame
        arm = self.surface.X - frame.centre[:, None]
        return np.asarray((arm - turning(length / frame.radius) @ arm).T.ravel())

    def passing(self, d: Array) -> Array:
        """Return the derivative (n,) of positions by the arc, on a rim with displacements (n,)."""
        return self.wheel.passing(self.surface, d.reshape(-1, 2).T).T.ravel()

    @cached_property
    def compliance(self) -> Array:
        """Displacements of the rim for forces on it (n, n), over its unknowns [mm/N]."""
        dofs = self.surface.dofs
        return operators_of(self.wheel, [], "auto").elastic.compliance(dofs, np.eye(len(dofs)))


def flowed(surface: Surface, way: int) -> Array:
    """Return the matrix from a nodal field to its change over one element, from upstream.

    ``way`` is +1 for a chain of edges that goes downstream. At the upstream end of the chain the
    change is zero.
    """
    chain = np.append(surface.edges[:, [0, 2]].ravel(), surface.edges[-1, 1])
    chain = chain if way > 0 else chain[::-1]
    change = np.zeros((surface.X.shape[1],) * 2)
    change[chain[2:], chain[2:]] = 1.0
    change[chain[2:], chain[:-2]] = -1.0
    return np.asarray(np.kron(change, np.eye(2)), dtype=float)


@dataclass(frozen=True, slots=True)
class Linearisation:
    """An approximate contact, at which the next contact problem is linearised.

    ``on_track`` and ``on_wheel`` are nodal forces on the surfaces, ``tilt`` is the vertical
    component of the tangential forces on the wheel.
    """

    on_track: Array
    on_wheel: Array
    height: float
    tilt: float
    status: Ints


@dataclass(frozen=True, slots=True, kw_only=True)
class RollingContact(AppliedLoad):
    """The contact of a wheel with a track.

    Attributes
    ----------
    x : (n,) positions of the vertices of the track [mm]
    normal, tangential : (n,) contact forces on the track; tangential forces are positive against
        the motion of the load [N]
    area : (n,) areas of the vertices' hats [mm2]
    gap : (n,) gap between track and rim, NaN if they do not face each other [mm]
    status : (n,) status of the contact points, as in `solver.contact.problem`
    bound : (n,) friction bound of the tangential forces [N]
    creepage : 1 + R d(rotation) / d(advance)
    height : displacement of the axle along y [mm]
    near : (shape of the surface without the wheel) -> first guess for the next contact
    """

    x: Array
    normal: Array
    tangential: Array
    area: Array
    gap: Array
    status: Ints
    bound: Array
    creepage: float
    height: float
    near: Callable[[Array], Linearisation]

    @property
    def pressure(self) -> Array:
        """Contact pressure at the vertices (n,) [MPa], zero at those that do not face the rim."""
        return self._over_area(self.normal)

    @property
    def most_shear(self) -> Array:
        """Largest shear that friction permits at the vertices (n,) [MPa]."""
        return self._over_area(np.nan_to_num(self.bound))

    @property
    def shear(self) -> Array:
        """Shear on the track at the vertices (n,), positive against the load's motion [MPa]."""
        return self._over_area(self.tangential)

    def _over_area(self, force: Array) -> Array:
        return np.divide(force, self.area, out=np.zeros_like(force), where=self.area > 0)


_ROUNDS = 40
_NEAR = 0.01
"""Largest predicted change of a contact force, over the load, with which the predicted contact is
the first guess."""
_COVERED = 0.999
"""A vertex is a contact point if at least this share of its hat faces the rim."""


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


@dataclass(frozen=True, kw_only=True, eq=False)
class RollingWheel(PassingLoad):
    """A wheel pressed on a track.

    Attributes
    ----------
    track : the track on which it rolls
    rim : the part of the wheel that may touch the track
    friction : friction law; it must not depend on slip or plastic strain here
    strength : initial shear yield stress of the track [MPa]
    load : force and moment; without friction the moment is left out. Its creepage is
        1 + R d(rotation) / d(advance)
    settled : change of contact forces, over the load, below which the geometry has converged
    """

    track: Track
    rim: Rim
    friction: FrictionLaw
    strength: float = np.inf
    settled: float = 1e-7

    @property
    def exact(self) -> Self:
        """See `PassingLoad`."""
        return replace(self, settled=1e-13)

    @cached_property
    def _length(self) -> float:
        """Length of an element along the track [mm]."""
        surface = self.track.surface
        return float(np.ptp(surface.X[0]) / len(surface.edges))

    @cached_property
    def _flowed(self) -> tuple[Array, Array]:
        return flowed(self.track.surface, +1), flowed(self.rim.surface, -1)

    @cached_property
    def _rolled(self) -> Array:
        return self.rim.rolled(self._length)

    @property
    def _up(self) -> Array:
        return np.tile([0.0, 1.0], self.rim.surface.X.shape[1])

    @property
    def _drive(self) -> float | None:
        """The moment over radius that is prescribed [N], or None."""
        return self.load.drive if self.friction.rough else None

    def on(self, u: Array, before: Layers, start: RollingContact | None = None) -> RollingContact:
        """See `PassingLoad`; ``before`` has no effect: it leaves the surface straight.

        Raises
        ------
        NoContact, NotConverged
            if no contact forces are found
        """
        track = self.track
        surface, at = track.surface, track.at_surface
        shape = u[at]
        geometry, problem, found, known = self._solve(shape, start)

        def along(change: Array) -> Array:
            forces, _ = change_of(problem, found, geometry.moves[0] @ change[at])
            return np.asarray(change + track.under(geometry.rows[0].T @ forces))

        def near(other: Array) -> Linearisation:
            forces, rigid = change_of(problem, found, geometry.moves[0] @ (other - shape))
            if np.abs(forces).max(initial=0.0) > _NEAR * self.load.force:
                return known
            return self._following(
                geometry, replace(found, forces=found.forces + forces, rigid=found.rigid + rigid)
            )

        every = np.zeros((2, len(surface.vertices)))
        every[:, geometry.at] = found.forces.reshape(2, -1)
        gap, bound = np.full((2, len(surface.vertices)), np.nan)
        bound[geometry.at] = problem.lines.least(found.forces[: len(geometry.at)])
        moved = problem.moved(found.forces, found.rigid)
        gap[geometry.at] = moved[: len(geometry.at)]
        force = np.zeros(track.part.n)
        force[surface.dofs] = known.on_track
        turns = self._drive is not None
        return RollingContact(
            force=force,
            u=u + track.under(known.on_track),
            along=along,
            x=surface.X[0, surface.vertices],
            normal=every[0],
            tangential=every[1],
            area=geometry.area,
            gap=gap,
            status=known.status,
            bound=bound,
            creepage=float(found.rigid[1]) / self._length if turns else self.load.creepage,
            height=known.height,
            moment=-float(geometry.creeping @ found.forces[len(geometry.at) :]),
            near=near,
        )

    def _solve(
        self, shape: Array, start: RollingContact | None
    ) -> tuple[_Geometry, ContactProblem, ContactSolution, Linearisation]:
        """Solve the contact with a surface of this shape (2 n_nodes,) [mm].

        Returns the geometry, the contact problem, its solution, and the contact of this.
        """
        known = self._apart if start is None else start.near(shape)
        for _ in range(_ROUNDS):
            geometry = self._geometry(shape, known)
            problem = self._problem(geometry, shape, known)
            found = solve_contact(problem, known.status[geometry.at])
            if found is None:
                raise NoContact("no contact forces were found in a steady pass")
            before, known = known, self._following(geometry, found)
            if np.abs(known.on_track - before.on_track).max() < self.settled * self.load.force:
                if (known.status[[0, -1]] != OPEN).any():
                    raise WindowTooSmall("the contact reaches the ends of the surface")
                return geometry, problem, found, known
        raise NotConverged("the geometry of the contact was not found in a steady pass")

    @property
    def _apart(self) -> Linearisation:
        """The bodies without contact."""
        surface = self.track.surface
        return Linearisation(
            on_track=np.zeros(len(surface.dofs)),
            on_wheel=np.zeros(len(self.rim.surface.dofs)),
            height=0.0,
            tilt=0.0,
            status=np.full(len(surface.vertices), OPEN),
        )

    def _geometry(self, shape: Array, known: Linearisation) -> _Geometry:
        """Return how gaps and slips depend on displacements, linearised at a known contact."""
        u = self.track.compliance @ known.on_track + shape
        bent = self.rim.compliance @ known.on_wheel
        d = bent + known.height * self._up
        surface, rim = self.track.surface, self.rim.surface
        pairing = pair(surface, u.reshape(-1, 2).T, rim, d.reshape(-1, 2).T)
        at = np.flatnonzero(pairing.covered > _COVERED)
        normal = [block[at] for block in pairing.normal]
        tangent = [block[at] for block in pairing.tangent]
        slips = [block @ flowed for block, flowed in zip(tangent, self._flowed, strict=True)]
        return _Geometry(
            at=at,
            area=pairing.area,
            gap=pairing.gap[at] - normal[0] @ u - normal[1] @ d,
            creeping=tangent[1] @ self.rim.passing(bent),
            rows=[np.vstack(both) for both in zip(normal, tangent, strict=True)],
            moves=[np.vstack(both) for both in zip(normal, slips, strict=True)],
        )

    def _following(self, geometry: _Geometry, found: ContactSolution) -> Linearisation:
        """Return the contact of a solution of the contact problem."""
        n = len(geometry.at)
        track, wheel = geometry.rows
        status = np.full(len(self.track.surface.vertices), OPEN)
        status[geometry.at] = found.status
        return Linearisation(
            on_track=track.T @ found.forces,
            on_wheel=wheel.T @ found.forces,
            height=float(found.rigid[0]),
            tilt=float(found.forces[n:] @ (wheel[n:] @ self._up)),
            status=status,
        )

    def _problem(self, geometry: _Geometry, shape: Array, known: Linearisation) -> ContactProblem:
        """Return the frictional problem; ``shape`` is that of the surface without the wheel."""
        n = len(geometry.at)
        track, wheel = geometry.rows
        normal, tangent = wheel[:n], wheel[n:]
        ahead = np.tile([1.0, 0.0], len(shape) // 2)
        offset = geometry.moves[0] @ shape
        offset[:n] += geometry.gap
        offset[n:] += tangent @ self._rolled - self._length * (track[n:] @ ahead)
        motions = [np.concatenate([normal @ self._up, np.zeros(n)])]
        balance = [known.tilt - self.load.force]
        if self._drive is None:
            offset[n:] += self.load.creepage * self._length * geometry.creeping
        else:
            motions.append(np.concatenate([np.zeros(n), geometry.creeping]))
            balance.append(self._drive)
        compliance = self.track.compliance, self.rim.compliance
        sides = zip(geometry.moves, compliance, geometry.rows, strict=True)
        W = np.sum([moves @ C @ rows.T for moves, C, rows in sides], axis=0)
        lines = pressure_lines(self.friction, n, self.strength)
        return ContactProblem(
            W=W,
            offset=offset,
            lines=lines.over(geometry.area[geometry.at]),
            A=np.stack(motions, axis=1),
            balance=np.array(balance),
        )
