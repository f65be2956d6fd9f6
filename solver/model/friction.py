"""Laws of friction: the largest contact shear over the contact pressure.

A law says it as lines ``slope * pressure + stress``, of which the least counts: a bound that is
concave and piecewise linear, zero without pressure, and never falls. This is all that the contact
problem, which is solved exactly, needs to know of friction. `Coulomb` is the law of the package; a
law of one's own is a class in a file of one's own.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np
from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.parameters import Friction, described
from solver.parts import Parts

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Value = float | NDArray[np.float64]

LEAST_FRICTION = 1e-10
"""A coefficient of friction up to this value counts as zero. The forces it allows are below the
tolerance of normal forces in the contact problem: a hundredth of the out-of-balance force and a
thousandth of the contact violation that an increment may leave."""
_CONCAVE = 1e-12
"""Rounding of slopes, relative to the steepest."""


class BoundLines(NamedTuple):
    """Lines (n_lines, n) over load, at n places; the least of them is the bound.

    Attributes
    ----------
    slope : of the lines [1]
    level : of the lines without load: [MPa] where the load is a pressure, [N] where it is a force
    """

    slope: Array
    level: Array

    @classmethod
    def none(cls, n: int) -> BoundLines:
        """Return the lines of n places without friction."""
        return cls(np.zeros((1, n)), np.zeros((1, n)))

    @classmethod
    def joined(cls, each: Sequence[BoundLines]) -> BoundLines:
        """Return the lines of all places, one after the other."""
        ends = np.cumsum([0, *(lines.slope.shape[1] for lines in each)])
        most = max((len(lines.slope) for lines in each), default=1)
        whole = cls(np.zeros((most, ends[-1])), np.full((most, ends[-1]), np.inf))
        for first, last, lines in zip(ends[:-1], ends[1:], each, strict=True):
            for of, own in zip(whole, lines, strict=True):
                of[: len(own), first:last] = own
        return whole

    @property
    def rough(self) -> NDArray[np.bool_]:
        """Which places (n,) can bear shear."""
        return np.asarray(self.least(np.ones(self.slope.shape[1])) > 0)

    def least(self, load: Array) -> Array:
        """Return the bound (n,) under loads (n,)."""
        return np.asarray((self.slope * np.maximum(load, 0) + self.level).min(axis=0))

    def piece(self, load: Array) -> NDArray[np.int64]:
        """Return which line (n,) is the least under loads (n,)."""
        return np.asarray((self.slope * load + self.level).argmin(axis=0))

    def at(self, places: NDArray[np.int64]) -> BoundLines:
        """Return the lines of some places."""
        return BoundLines(self.slope[:, places], self.level[:, places])

    def over(self, area: Array) -> BoundLines:
        """Return the lines of force over force, from those of shear over pressure."""
        finite = np.isfinite(self.level)
        level = np.multiply(self.level, area, out=self.level.copy(), where=finite)
        return BoundLines(self.slope, level)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContactPlaces:
    """What a law may ask of the n vertices of a slave; computed only where the law uses it.

    Attributes
    ----------
    n : number of vertices
    """

    n: int
    find_strength: Callable[[], Array]
    find_plastic_strain: Callable[[], Array]
    find_slip: Callable[[], Array]

    @property
    def strength(self) -> Array:
        """Initial shear yield stress (n,) of the weaker body, in heat that of the hot one [MPa].

        It is that at the end of the increment; inf between elastic bodies.
        """
        return self.find_strength()

    @property
    def plastic_strain(self) -> Array:
        """Accumulated plastic strain (n,) of the slave's surface as the increment begins."""
        return self.find_plastic_strain()

    @property
    def slip(self) -> Array:
        """Sum of all slip (n,), forth and back, until the increment begins [mm]."""
        return self.find_slip()


class FrictionLaw(ABC):
    """A law of friction; one of one's own is a frozen dataclass that inherits from it."""

    __slots__ = ()

    @abstractmethod
    def bound(self, at: ContactPlaces) -> Sequence[tuple[Value, Value]]:
        """Return the lines (slope, stress in MPa) whose least is the largest shear.

        Each is a number, or an array (n,) of one for each vertex. What a law asks of the state is
        that at the beginning of the increment: within it the lines do not change.
        """

    @property
    def rough(self) -> bool:
        """Whether it bears any shear; otherwise the tangential unknowns are left out."""
        return True

    @property
    def proportional(self) -> bool:
        """Whether its bound is proportional to pressure, always and everywhere the same."""
        return False

    def check_bodies(self, *, elastic: bool) -> None:
        """Raise `ModelError` where it does not fit a pair of bodies, both ``elastic`` or not."""
        del elastic


FRICTION: Parts[FrictionLaw] = Parts("friction_law")
"""Laws by the words that studies and scene files name them by."""


