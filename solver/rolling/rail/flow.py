"""Plastic strain along the rows of a prism's points, and the state that a pass leaves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from solver.materials.law import Law
from solver.materials.state import PlasticState
from solver.rolling.flow import allowed_inflow, sweep_of
from solver.rolling.load import FlowPast, Given, LeftState
from solver.rolling.passing import passing
from solver.rolling.rail.modes import Modes
from solver.typing import Array, Ints


@dataclass(frozen=True, slots=True)
class PrismState(LeftState):
    """The state at the n points of the zone.

    Attributes
    ----------
    strain : (n, 6) strain without load, with the elastic strain of the initial stress, Mandel
    displacement : (m, 3) displacement of the surface without load, means under the hats [mm]
    """

    strain: Array
    displacement: Array


class _Swept(FlowPast[PrismState]):
    """Material that flows along rows of n points.

    Parameters
    ----------
    begin : state at the beginning of the rows
    before : state that has no eigenstress
    strain : (n, n_columns, 6) strain at the columns, Mandel
    parts : number of increments from column to column

    Attributes
    ----------
    force : (n, n_columns, 6) eigenstress of the plastic strain since ``before`` [MPa]
    """

    def __init__(
        self, law: Law, begin: PrismState, before: PrismState, strain: Array, parts: int
    ) -> None:
        path = np.concatenate([begin.strain[:, None], strain], axis=1)
        super().__init__(law, begin, sweep_of(law, path, begin.state, parts))
        self._strain, self._parts = strain, parts
        self._stiff = 2 * law.elasticity.shear_modulus  # plastic strain changes no volume
        plastic = np.moveaxis(self.states.plastic_strain, 0, 2)
        self.force = self._stiff * (plastic - before.plastic_strain[:, None])

    def along(self, added: Array) -> Array:
        """See `FlowPast`."""
        return self._stiff * self._sweep.along(added)[0]

    def _last(self, displacement: Array) -> PrismState:
        """Return the state at the last column, with this displacement of the surface."""
        state = self.states.unpacked(self.states.packed[..., -1])
        return PrismState(state, self._strain[:, -1], displacement)


class PrismFlow(_Swept):
    """The flow past a load: columns are the stations of a window.

    Parameters
    ----------
    modes : the waves of the prism
    rim : numbers of the points at the edge of the zone, which must not yield
    virgin : returns the state before any load
    added : (n, window, 6) strain that the pass adds, Mandel
    """

    def __init__(
        self, modes: Modes, rim: Ints, law: Law, virgin: Callable[[], PrismState],
        before: PrismState, added: Array, parts: int,
    ) -> None:  # fmt: skip
        super().__init__(law, before, before, before.strain[:, None] + added, parts)
        self._modes, self._rim, self._virgin = modes, rim, virgin

    @property
    def beyond(self) -> str:
        """Side where the window is too small, because points yield there; else empty."""
        added, most = self.added, allowed_inflow(self._law, self.most_added)
        if added[:, 0].max() > most:
            return "ahead"
        return "around" if added[self._rim].max(initial=0.0) > most else ""

    def left(self) -> tuple[PlasticState, PrismState]:
        """Return the internal variables at the stations, and the state far behind the load.

        At the last station the load still acts a little. On the way to no load and no change along
        x points may yield once more, which is a pass of one column through the section alone. The
        strain there is that of all plastic strain, not of the strain that this pass adds: the
        residual of each release would add up from pass to pass.
        """
        body = _Release(self._modes, self._virgin())
        end = self._last(self._begin.displacement)
        had = self._stiff * self._begin.plastic_strain[:, None]
        guess, nothing = body.strain(self.force[:, -1:] + had), body.at_rest
        load, parts = Given(force=nothing, u=nothing), self._parts
        return self.states, passing(body, self._law, load, end, guess, parts=parts).after


class _Release:
    """A section without load, as a body for `passing`: its unknowns are eigenstress, constant in x.

    Parameters
    ----------
    virgin : state before any load
    """

    def __init__(self, modes: Modes, virgin: PrismState) -> None:
        self._modes, self._virgin = modes, virgin
        self.weights = modes.weights[:, None]
        self.at_rest = np.zeros((len(self.weights), 1, 6))

    @property
    def rough(self) -> _Release:
        """The section itself: see `PassedBody`."""
        return self

    def solve(self, eigenstress: Array) -> Array:
        """Return the eigenstress (n_points, 1, 6)."""
        return eigenstress

    def strain(self, eigenstress: Array) -> Array:
        """Return the strain (n_points, 1, 6) of an eigenstress."""
        return self._modes.constant(eigenstress[:, 0])[0][:, None]

    def flow(self, law: Law, end: PrismState, added: Array, parts: int) -> _ReleaseFlow:
        """Return the flow from a state to the strain before any load and ``added``."""
        return _ReleaseFlow(self._modes, law, self._virgin, end, added, parts)


class _ReleaseFlow(_Swept):
    """The flow from the last station to the state without load: one column."""

    def __init__(
        self, modes: Modes, law: Law, virgin: PrismState, end: PrismState, added: Array, parts: int
    ) -> None:
        super().__init__(law, end, virgin, virgin.strain[:, None] + added, parts)
        self._modes, self._virgin = modes, virgin

    def left(self) -> tuple[PlasticState, PrismState]:
        """Return the internal variables, and the state without load."""
        moved = self._modes.constant(self.force[:, 0])[1].reshape(3, -1).T
        return self.states, self._last(self._virgin.displacement + moved)
