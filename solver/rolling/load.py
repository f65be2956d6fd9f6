"""The load that passes over a body along +x: its force and motion, and how it acts on the body."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from solver.errors import Spins
from solver.parameters import Checked, Positive
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
