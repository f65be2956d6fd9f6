"""A load that rolls over a prism by increments, over material that stands still.

This is the second method behind steady passes: the same waves, but the state is that of fixed
points of the whole length, which repeats itself. In each increment the load advances by one
station. Equilibrium is the fixed point

    e = Phi(e) = S s + E t(U s),    s = 2G ep(e)

S and U give strain and displacement of the surface by an eigenstress, E the strain by tractions
where the load is now, t the tractions on a surface with such displacements. ep(e) is the plastic
strain by the response of the law from its state after the last increment. Plastic strain changes no
volume, so that 2 G dep/de is C - tangent. Newton's equation

    d = Phi(e) - e + (S + E t' U) (C - tangent) d

is solved by GMRES on the points that yield, on which alone the right side depends.

J.C. Simo, T.J.R. Hughes, Computational Inelasticity (1998), box 3.2, p. 124: the tangent.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol, Self

import numpy as np
from scipy.sparse.linalg import LinearOperator, gmres

from solver.errors import ModelError, NotConverged, WindowTooSmall
from solver.steady.flow import allowed_inflow
from solver.tensors import deviator

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.materials.law import Law
    from solver.materials.state import PlasticState, Response
    from solver.prism.patch_contact import PatchContact
    from solver.prism.track import PrismTrack

    Array = NDArray[np.float64]

_TOLERANCE = 1e-4
"""Largest deviatoric strain of the residual, times 2 G / yield stress, after an increment."""
_FORCING, _KRYLOV = 0.1, 60
"""Relative residual to which GMRES solves Newton's equation, and its most iterations."""
_STEPS, _SHORTEST = 30, 1 / 16
"""Most steps of Newton's method, and the smallest share of one in the line search."""


@dataclass(frozen=True, slots=True, eq=False)
class SteppedState:
    """The state at the n points of the zone at all stations; never changed, only replaced.

    Attributes
    ----------
    state : internal variables (..., n * stations) of the law, station after station of each point
    strain : (n, stations, 6) strain with the elastic strain of the initial stress, Mandel
    """

    state: PlasticState
    strain: Array

    @property
    def plastic_strain(self) -> Array:
        """Plastic strain (n, stations, 6), Mandel."""
        return np.ascontiguousarray(self.state.plastic_strain.T).reshape(self.strain.shape)

    @property
    def accumulated(self) -> Array:
        """Accumulated plastic strain (n, stations)."""
        return self.state.accumulated.reshape(self.strain.shape[:2])


class SteppedLoad(Protocol):
    """A load that rolls by increments, as `EllipticPatch` and `SteppedPatch`."""

    def solve(self, u: Array, start: PatchContact | None = None) -> PatchContact:
        """Return the contact on a surface with displacements (n, m, 3); see `PatchLoad`."""

    def advanced(self, u: Array, contact: PatchContact) -> Self:
        """Return the load one station on, after a contact and its displacements (n, m, 3)."""


@dataclass(frozen=True, slots=True, eq=False)
class SteppedIncrement:
    """An increment.

    Attributes
    ----------
    state : the state after it
    contact : the contact in it
    displacement : (n, m, 3) displacement of the grid under the load by plastic strain [mm]
    """

    state: SteppedState
    contact: PatchContact
    displacement: Array