@FRICTION.word("coulomb")
@dataclass(frozen=True, slots=True, kw_only=True)
class Coulomb(FrictionLaw):
    """Coulomb's law with cohesion and a limit of shear; see `solver.ContactPair`.

    Where the pressure is below the cohesion it stands in its place: a jump at no pressure would
    leave many problems without a solution.
    """

    friction: Friction = described(0.0, "Coulomb friction coefficient")
    shear_limit: Annotated[float, Interval(ge=0.0, le=10.0), Unit("1")] = described(
        0.0, "largest contact shear / shear yield stress of the weaker body; 0 sets no limit"
    )
    cohesion: Annotated[float, Interval(ge=0.0, le=1e7), Unit("MPa")] = described(
        0.0, "contact shear beyond friction * pressure; no more than the pressure itself"
    )

    def __post_init__(self) -> None:
        if not (np.isfinite(self.friction) and self.friction >= 0):
            raise ModelError("friction", self.friction, "must be finite and at least 0")
        if not (np.isfinite(self.cohesion) and self.cohesion >= 0):
            raise ModelError("cohesion", self.cohesion, "must be finite and at least 0 [MPa]")
        if not self.shear_limit >= 0:
            raise ModelError("shear_limit", self.shear_limit, "must be at least 0")

    @property
    def _limited(self) -> bool:
        return 0 < self.shear_limit < math.inf

    @property
    def rough(self) -> bool:
        """See `FrictionLaw`."""
        return effective_friction(self.friction) > 0 or self.cohesion > 0

    @property
    def proportional(self) -> bool:
        """See `FrictionLaw`."""
        return not (self._limited or self.cohesion)

    def check_bodies(self, *, elastic: bool) -> None:
        """See `FrictionLaw`: a limit refers to a yield stress."""
        if elastic and self._limited:
            raise ModelError(
                "shear_limit", self.shear_limit,
                "must be inf between elastic bodies: there is no yield stress to refer to",
            )  # fmt: skip

    def bound(self, at: ContactPlaces) -> list[tuple[Value, Value]]:
        """See `FrictionLaw`."""
        mu = effective_friction(self.friction)
        lines: list[tuple[Value, Value]] = [(mu, 0.0)]
        if self.cohesion:
            lines = [(mu + 1, 0.0), (mu, self.cohesion)]
        if self._limited:
            lines.append((0.0, self.shear_limit * at.strength))
        return lines


def effective_friction(friction: float) -> float:
    """Return the coefficient that the solver uses: zero up to `LEAST_FRICTION`."""
    return friction if friction > LEAST_FRICTION else 0.0


def lines_of(law: FrictionLaw, at: ContactPlaces) -> BoundLines:
    """Return the lines of shear over pressure that a law gives, checked.

    Raises
    ------
    ModelError
        naming the law, where its lines are no bound
    """
    if not law.rough:
        return BoundLines.none(at.n)
    each = law.bound(at)
    try:
        found = BoundLines(*np.empty((2, len(each), at.n)))
        for k, (slope, level) in enumerate(each):
            found.slope[k], found.level[k] = slope, level
        least = found.level.min(axis=0)
    except (TypeError, ValueError):
        allowed = f"must give lines (slope, stress), of numbers or of arrays ({at.n},)"
        raise ModelError("friction_law", law, allowed) from None
    wrong = found.slope[~((found.slope >= 0) & np.isfinite(found.slope))]
    if wrong.size:
        allowed = f"must give slopes that are finite and at least 0, not {wrong[0]:.4g}"
        raise ModelError("friction_law", law, allowed)
    if least.any():  # NaN is not zero either
        allowed = "must give a bound that is zero without pressure: the least stress of its lines "
        raise ModelError("friction_law", law, f"{allowed}is {least[least != 0][0]:.4g} MPa")
    return found


def through(pressure: Sequence[float], shear: Sequence[float]) -> list[tuple[Value, Value]]:
    """Return the lines of a bound through points [MPa]: those between neighbours.

    The first point is (0, 0); beyond the last one the bound goes on along the last line.

    Raises
    ------
    ModelError
        if the points do not make a concave bound that never falls
    """
    p, s = np.asarray(pressure, dtype=float), np.asarray(shear, dtype=float)
    whole = p.shape == s.shape and p.ndim == 1 and len(p) > 1 and p[0] == s[0] == 0.0
    if not (whole and (np.diff(p) > 0).all()):
        allowed = "must be as many as shears, at least two, growing; the first point is (0, 0)"
        raise ModelError("pressure", list(pressure), allowed)
    slope = np.diff(s) / np.diff(p)
    if not ((slope >= 0).all() and (np.diff(slope) <= _CONCAVE * slope.max()).all()):
        allowed = f"must be concave and must not fall: slopes are {slope.round(6).tolist()}"
        raise ModelError("shear", list(shear), allowed)
    return list(zip(slope.tolist(), np.maximum(s[:-1] - slope * p[:-1], 0.0).tolist(), strict=True))
