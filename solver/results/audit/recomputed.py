"""Interface of the recomputed results with which a record is compared."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from solver.results.audit.plain import PlainBody
from solver.typing import Array


class BodyFields(Protocol):
    """Fields of one body in one state; NaN where they are not known.

    Attributes
    ----------
    plain : the body
    stress : (n_components, n_nodes) components xx, yy, zz, xy (, yz, zx) at its nodes [MPa]
    mises : (n_nodes,) von Mises stress [MPa]
    accumulated : (n_nodes,) accumulated plastic strain; recovery may make it negative
    strain, plastic_tensor : (n_components, n_nodes) strain and plastic strain, of states by
        increments alone
    displacement : (n_axes, n_nodes) [mm]
    at_points : positions (n_axes, n) [mm], von Mises stress (n,) [MPa] and plastic strain (n,) at
        points
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
    def strain(self) -> Array:
        """See above."""

    @property
    def plastic_tensor(self) -> Array:
        """See above."""

    @property
    def displacement(self) -> Array:
        """See above."""

    @property
    def at_points(self) -> tuple[Array, Array, Array]:
        """See above."""


class Acting(NamedTuple):
    """Pressure, shear along +s on the lower body [MPa] and gap [mm] at places (n,), or NaN.

    ``way`` is how far the surfaces have moved [mm]; ``measured`` says that gaps are means with
    another projection than the solver's.
    """

    pressure: Array
    shear: Array
    gap: Array
    way: float = 0.0
    measured: bool = False


class Recomputed(Protocol):
    """The recomputed results of a run."""

    def plain(self, name: str) -> PlainBody:
        """Return a body."""

    def fields(self, name: str, stage: str) -> BodyFields:
        """Return the fields of a body in a state."""

    def exact(self, stage: str) -> bool:
        """Return whether its fields in a state are exact up to rounding."""

    def centre(self, stage: str) -> float:
        """Return the position of s = 0 along the axis of the view in a state [mm]."""

    def acting(self, stage: str, x: Array) -> Acting:
        """Return pressure, shear and gap at places (n,) along the axis of the view."""

    def extent(self, stage: str) -> tuple[float, float, float]:
        """Return bounds of the contact's half-width, least and largest [mm], and its peak [MPa]."""
