"""Loads of a steady pass: forces and displacements that may depend on the surface's shape."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from solver.typing import Array


@dataclass(frozen=True, slots=True)
class AppliedLoad:
    """A load on a body, which has its own kind of field.

    Attributes
    ----------
    force : forces of the load on the body [N]; on a track (n,), at all nodes
    u : field with the load; on a track displacements (m,) of the kept unknowns [mm]
    along : (change of the field without the load) -> change of ``u``
    """

    force: Array
    u: Any
    along: Callable[[Any], Any]


class PassingLoad(Protocol):
    """A load that passes over a body along +x."""

    def on(self, u: Any) -> AppliedLoad:
        """Return the applied load, given the field of the body without it."""

    def scaled(self, share: float) -> PassingLoad:
        """Return the same load with its forces times ``share``."""

    def driven(self, share: float) -> PassingLoad:
        """Return the same load with its driving or braking moment times ``share``."""

    @property
    def moment(self) -> float:
        """Prescribed moment over radius [N], positive when braking; 0 if none is prescribed."""

    @property
    def slipping(self) -> PassingLoad:
        """The same load with the moment at which all of its contact slips, if it has a moment."""


@dataclass(frozen=True, slots=True)
class Given:
    """Constant nodal forces (n,) [N], and the displacements (m,) that they cause [mm]."""

    force: Array
    u: Array

    def on(self, u: Array) -> AppliedLoad:
        """See `PassingLoad`."""
        return AppliedLoad(self.force, u + self.u, lambda change: change)

    def scaled(self, share: float) -> Given:
        """See `PassingLoad`."""
        return Given(share * self.force, share * self.u)

    def driven(self, share: float) -> Given:
        """See `PassingLoad`; a given shear is not changed."""
        return self

    @property
    def moment(self) -> float:
        """See `PassingLoad`."""
        return 0.0

    @property
    def slipping(self) -> Given:
        """See `PassingLoad`."""
        return self
