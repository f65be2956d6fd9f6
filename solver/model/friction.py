"""Friction laws: the largest contact shear as a function of the contact pressure.

A law gives lines ``slope * pressure + stress``; the least of them is the bound. This piecewise
linear bound must be zero without pressure, concave, and must not decrease. The contact problem,
which is solved exactly, needs only these lines. `Coulomb` is the law of the package; your own law
is a class in a file of your own.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.parameters import Checked, Friction, Needs, Other, described
from solver.parts import Parts
from solver.typing import Array, Bools, Ints

Value = float | Array


class PatchStatus(IntEnum):
    """The state of a place in a contact."""

    OPEN = 0
    STICK = 1
    SLIP = 2


LEAST_FRICTION = 1e-10
"""Coefficient of friction up to which it counts as zero. Its forces are below the tolerance of
normal forces in the contact problem: a hundredth of the out-of-balance force, and a thousandth of
the contact violation, that an increment permits."""
_CONCAVE = 1e-12
"""Increase of slope that counts as rounding, over the steepest slope."""


class BoundLines(NamedTuple):
    """Lines (n_lines, n) over load, at n places; the least of them is the bound.

    Attributes
    ----------
    slope : slopes of the lines [1]
    level : values of the lines without load: [MPa] if the load is a pressure, [N] if a force
    """

    slope: Array
    level: Array

    @classmethod
    def none(cls, n: int) -> BoundLines:
        """Return the lines of n places without friction."""
        return cls(np.zeros((1, n)), np.zeros((1, n)))

    @classmethod
    def joined(cls, each: Sequence[BoundLines]) -> BoundLines:
        """Return the lines of several sets of places as one, in order."""
        ends = np.cumsum([0, *(lines.slope.shape[1] for lines in each)])
        most = max((len(lines.slope) for lines in each), default=1)
        whole = cls(np.zeros((most, ends[-1])), np.full((most, ends[-1]), np.inf))
        for first, last, lines in zip(ends[:-1], ends[1:], each, strict=True):
            for of, own in zip(whole, lines, strict=True):
                of[: len(own), first:last] = own
        return whole

    @property
    def rough(self) -> Bools:
        """Whether places (n,) can carry shear."""
        return np.asarray(self.least(np.ones(self.slope.shape[1])) > 0)

    def least(self, load: Array) -> Array:
        """Return the bound (n,) for loads (n,)."""
        return np.asarray((self.slope * np.maximum(load, 0) + self.level).min(axis=0))

    def piece(self, load: Array) -> Ints:
        """Return the number (n,) of the line that is the least for loads (n,)."""
        return np.asarray((self.slope * load + self.level).argmin(axis=0))

    def at(self, places: Ints) -> BoundLines:
        """Return the lines of some places."""
        return BoundLines(self.slope[:, places], self.level[:, places])

    def over(self, area: Array) -> BoundLines:
        """Return lines of force over force from lines of shear over pressure, for areas (n,)."""
        finite = np.isfinite(self.level)
        level = np.multiply(self.level, area, out=self.level.copy(), where=finite)
        return BoundLines(self.slope, level)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContactPlaces:
    """Values at the n vertices of a slave that a friction law may use; computed on first use.

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
        """Initial shear yield stress (n,) of the weaker body at its temperature [MPa].

        The temperature is that at the end of the increment; inf between elastic bodies.
        """
        return self.find_strength()

    @property
    def plastic_strain(self) -> Array:
        """Accumulated plastic strain (n,) of the slave's surface at the start of the increment."""
        return self.find_plastic_strain()

    @property
    def slip(self) -> Array:
        """Accumulated length of slip (n,) in both directions at the start of the increment [mm]."""
        return self.find_slip()


class FrictionLaw(Checked, ABC):
    """A friction law; your own is a frozen dataclass that inherits from it."""

    __slots__ = ()

    @abstractmethod
    def bound(self, at: ContactPlaces) -> Sequence[tuple[Value, Value]]:
        """Return the lines (slope [1], stress [MPa]); the least of them is the largest shear.

        Slope and stress are numbers or arrays (n,) over the vertices. ``at`` has the state at the
        beginning of the increment: within an increment the lines are constant.
        """

    @property
    def rough(self) -> bool:
        """Whether it permits any shear; otherwise the tangential unknowns are left out."""
        return True

    @property
    def proportional(self) -> bool:
        """Whether its bound is proportional to pressure, with the same factor everywhere."""
        return False

    def check_bodies(self, *, elastic: bool) -> None:
        """Raise `ModelError` if the law does not suit the bodies; ``elastic``: both are elastic."""


