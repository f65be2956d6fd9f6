"""A load that rolls over a prism by increments, over material that stands still.

This is the second method behind steady passes: the same waves, but the state is that of fixed
points of the whole length, which repeats itself. In each increment the load advances by one
station. With its strain e_load, where it is now, equilibrium is the fixed point

    e = Phi(e) = e_load + S 2G ep(e)

S gives the strain of an eigenstress, and ep(e) is the plastic strain by the response of the law
from its state after the last increment. Plastic strain changes no volume, so that 2 G dep/de is
C - tangent. Newton's equation

    d = Phi(e) - e + S (C - tangent) d

is solved by GMRES on the points that yield, on which alone the right side depends.

J.C. Simo, T.J.R. Hughes, Computational Inelasticity (1998), section 3.3.2: the consistent tangent.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse.linalg import LinearOperator, gmres

from solver.errors import ModelError, NotConverged, WindowTooSmall
from solver.steady.flow import INFLOW, LEAST
from solver.tensors import deviator

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.materials.law import Law
    from solver.materials.state import PlasticState, Response
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
    strain : (n, stations, 6) strain, Mandel
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

    @property
    def virgin(self) -> SteppedState:
        """The state before any load."""
        points, stations, _ = self._shape
        return SteppedState(self._law.initial(points * stations, 6), np.zeros(self._shape))

    def rolled(self, before: SteppedState, traction: Array, advance: int) -> SteppedState:
        """Return the state, without load, after a load has rolled over some stations to x = 0.

        The load is set down where it begins, rolls by one station in each increment, and is taken
        off in the last one.

        Parameters
        ----------
        traction : (n, m, 3) tractions on the grid of the track, which do not change [MPa]
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
        most = self._modes.stations - len(traction)
        if not 0 <= advance <= most:
            raise ModelError("advance", advance, f"must be in 0 to {most} stations")
        forces = np.zeros((len(self._modes.along), self._modes.stations))
        forces[:, : len(self._track.modes.x)] = self._track.on_rows(traction)
        load = self._modes.solve(forces=forces).strain
        state, advanced = before, None
        for left in range(advance, -1, -1):
            # under a load that rolls, the last increment's change comes again one station on
            guess = None if advanced is None else state.strain + np.roll(advanced, -1, axis=1)
            after = self.increment(state, np.roll(load, left, axis=1), guess)
            advanced = after.strain - state.strain if left < advance else None
            state = after
        state = self.increment(state, np.zeros(self._shape))
        self._check_rim(before, state)
        return state

    def increment(
        self, before: SteppedState, load: Array, guess: Array | None = None
    ) -> SteppedState:
        """Return the state after one increment, by Newton's method.

        Parameters
        ----------
        load : (n, stations, 6) strain of the load at the end of the increment, Mandel
        guess : strain to start from, by default that without further flow

        Raises
        ------
        NotConverged
            if no equilibrium is found
        """
        start = load + self._by(before.plastic_strain) if guess is None else guess
        here = self._at(before, load, start)
        for _ in range(_STEPS):
            size = np.linalg.norm(deviator(here.residual.reshape(-1, 6).T), axis=0).max()
            if size * self._double_shear < _TOLERANCE * self._law.yield_stress:
                return SteppedState(here.response.state, here.strain)
            change, length = self._newton(here), 1.0
            there = self._at(before, load, here.strain + change)
            while there.size >= here.size and length > _SHORTEST:
                length /= 2
                there = self._at(before, load, here.strain + length * change)
            here = there
        raise NotConverged("no equilibrium was found in an increment of a rolling load")

    def _by(self, plastic_strain: Array) -> Array:
        """Return the strain (n, stations, 6) that a plastic strain of that shape makes."""
        return self._modes.solve(self._double_shear * plastic_strain).strain

    def _at(self, before: SteppedState, load: Array, strain: Array) -> _AtStrain:
        """Return the iterate at a strain (n, stations, 6)."""
        flat = np.ascontiguousarray(strain.reshape(-1, 6).T)
        response = self._law.respond(flat, before.state)
        plastic = response.state.plastic_strain.T.reshape(self._shape)
        return _AtStrain(strain, response, load + self._by(plastic) - strain)

    def _newton(self, here: _AtStrain) -> Array:
        """Return the change d of strain by Newton's equation."""
        residual, soft = here.residual.reshape(-1, 6), np.flatnonzero(here.response.yielding)
        if not len(soft):
            return here.residual
        loss = np.moveaxis(self._stiffness[..., None] - here.response.tangent[..., soft], 2, 0)

        def made(change: Array) -> Array:
            eigenstress = np.zeros_like(residual)
            eigenstress[soft] = np.matmul(loss, change.reshape(-1, 6, 1))[..., 0]
            return self._modes.solve(eigenstress.reshape(self._shape)).strain

        def equation(change: Array) -> Array:
            return np.asarray(change - made(change).reshape(-1, 6)[soft].ravel())

        own = residual[soft].ravel()
        operator = LinearOperator((len(own), len(own)), matvec=equation, dtype=float)
        change, _ = gmres(operator, own, rtol=_FORCING, restart=_KRYLOV, maxiter=1)
        return here.residual + made(change)

    def _check_rim(self, before: SteppedState, after: SteppedState) -> None:
        """Raise `WindowTooSmall` if points at the rim of the zone have yielded."""
        added = after.accumulated - before.accumulated
        least = LEAST * self._law.yield_stress / self._law.elasticity.youngs_modulus
        if added[self._track.rim].max(initial=0.0) > INFLOW * max(least, added.max()):
            raise WindowTooSmall("the zone is too small: points yield at its rim")


@dataclass(frozen=True, slots=True, eq=False)
class _AtStrain:
    """An iterate of Newton's method: strain, response of the law and residual Phi(e) - e."""

    strain: Array
    response: Response
    residual: Array

    @property
    def size(self) -> float:
        """Norm of the residual."""
        return float(np.linalg.norm(self.residual))
