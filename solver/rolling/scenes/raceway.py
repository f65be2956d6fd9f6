"""Ball or roller rolling along a raceway, in three dimensions; the ellipse of its elastic contact.

The raceway is a block, flat or with a groove, elastic-plastic in a zone under the contact, without
ends and straight along x, held at its foot. The ball or roller is an elastic half-space with the
shape of its two radii; or with ``load = "hertz"`` there is none, but the pressure of its elastic
Hertz contact with shear in proportion, which does not change while the raceway yields. Passes are
steady: in the frame of the load nothing changes. Coordinates are x along the raceway, y up from the
lowest line of the groove, z across; x = 0 is at the load. A positive ``traction`` brakes.

A.R.S. Ponter, A.D. Hearle, K.L. Johnson, J. Mech. Phys. Solids 33 (1985) 339-362.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.late import late
from solver.model.friction import coefficient
from solver.parameters import Fraction, Length, Ratio, Stress, described
from solver.rolling.scenes.rail_scene import PrismParameters, rail_scene
from solver.rolling.scenes.wheel_parameters import ROLLED, check_given_shear

ELEMENTS: Mapping[str, int] = {"draft": 4, "standard": 6, "fine": 10}
"""Elements per semi-axis of the elastic Hertz contact: across, along, and in depth for the shorter
one. The largest shear under a circle, which decides shakedown without friction, is 3 % too small
with 4 of them, 0.3 % with 6."""
BESIDE = 1.5
"""Half the width along the surface of the zone that may yield, over b."""
_STEEPEST = math.radians(60.0)
"""Largest slope of ball, roller and groove in the zone [rad]."""
MOST_LONG = 25.0
"""Largest ratio of the semi-axes: a longer contact is nearly a line."""
_LONGEST = 0.2
"""Largest semi-axis along the raceway, over the relative radius: the ball or roller must be above
all stations at which it may touch."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RacewayParameters(PrismParameters):
    """Parameters of a ball or roller on a raceway (N, mm, MPa)."""

    yield_stress: Stress = described(1500.0, "uniaxial yield stress Re of the raceway")
    load: Literal["contact", "hertz"] = described(
        "contact",
        "a ball or roller in contact, or the pressure of its elastic Hertz contact with shear in "
        "proportion",
    )
    load_by: Literal["load_ratio", "force"] = described(
        "load_ratio", "the parameter that gives the load"
    )
    load_ratio: Ratio = described(
        2.5,
        "ratio of the peak pressure p0 of the elastic Hertz contact to the yield stress",
        needs={"load_by": ("load_ratio",)},
    )
    force: Annotated[float, Interval(gt=0.0, le=1e9), Unit("N")] = described(
        2000.0, "vertical force on the ball or roller", needs={"load_by": ("force",)}
    )
    friction: Fraction = coefficient(0.1, ROLLED)
    radius: Length = described(10.0, "radius of the ball or roller in the plane of rolling")
    crown_radius: Annotated[
        Annotated[float, Interval(gt=0.0, le=1e6)] | Literal["same"], Unit("mm")
    ] = described(
        "same", "radius of the ball or roller across the raceway; same: a ball, this is `radius`"
    )
    ring_radius: Annotated[
        Annotated[float, Interval(ge=-1e6, le=1e6)] | Literal["straight"], Unit("mm")
    ] = described(
        "straight",
        "radius of the raceway along the rolling direction, at the lowest line of its groove: "
        "positive for an inner ring, negative for an outer ring, which is hollow",
    )
    groove_radius: Annotated[
        Annotated[float, Interval(gt=0.0, le=1e6)] | Literal["flat", "conformity"], Unit("mm")
    ] = described(
        "flat",
        "radius of the groove across the raceway; flat: without a groove; conformity: "
        "`conformity` gives it",
    )
    conformity: Annotated[float, Interval(gt=0.5, le=100.0), Unit("1")] = described(
        0.52,
        "radius of the groove over the diameter of the ball, of a roller over twice its "
        "`crown_radius`",
        needs={"groove_radius": ("conformity",)},
    )

    def __post_init__(self) -> None:
        PrismParameters.__post_init__(self)
        for name, usual in (("control", "moment"), ("lateral_creepage", 0.0)):
            value = getattr(self, name)
            if self.load == "hertz" and value != usual:
                raise ModelError(name, value, f"must be {usual}: load = hertz has no wheel")
        if self.load == "hertz":
            check_given_shear(self)
        if not (self.ring > 0 or -self.ring > self.radius):
            allowed = f"must be positive, or below {-self.radius:g} for a hollow raceway"
            raise ModelError("ring_radius", self.ring_radius, allowed)
        if not self.groove > self.across:
            allowed = f"must be greater than {self.across:g}, the radius across the ball or roller"
            raise ModelError("groove_radius", self.groove_radius, allowed)
        self._check_ellipse()

    def _check_ellipse(self) -> None:
        """Raise `ModelError` if the elastic Hertz contact is too long or too wide.

        The bound in the message is itself an allowed value.
        """
        ellipse = self.ellipse
        if ellipse.ratio > MOST_LONG:
            name, limit, least = self._bound(wide=ellipse.b > ellipse.a)
            raise ModelError(
                name, getattr(self, name),
                f"must be {'at least' if least else 'at most'} {limit:.12g}: the semi-axes of its "
                f"Hertz ellipse have a ratio of {ellipse.ratio:.3g}; the largest is {MOST_LONG:g}",
            )  # fmt: skip
        sizes = (
            ("along x", ellipse.a, _LONGEST * self.rolling),
            ("across", ellipse.b, self.room / BESIDE),
        )
        way, axis, most = min(sizes, key=lambda each: each[2] / each[1])
        if axis > most:
            power = 3 if self.load_by == "force" else 1  # of a semi-axis
            given = getattr(self, self.load_by)
            raise ModelError(
                self.load_by, given,
                f"must be at most {_rounded(given * (most / axis) ** power):.12g}: the semi-axis "
                f"{way} is {axis:.4g} mm; the largest is {most:.4g} mm",
            )  # fmt: skip

    def _bound(self, wide: bool) -> tuple[str, float, bool]:
        """Return a parameter, its value at the largest ratio, and whether this is a lower bound.

        The parameter is the groove or its conformity, where these can give the ratio; otherwise the
        crown.
        """
        relative = self.rolling * radii_of(MOST_LONG) ** (1 if wide else -1)
        by_conformity = self.groove_radius == "conformity"
        name, lowest, most = "groove_radius", self.across, 1e6
        if by_conformity:
            name, lowest, most = "conformity", 0.5, 100.0
        straight = 1 - self.across / relative
        limit = lowest / straight if straight > 0 else math.inf
        if self.groove < math.inf and limit <= most:
            return name, _rounded(limit, lowest, up=wide), wide
        of_groove = 1 - 1 / (2 * self.conformity) if by_conformity else 1.0
        limit = 1 / (1 / relative + (0.0 if by_conformity else 1 / self.groove)) * of_groove
        return "crown_radius", _rounded(limit, up=not wide), not wide

    @property
    def across(self) -> float:
        """Radius of the ball or roller across the raceway [mm]."""
        return self.radius if self.crown_radius == "same" else float(self.crown_radius)

    @property
    def groove(self) -> float:
        """Radius of the groove, inf without one [mm]."""
        if self.groove_radius == "flat":
            return math.inf
        if self.groove_radius == "conformity":
            return 2 * self.conformity * self.across
        return float(self.groove_radius)

    @property
    def ring(self) -> float:
        """Radius of the raceway along x, inf if it is straight [mm]."""
        return math.inf if self.ring_radius == "straight" else float(self.ring_radius)

    @property
    def rolling(self) -> float:
        """Relative radius of ball or roller and raceway along x [mm]."""
        return 1 / (1 / self.radius + 1 / self.ring)

    @property
    def room(self) -> float:
        """Half the width of the largest zone, along the surface [mm]."""
        most = self.across * math.sin(_STEEPEST)
        return most if self.groove == math.inf else self.groove * math.asin(most / self.groove)

    @property
    def ellipse(self) -> HertzEllipse:
        """The elastic Hertz contact."""
        own = {
            "load_ratio": {"peak_pressure": self.load_ratio * self.yield_stress},
            "force": {"force": self.force},
        }
        radii = self.rolling, 1 / (1 / self.across - 1 / self.groove)
        return HertzEllipse.of(radii, self.contact_modulus, **own[self.load_by])

    @property
    def size(self) -> tuple[float, float]:
        """Semi-axes for mesh and places of results, rounded so that runs share meshes [mm]."""
        return float(f"{self.ellipse.a:.3g}"), float(f"{self.ellipse.b:.3g}")

    @property
    def below(self) -> float:
        """Scale of depth [mm]: the root of a b, at most twice the shorter semi-axis.

        The stress of a contact that is nearly a line falls with depth over its shorter semi-axis.
        """
        a, b = self.size
        return min(math.sqrt(a * b), 2 * min(a, b))

    @property
    def elements(self) -> int:
        """Elements per semi-axis."""
        return ELEMENTS[self.accuracy]