class SteppedPrism:
    """A prism that repeats itself, and the law of its zone.

    Parameters
    ----------
    track : the prism, without far field; stations are numbered as its own are, round the length
    law : law of the material

    Raises
    ------
    ModelError
        if the prism has a far field
    """

    def __init__(self, track: PrismTrack, law: Law) -> None:
        if track.far is not None:
            raise ModelError("levels", "some", "must be 0: the length repeats itself")
        self._track, self._law, self._modes = track, law, track.modes.everywhere
        self._double_shear = 2 * law.elasticity.shear_modulus
        self._stiffness = law.stiffness(6)
        self._shape = len(self._modes.points), self._modes.stations, 6
        self._initial = track.initial_strain[self._modes.points, None]

    @property
    def virgin(self) -> SteppedState:
        """The state before any load."""
        points, stations, _ = self._shape
        strain = np.broadcast_to(self._initial, self._shape)
        return SteppedState(self._law.initial(points * stations, 6), strain)

    def rolled(self, before: SteppedState, load: SteppedLoad, advance: int) -> SteppedIncrement:
        """Return the state, without load, after a load has rolled over some stations to x = 0.

        The load is set down where it begins, rolls by one station in each increment, and is taken
        off in the last one. Of that the contact is the last one.

        Parameters
        ----------
        advance : number of stations over which the load rolls

        Raises
        ------
        ModelError
            if the load reaches where it began, round the length
        WindowTooSmall
            if points yield at the rim of the zone
        NotConverged
            if an increment has no equilibrium
        """
        most = self._modes.stations - self._track.grid.stations
        if not 0 <= advance <= most:
            raise ModelError("advance", advance, f"must be in 0 to {most} stations")
        state = before
        contact: PatchContact | None = None
        advanced: Array | None = None
        for left in range(advance, -1, -1):
            # under a load that rolls, the last increment's change comes again one station on
            guess = None if advanced is None else state.strain + np.roll(advanced, -1, axis=1)
            after = self._increment(state, load, left, contact, guess)
            advanced = after.state.strain - state.strain if left < advance else None
            state, contact = after.state, after.contact
            load = load.advanced(after.displacement, after.contact)
        state = self._increment(state, _NoLoad(after.contact), 0, None, None).state
        self._check_rim(before, state)
        return SteppedIncrement(state, after.contact, after.displacement)

    def _increment(
        self, before: SteppedState, load: SteppedLoad, left: int, start: PatchContact | None,
        guess: Array | None,
    ) -> SteppedIncrement:  # fmt: skip
        """Return an increment by Newton's method; the load is ``left`` stations behind x = 0."""

        def at(strain: Array, start: PatchContact | None) -> _AtStrain:
            flat = np.ascontiguousarray(strain.reshape(-1, 6).T)
            response = self._law.respond(flat, before.state)
            plastic = response.state.plastic_strain.T.reshape(self._shape)
            eigenstress = self._double_shear * plastic
            u = self._surface(eigenstress, left)
            contact = load.solve(u, start)
            made = self._initial + self._strain(eigenstress, contact.traction, left)
            return _AtStrain(strain, response, u, contact, made - strain)

        here = at(before.strain if guess is None else guess, start)
        for _ in range(_STEPS):
            size = np.linalg.norm(deviator(here.residual.reshape(-1, 6).T), axis=0).max()
            if size * self._double_shear < _TOLERANCE * self._law.yield_stress:
                state = SteppedState(here.response.state, here.strain)
                return SteppedIncrement(state, here.contact, here.displacement)
            change, length = self._newton(here, left), 1.0
            there = at(here.strain + change, here.contact)
            while there.size >= here.size and length > _SHORTEST:
                length /= 2
                there = at(here.strain + length * change, here.contact)
            here = there
        raise NotConverged("no equilibrium was found in an increment of a rolling load")

    def _surface(self, eigenstress: Array, left: int) -> Array:
        """Return the displacement (n, m, 3) of the grid under the load by an eigenstress [mm]."""
        return self._track.on_grid(np.roll(self._modes.displacement(eigenstress), -left, axis=1))

    def _strain(self, eigenstress: Array, traction: Array, left: int) -> Array:
        """Return the strain (n, stations, 6) of an eigenstress, and of tractions of the load."""
        forces = np.zeros((len(self._modes.along), self._modes.stations))
        forces[:, : len(self._track.modes.x)] = self._track.on_rows(traction)
        return self._modes.solve(eigenstress, np.roll(forces, left, axis=1)).strain

    def _newton(self, here: _AtStrain, left: int) -> Array:
        """Return the change d of strain by Newton's equation."""
        residual, soft = here.residual.reshape(-1, 6), np.flatnonzero(here.response.yielding)
        if not len(soft):
            return here.residual
        loss = np.moveaxis(self._stiffness[..., None] - here.response.tangent[..., soft], 2, 0)

        def made(change: Array) -> Array:
            eigenstress = np.zeros_like(residual)
            eigenstress[soft] = np.matmul(loss, change.reshape(-1, 6, 1))[..., 0]
            eigenstress = eigenstress.reshape(self._shape)
            traction = here.contact.along(self._surface(eigenstress, left))
            return self._strain(eigenstress, traction, left)

        def equation(change: Array) -> Array:
            return np.asarray(change - made(change).reshape(-1, 6)[soft].ravel())

        own = residual[soft].ravel()
        operator = LinearOperator((len(own), len(own)), matvec=equation, dtype=float)
        change, _ = gmres(operator, own, rtol=_FORCING, restart=_KRYLOV, maxiter=1)
        return here.residual + made(change)

    def _check_rim(self, before: SteppedState, after: SteppedState) -> None:
        """Raise `WindowTooSmall` if points at the rim of the zone have yielded."""
        added = after.accumulated - before.accumulated
        most = allowed_inflow(self._law, float(added.max()))
        if added[self._track.rim].max(initial=0.0) > most:
            raise WindowTooSmall("the zone is too small: points yield at its rim")


@dataclass(frozen=True, slots=True, eq=False)
class _AtStrain:
    """An iterate of Newton's method.

    ``residual`` is Phi(e) - e, ``displacement`` (n, m, 3) that of the surface by plastic strain.
    """

    strain: Array
    response: Response
    displacement: Array
    contact: PatchContact
    residual: Array

    @property
    def size(self) -> float:
        """Norm of the residual."""
        return float(np.linalg.norm(self.residual))


@dataclass(frozen=True, slots=True)
class _NoLoad:
    """No tractions, on the grid of a contact; see `SteppedLoad`."""

    contact: PatchContact

    def solve(self, u: Array, start: PatchContact | None = None) -> PatchContact:
        """See `SteppedLoad`."""
        nothing = np.zeros_like(self.contact.traction)
        return replace(self.contact, traction=nothing, along=np.zeros_like)

    def advanced(self, u: Array, contact: PatchContact) -> _NoLoad:
        """See `SteppedLoad`."""
        return self
