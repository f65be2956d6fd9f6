"""Loads that roll over a prism by increments, over material that stands still.

This is the second method behind steady passes: the same waves, but the state is that of fixed
points of the whole length, which repeats itself, and nothing is assumed to be steady. A *path*
tells load and place in each increment: rolling, a stop, a load or position that changes.
Equilibrium is the fixed point

    e = Phi(e) = S s + E t(U s),    s = 2G ep(e)

S and U give strain and displacement of the surface by an eigenstress, E the strain by tractions
where the load is now, t the tractions on a surface with such displacements. What an endless or
clamped prism adds moves with the load. ep(e) is the plastic strain at the end of the straight way
from the strain after the last increment to e, in as many parts as a steady pass takes from station
to station. With one part the return does not see that the way of stress is curved, and leaves less
plastic strain.
Newton's equation

    d = Phi(e) - e + (S + E t' U) 2G ep' d

is solved by GMRES on the points that yield, on which alone the right side depends.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Protocol, Self

import numpy as np

from solver.errors import ModelError, NotConverged, WindowTooSmall
from solver.linear.iterative import gmres
from solver.materials.law import Law
from solver.materials.state import PlasticState
from solver.rolling.flow import PARTS, allowed_inflow, sweep_of
from solver.rolling.passing import TOLERANCE, deviation, searched
from solver.rolling.rail.friction_cone import OPEN
from solver.rolling.rail.modes import Modes
from solver.rolling.rail.patch_contact import EllipticPatch, PatchContact
from solver.rolling.rail.patch_grid import PatchGrid
from solver.rolling.rail.track import PrismTrack
from solver.typing import Array
from tests.verification.prism_fields import response

_FORCING, _KRYLOV = 0.1, 60
"""Relative residual to which GMRES solves Newton's equation, and its most iterations."""
_STEPS = 30
"""Most steps of Newton's method."""


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


def everywhere(modes: Modes) -> Modes:
    """The same waves, with forces and results at all stations."""
    other = copy(modes)
    other.x, other.behind = -modes.length / modes.stations * np.arange(modes.stations), np.zeros(0)
    other._set_transforms(modes.stations, other.behind)
    return other


class SteppedContact(Protocol):
    """What an increment leaves of its contact.

    Attributes
    ----------
    contact : the contact; None before a load is set down
    displacement : (n, m, 3) displacement of the grid without tractions [mm]
    """

    @property
    def contact(self) -> PatchContact | None:
        """See above."""

    @property
    def displacement(self) -> Array:
        """See above."""


class Bare(NamedTuple):
    """The surface before a load is set down; see `SteppedContact`."""

    displacement: Array
    contact: None = None


class SteppedLoad(Protocol):
    """A load of an increment, as `SteppedEllipse` and `SteppedPatch`."""

    def solve(self, u: Array, start: PatchContact | None = None) -> PatchContact:
        """Return the contact on a surface with displacements (n, m, 3); see `PatchLoad`."""

    def following(self, before: Sequence[SteppedContact], stations: int) -> Self:
        """Return this load, in an increment in which it advances by so many stations.

        Parameters
        ----------
        before : the last increment; and the one before it, if the load advanced by as many
            stations in between. For a load that is set down the surface as it is
        """


class SteppedEllipse(EllipticPatch):
    """A given load."""

    def following(self, before: Sequence[SteppedContact], stations: int) -> Self:
        """See `SteppedLoad`; the tractions do not change."""
        return self