def coefficient(default: float, needs: Needs | None = None) -> Any:
    """Return the field of Coulomb's coefficient, with its default and what it needs."""
    return described(default, "Coulomb friction coefficient", needs=needs)


FRICTION: Parts[FrictionLaw] = Parts("friction_law")
"""Friction laws by the words that name them in studies and scene files."""


@FRICTION.word("coulomb")
@dataclass(frozen=True, slots=True, kw_only=True)
class Coulomb(FrictionLaw):
    """Coulomb's law with cohesion and a limit of shear.

    The shear is at most ``friction * pressure + min(cohesion, pressure)``: a jump of the bound at
    zero pressure would leave many problems without a solution. The limit refers to the initial
    yield stress of the weaker body or, if heat lowers it (`Temperature`), to that of the surfaces
    at the end of the increment. If friction permits more shear than the material, the surface layer
    flows instead of slipping, and its strain grows as the mesh is refined.
    """

    friction: Friction = coefficient(0.0)
    shear_limit: Annotated[float, Interval(ge=0.0, le=10.0), Unit("1")] = described(
        0.0,
        "ratio of the largest contact shear to the shear yield stress of the weaker body; 0 sets "
        "no limit",
        needs={"friction": Other(0.0), "cohesion": Other(0.0)},
    )
    cohesion: Annotated[float, Interval(ge=0.0, le=1e7), Unit("MPa")] = described(
        0.0, "contact shear beyond friction * pressure; no more than the pressure itself"
    )

    @property
    def rough(self) -> bool:
        """See `FrictionLaw`."""
        return effective_friction(self.friction) > 0 or self.cohesion > 0

    @property
    def proportional(self) -> bool:
        """See `FrictionLaw`."""
        return not (self.shear_limit or self.cohesion)

    def check_bodies(self, *, elastic: bool) -> None:
        """See `FrictionLaw`: a shear limit refers to a yield stress."""
        if elastic and self.shear_limit:
            raise ModelError(
                "shear_limit", self.shear_limit,
                "must be 0 between elastic bodies: there is no yield stress to refer to",
            )  # fmt: skip

    def bound(self, at: ContactPlaces) -> list[tuple[Value, Value]]:
        """See `FrictionLaw`."""
        mu = effective_friction(self.friction)
        lines: list[tuple[Value, Value]] = [(mu, 0.0)]
        if self.cohesion:
            lines = [(mu + 1, 0.0), (mu, self.cohesion)]
        if self.shear_limit:
            lines.append((0.0, self.shear_limit * at.strength))
        return lines


def effective_friction(friction: float) -> float:
    """Return the coefficient that the solver uses: zero up to `LEAST_FRICTION`."""
    return friction if friction > LEAST_FRICTION else 0.0


def lines_of(law: FrictionLaw, at: ContactPlaces) -> BoundLines:
    """Return the lines of shear over pressure of a law, after a check.

    Raises
    ------
    ModelError
        naming the law, if its lines are no permitted bound
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


def pressure_lines(law: FrictionLaw, n: int, strength: float) -> BoundLines:
    """Return the lines of a law that depends on pressure alone, at n places of one strength [MPa].

    Raises
    ------
    ModelError
        naming the law, if it asks for slip or plastic strain; naming its shear limit, if the body
        is elastic, of infinite strength
    """
    if not isinstance(law, FrictionLaw):
        raise ModelError("friction", law, "must be a law, such as Coulomb(friction=0.3)")
    law.check_bodies(elastic=bool(np.isinf(strength)))

    def nothing() -> Array:
        allowed = "must not depend on slip or plastic strain on a track without ends"
        raise ModelError("friction_law", law, allowed)

    places = ContactPlaces(
        n=n,
        find_strength=lambda: np.full(n, strength),
        find_plastic_strain=nothing,
        find_slip=nothing,
    )
    return lines_of(law, places)


def through(pressure: Sequence[float], shear: Sequence[float]) -> list[tuple[Value, Value]]:
    """Return the lines of a piecewise linear bound through points (pressure, shear) [MPa].

    The first point is (0, 0); beyond the last one the bound continues along the last line.

    Raises
    ------
    ModelError
        if the points do not make a concave bound that does not decrease
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
