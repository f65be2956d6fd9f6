"""What a record is compared with: what there is of a run that is computed anew."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Protocol

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from solver.results.audit.plain import PlainBody

    Array = NDArray[np.float64]


class BodyFields(Protocol):
    """Fields of one body in one state: stress xx, yy, zz, xy [MPa], and flow.

    Attributes
    ----------
    plain : the body
    stress, mises, accumulated : at its nodes (4, n_nodes), (n_nodes,), (n_nodes,), accumulated
        plastic strain with what recovery undershoots; NaN where they are not known
    displacement : (2, n_nodes) [mm]
    at_points : places (2, n), von Mises stress and plastic strain (n,) at points
    """

    @property
    def plain(self) -> PlainBody:
        """The body."""

    @property
    def stress(self) -> Array:
        """See above."""

    @property
    def mises(self) -> Array:
        """See above."""

    @property
    def accumulated(self) -> Array:
        """See above."""

    @property
    def displacement(self) -> Array:
        """See above."""

    @property
    def at_points(self) -> tuple[Array, Array, Array]:
        """See above."""


class Acting(NamedTuple):
    """Pressure, shear along +s on the lower body [MPa] and gap [mm] at places (n,), or NaN.

    ``way`` is how far the surfaces have moved [mm]; ``measured`` tells that gaps are means over
    other projections than those of the solver.
    """

    pressure: Array
    shear: Array
    gap: Array
    way: float = 0.0
    measured: bool = False


class Recomputed(Protocol):
    """A run, computed anew."""

    def plain(self, name: str) -> PlainBody:
        """Return a body."""

    def fields(self, name: str, stage: str) -> BodyFields:
        """Return the fields of a body in a state."""

    def exact(self, stage: str) -> bool:
        """Return whether its fields are those of the states, up to rounding."""

    def centre(self, stage: str) -> float:
        """Return where s is zero along the axis of the view in a state [mm]."""

    def acting(self, stage: str, x: Array) -> Acting:
        """Return what acts at places (n,) along the axis of the view."""

    def extent(self, stage: str) -> tuple[float, float, float]:
        """Return the least and the largest half-width [mm], and the peak [MPa] of the contact."""