class LoadAt(NamedTuple):
    """A load and its place.

    Attributes
    ----------
    load : the load; None for none
    behind : number of stations by which it is behind x = 0
    """

    load: SteppedLoad | None
    behind: int


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
    """A prism whose plastic strain repeats itself after the length, and the law of its zone.

    Parameters
    ----------
    track : the prism; stations are numbered as its own are, round the length. Ends of a clamped one
        move with the load, which stays in the middle of the span
    law : law of the material
    parts : number of parts of the way of strain in an increment, `PARTS` if None
    """

    def __init__(self, track: PrismTrack, law: Law, parts: int | None = None) -> None:
        self._track, self._law, self._modes = track, law, everywhere(track.modes)
        self._parts = parts or PARTS
        self._double_shear = 2 * law.elasticity.shear_modulus
        self._stiffness = law.stiffness(6)
        self._shape = len(self._modes.points), self._modes.stations, 6
        self._initial = track.initial_strain[self._modes.points, None]

    @property
    def virgin(self) -> SteppedState:
        """The state before any load; see `PrismTrack.virgin`."""
        points, stations, _ = self._shape
        strain = np.broadcast_to(self._track.virgin(self._law).strain[:, None], self._shape)
        return SteppedState(self._law.initial(points * stations, 6), strain)

    @property
    def most_behind(self) -> int:
        """Largest number of stations over which a load rolls before it meets its start."""
        return self._modes.stations - self._track.grid.stations

    def rolled(self, before: SteppedState, load: SteppedLoad, advance: int) -> SteppedIncrement:
        """Return the state, without load, after a load has rolled over some stations to x = 0.

        The load is set down where it begins, rolls by one station in each increment, and is taken
        off in the last one. Contact and displacement are those under the load, at x = 0.

        Parameters
        ----------
        advance : number of stations over which the load rolls

        Raises
        ------
        ModelError, WindowTooSmall, NotConverged
            as `along`
        """
        if not 0 <= advance <= self.most_behind:
            raise ModelError("advance", advance, f"must be in 0 to {self.most_behind} stations")
        path = [LoadAt(load, behind) for behind in range(advance, -1, -1)]
        *_, last, off = self.along(before, [*path, LoadAt(None, 0)])
        return replace(last, state=off.state)

    def along(self, before: SteppedState, path: Iterable[LoadAt]) -> Iterator[SteppedIncrement]:
        """Yield the increments of a path.

        Raises
        ------
        ModelError
            if a place is not on the length
        WindowTooSmall
            if points yield at the rim of the zone
        NotConverged
            if an increment has no equilibrium
        """
        off = _NoLoad(self._track.grid)
        known: list[SteppedContact] = []
        state, place, moved, change = before, 0, 0, np.zeros(self._shape)
        for load, behind in path:
            if not 0 <= behind <= self.most_behind:
                raise ModelError("behind", behind, f"must be in 0 to {self.most_behind} stations")
            # a load that is set down does not advance
            step = place - behind if known else 0
            if not known:
                known = [Bare(self._surface(self._double_shear * state.plastic_strain, behind))]
            again = step and step == moved
            now = (load or off).following(known if again else known[:1], step)
            guess, start = state.strain, known[0].contact
            if load and again:
                # under a load that rolls, the last increment's change comes again
                guess = guess + np.roll(change, -step, axis=1)
            last = self._increment(state, now, behind, start, guess)
            self._check_rim(before, last.state)
            change, place, moved, state = last.state.strain - state.strain, behind, step, last.state
            known = [last, *known[:1]] if load else []
            yield last

    def _increment(
        self, before: SteppedState, load: SteppedLoad, behind: int, start: PatchContact | None,
        guess: Array,
    ) -> SteppedIncrement:  # fmt: skip
        """Return an increment by Newton's method."""

        def at(strain: Array, start: PatchContact | None) -> _AtStrain:
            flow = _StandingFlow(self._law, before, strain, self._stiffness, self._parts)
            eigenstress = self._double_shear * flow.plastic_strain
            u = self._surface(eigenstress, behind)
            contact = load.solve(u, start)
            made = self._initial + self._strain(eigenstress, contact.traction, behind)
            return _AtStrain(strain, flow, u, contact, made - strain)

        here = at(guess, start)
        for _ in range(_STEPS):
            if deviation(here.residual) * self._double_shear < TOLERANCE * self._law.yield_stress:
                state = SteppedState(here.flow.state, here.strain)
                return SteppedIncrement(state, here.contact, here.displacement)
            change = self._newton(here, behind)

            def after(share: float, here: _AtStrain = here, change: Array = change) -> _AtStrain:
                return at(here.strain + share * change, here.contact)

            here = searched(after, here.size)
        raise NotConverged(
            f"no equilibrium was found in {_STEPS} steps of Newton's method with the load {behind} "
            "stations behind x = 0; try a lower load or a material that hardens"
        )

    def _surface(self, eigenstress: Array, behind: int) -> Array:
        """Return the displacement (n, m, 3) of the grid under the load by an eigenstress [mm]."""
        moved = self._modes.displacement(self._modes.nodal(eigenstress))
        return self._track.on_grid(np.roll(moved, -behind, axis=1))

    def _strain(self, eigenstress: Array, traction: Array, behind: int) -> Array:
        """Return the strain (n, stations, 6) of an eigenstress, and of tractions of the load."""
        _, stations, _ = self._shape
        forces = np.zeros((len(self._modes.along), stations))
        own = self._track.on_rows(traction)
        forces[:, : own.shape[1]] = own
        strain = response(self._modes, eigenstress, np.roll(forces, behind, axis=1)).strain
        if self._track.far is not None:
            first = self.most_behind - behind
            far = self._far[:, first : first + stations]
            strain += far @ self._track.far.resultants(own)
        return strain

    @cached_property
    def _far(self) -> Array:
        """Strain (n, most_behind + stations, 6, 4) by unit resultants; see `FarField`.

        The first station is that by which the load at the start is farthest behind.
        """
        assert self._track.far is not None
        downstream = np.arange(-self.most_behind, self._modes.stations) - self._track.before
        apart = np.asarray(-self._track.grid.spacing * downstream, dtype=float)
        return self._track.far.strain_at(apart)

    def _newton(self, here: _AtStrain, behind: int) -> Array:
        """Return the change d of strain by Newton's equation."""
        residual, soft = here.residual.reshape(-1, 6), here.flow.soft
        if not len(soft):
            return here.residual

        def made(change: Array) -> Array:
            eigenstress = np.zeros_like(residual)
            eigenstress[soft] = self._double_shear * here.flow.along(change.reshape(-1, 6))
            eigenstress = eigenstress.reshape(self._shape)
            traction = here.contact.along(self._surface(eigenstress, behind))
            return self._strain(eigenstress, traction, behind)

        def equation(change: Array) -> Array:
            return np.asarray(change - made(change).reshape(-1, 6)[soft].ravel())

        change, _ = gmres(equation, residual[soft].ravel(), _FORCING, _KRYLOV)
        return here.residual + made(change)

    def _check_rim(self, before: SteppedState, after: SteppedState) -> None:
        """Raise `WindowTooSmall` if points at the rim of the zone have yielded."""
        added = after.accumulated - before.accumulated
        most = allowed_inflow(self._law, float(added.max()))
        if added[self._track.rim].max(initial=0.0) > most:
            raise WindowTooSmall("the zone is too small: points yield at its rim")