def _rounded(limit: float, lowest: float = 0.0, *, up: bool = False) -> float:
    """Return a limit whose excess over the lowest value is rounded up or down to five digits."""
    above = max(limit - lowest, 1e-9 * limit)
    digit = 10.0 ** (math.floor(math.log10(above)) - 4)
    return digit * (math.ceil if up else math.floor)(limit / digit)


(_geometry,) = late("rolling.scenes.raceway_setup", "geometry")

RACEWAY = rail_scene(
    "raceway",
    "ball or roller rolling along an elastic-plastic raceway, in three dimensions",
    RacewayParameters,
    geometry=_geometry,
    outputs=(
        *late("rolling.scenes.rail_outputs", "cycles"),
        *late("rolling.scenes.raceway_setup", "elastic"),
    ),
)


_LONGEST_ELLIPSE = 1e6
"""Largest ratio of the semi-axes that is computed; longer ellipses get this ratio."""
_HALVINGS = 60
_MEANS = 9
"""Steps of the arithmetic-geometric mean; they converge quadratically."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HertzEllipse:
    """A frictionless elastic contact, pressure p0 sqrt(1 - (x/a)^2 - (z/b)^2).

    Attributes
    ----------
    a, b : semi-axes along x and z [mm]
    peak_pressure : p0 [MPa]
    approach : of the bodies, if both are half-spaces [mm]

    References
    ----------
    K.L. Johnson, Contact Mechanics (1985), (4.25) to (4.28)
    """

    a: float
    b: float
    peak_pressure: float
    approach: float

    @classmethod
    def of(
        cls,
        radii: tuple[float, float],
        modulus: float,
        *,
        peak_pressure: float | None = None,
        force: float | None = None,
    ) -> HertzEllipse:
        """Return the contact for a peak pressure or a force.

        Parameters
        ----------
        radii : relative radii in the planes of x and z, each 1 / (1/R1 + 1/R2) [mm]
        modulus : E*, 1/E* is the sum of (1 - nu^2)/E [MPa]
        """
        long, short = max(radii), min(radii)
        ratio = _ratio(long / short)
        K, D = _integrals(ratio)
        steepness = modulus / (2 * long * ratio * D)  # p0 over the longer semi-axis
        if peak_pressure is None:
            assert force is not None
            peak_pressure = (1.5 * force * steepness**2 / (math.pi * ratio)) ** (1 / 3)
        longer = peak_pressure / steepness
        axes = longer, ratio * longer
        a, b = axes if radii[0] >= radii[1] else axes[::-1]
        return cls(
            a=a, b=b, peak_pressure=peak_pressure,
            approach=peak_pressure * ratio * longer * K / modulus,
        )  # fmt: skip

    @property
    def ratio(self) -> float:
        """The longer over the shorter semi-axis."""
        return max(self.a / self.b, self.b / self.a)

    @property
    def force(self) -> float:
        """Force [N]."""
        return 2 / 3 * math.pi * self.a * self.b * self.peak_pressure


def radii_of(ratio: float) -> float:
    """Return the ratio of relative radii, at least 1, of an ellipse with this ratio of semi-axes.

    The ratio of the semi-axes may be longer over shorter, or shorter over longer.
    """
    short = min(ratio, 1 / ratio)
    K, D = _integrals(short)
    return (K - D) / (short**2 * D)


def _ratio(radii: float) -> float:
    """Return the shorter over the longer semi-axis for the ratio of radii, at least 1."""
    low, high = 1 / _LONGEST_ELLIPSE, 1.0
    for _ in range(_HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if radii_of(middle) > radii else (low, middle)
    return high


def _integrals(ratio: float) -> tuple[float, float]:
    """Return the complete elliptic integrals K and D = (K - E) / e^2, e^2 = 1 - ratio^2.

    M. Abramowitz, I.A. Stegun, Handbook of Mathematical Functions (1964), 17.6: means a, g and
    halves of their difference c; (K - E) / K is the sum of 2^(n-1) c_n^2, with c_0 = e.
    """
    a, g = (1 + ratio) / 2, math.sqrt(ratio)
    square, share = ((1 - ratio) / 2) ** 2, (1 - ratio) / (4 * (1 + ratio))  # c^2, c^2 / e^2
    total, factor = 0.5 + share, 1.0
    for _ in range(_MEANS):
        a, g = (a + g) / 2, math.sqrt(a * g)
        change = square / (16 * a**2)  # c_n+1 = c_n^2 / (4 a_n+1)
        square, share, factor = square * change, share * change, 2 * factor
        total += factor * share
    K = math.pi / (2 * a)
    return K, K * total
