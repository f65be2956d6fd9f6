"""The load that passes over a body along +x, and the body as a steady pass uses it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Generic, Protocol, Self, TypeVar

import numpy as np

from solver.errors import Spins
from solver.materials.law import Law
from solver.materials.state import PlasticState
from solver.parameters import Checked, Positive
from solver.rolling.flow import Sweep
from solver.typing import Array

FULL_SLIP = 1.0
"""Creepage of a wheel that does not turn: all of its contact slips."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RollingLoad(Checked):
    """Force and motion of a wheel; a moment or force that is None is not prescribed.

    Attributes
    ----------
    force : vertical force on the body [N]
    drive : moment on the axle over radius, positive when braking [N]; None if ``creepage`` is given
    lateral_force : force on the body along z [N]; None if ``lateral_creepage`` is given
    creepage, lateral_creepage, spin : prescribed motion, see the wheel [1, 1, 1/mm]

    Raises
    ------
    ModelError
        if a number is not finite, or the force is not positive
    """

    force: Positive
    drive: float | None = None
    lateral_force: float | None = None
    creepage: float = 0.0
    lateral_creepage: float = 0.0
    spin: float = 0.0

    def scaled(self, share: float) -> RollingLoad:
        """Return the load with its forces and its moment times ``share``."""
        drive = None if self.drive is None else share * self.drive
        lateral = None if self.lateral_force is None else share * self.lateral_force
        return replace(self, force=share * self.force, drive=drive, lateral_force=lateral)

    def driven(self, share: float) -> RollingLoad:
        """Return the load with its driving or braking moment times ``share``."""
        return replace(self, drive=None if self.drive is None else share * self.drive)

    @property
    def slipping(self) -> RollingLoad:
        """The load with a creepage at which all of the contact slips, if it has a moment."""
        if not self.drive:
            return self
        return replace(
            self, drive=None, creepage=self.creepage + FULL_SLIP * float(np.sign(self.drive))
        )


def spinning(carried: float) -> Spins:
    """Return the error for a moment of which full slip carries only a share."""
    much = f"the wheel spins: all of its contact slips at {carried:.2%} of the moment"
    return Spins(much, carried, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class AppliedLoad:
    """A load on a body, which has its own kind of field.

    Attributes
    ----------
    force : forces of the load on the body [N]; on a track (n,), at all nodes
    u : field with the load; on a track displacements (m,) of the kept unknowns [mm]
    along : (change of the field without the load) -> change of ``u``
    moment : moment on the axle over radius, positive when braking [N]
    """

    force: Array
    u: Any
    along: Callable[[Any], Any]
    moment: float = 0.0

    @property
    def start(self) -> Any:
        """The first guess for the contact of another pass."""
        return self


@dataclass(frozen=True, kw_only=True, eq=False)
class PassingLoad(ABC):
    """A load that passes over a body; never changed, only replaced.

    Attributes
    ----------
    load : its force and motion
    """

    load: RollingLoad

    @abstractmethod
    def on(self, u: Any, before: Any, start: Any = None) -> AppliedLoad:
        """Return how the load acts.

        Parameters
        ----------
        u : field of the body without the load
        before : state of the body before the pass
        start : an `AppliedLoad` to begin with, of this pass, or ``start`` of that of another one
        """

    @property
    def exact(self) -> Self:
        """The same, solved so exactly that differences of 1e-6 can be taken."""
        return self

    def changed(self, **changes: Any) -> Self:
        """Return the same with other fields, above all with another load."""
        return replace(self, **changes)


@dataclass(frozen=True, kw_only=True, eq=False)
class Given(PassingLoad):
    """Constant nodal forces (n,) [N], and the displacements (m,) that they cause [mm].

    They are given for a ``load`` of 1, which multiplies them.
    """

    force: Array
    u: Array
    load: RollingLoad = RollingLoad(force=1.0)

    def on(self, u: Array, before: Any, start: Any = None) -> AppliedLoad:
        """See `PassingLoad`; it depends on nothing."""
        factor = self.load.force
        return AppliedLoad(
            force=factor * self.force, u=u + factor * self.u, along=lambda change: change
        )


LOADED, RELEASED = 0.0, 1.0
"""Times of the states under the load and after it."""


@dataclass(frozen=True, slots=True)
class LeftState:
    """The state of a body before and after a pass, constant along x; never changed, only replaced.

    Attributes
    ----------
    state : internal variables of the law at n points across
    """

    state: PlasticState

    @property
    def plastic_strain(self) -> Array:
        """Plastic strain (n, n_components), Mandel."""
        return np.ascontiguousarray(self.state.plastic_strain.T)

    @property
    def accumulated(self) -> Array:
        """Accumulated plastic strain (n,)."""
        return self.state.accumulated


S = TypeVar("S", bound=LeftState)


class FlowPast(ABC, Generic[S]):
    """Material that flows past a load along rows of points with given strains.

    Attributes
    ----------
    states : internal variables (..., n_rows, n_columns)
    force : force or eigenstress equivalent to the plastic strain that the pass adds, as the body
        takes it
    """

    force: Array

    def __init__(self, law: Law, begin: S, sweep: Sweep) -> None:
        self._law, self._begin, self._sweep = law, begin, sweep
        self.states = sweep.states

    @property
    def ago(self) -> PlasticState:
        """Internal variables at the beginning of the last increment before each column."""
        return self._sweep.ago

    @property
    def added(self) -> Array:
        """Accumulated plastic strain (n_rows, n_columns) added since the beginning of the rows."""
        return np.asarray(self.states.accumulated - self._begin.accumulated[:, None])

    @property
    def most_added(self) -> float:
        """Largest accumulated plastic strain that the pass adds at a point."""
        return float(self.added.max())

    @property
    def beyond(self) -> str:
        """Side where the window is too small, since points yield there; else empty."""
        return ""

    @abstractmethod
    def along(self, added: Array) -> Array:
        """Return the change of ``force`` for a change of the strains."""

    @abstractmethod
    def left(self) -> tuple[PlasticState, S]:
        """Return internal variables (..., n, n_columns) at the surface, and the state behind."""


class PassedBody(Protocol[S]):
    """An elastic body with rows of points around a load; each kind of body has its own field u."""

    @property
    def weights(self) -> Array:
        """Volume of the points (n_rows, n_columns) [mm3]."""

    @property
    def at_rest(self) -> Any:
        """The field without plastic strain and load."""

    @property
    def rough(self) -> Self:
        """The same body in lower precision, for Newton's equation, which is solved to one digit."""

    def solve(self, force: Array) -> Any:
        """Return the field of a ``force`` of `FlowPast`, without the load."""

    def strain(self, u: Any) -> Array:
        """Return the strains (n_rows, n_columns, n_components) of a field, Mandel."""

    def flow(self, law: Law, before: S, added: Array, parts: int) -> FlowPast[S]:
        """Return the flow of a material along the rows."""