class _StandingFlow:
    """The flow of all points from a state to a strain (n, stations, 6).

    A point that is inside the yield surface at the end of its straight way is so all along it.

    Attributes
    ----------
    state : internal variables (..., n * stations) at the end
    plastic_strain : (n, stations, 6) Mandel
    soft : numbers of the points that yield
    """

    def __init__(
        self, law: Law, before: SteppedState, strain: Array, stiffness: Array, parts: int
    ) -> None:
        begin, end = before.strain.reshape(-1, 6), strain.reshape(-1, 6)
        stress = stiffness @ (end.T - before.state.plastic_strain)
        self.state = before.state
        self.soft = np.flatnonzero(law.yield_value(stress, before.state) > 0)
        if len(self.soft):
            way = np.stack([begin[self.soft], end[self.soft]], axis=1)
            self._sweep = sweep_of(law, way, before.state.at(self.soft), parts)
            packed = before.state.packed
            packed[:, self.soft] = self._sweep.states.packed[..., 0]
            self.state = before.state.unpacked(packed)
        self.plastic_strain = SteppedState(self.state, strain).plastic_strain

    def along(self, change: Array) -> Array:
        """Return the change of plastic strain (n_soft, 6) for one of strain at the soft points."""
        return self._sweep.along(change[:, None])[0][:, 0]


@dataclass(frozen=True, slots=True, eq=False)
class _AtStrain:
    """An iterate of Newton's method.

    ``residual`` is Phi(e) - e, ``displacement`` (n, m, 3) that of the surface by plastic strain.
    """

    strain: Array
    flow: _StandingFlow
    displacement: Array
    contact: PatchContact
    residual: Array

    @property
    def size(self) -> float:
        """Norm of the residual."""
        return float(np.linalg.norm(self.residual))


@dataclass(frozen=True, slots=True)
class _NoLoad:
    """No tractions; see `SteppedLoad`."""

    grid: PatchGrid

    def solve(self, u: Array, start: PatchContact | None = None) -> PatchContact:
        """See `SteppedLoad`."""
        nothing = np.zeros_like(u)
        return PatchContact(
            grid=self.grid,
            traction=nothing,
            gap=np.full(u.shape[:2], np.nan),
            slip=np.full_like(u[..., :2], np.nan),
            status=np.full(u.shape[:2], OPEN),
            along=np.zeros_like,
        )

    def following(self, before: Sequence[SteppedContact], stations: int) -> _NoLoad:
        """See `SteppedLoad`."""
        return self
