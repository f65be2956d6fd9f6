"""Elastic cylinder rolling on an elastic-plastic half-space.

Plane strain. The wheel is elastic, condensed to its rim, and turns by finite angles; its axle
carries a vertical force, advances over the track and carries the moment that makes the
longitudinal force. With ``load = "hertz"`` there is no wheel: a Hertz pressure with
proportional shear is translated instead.

The vertical force is that of an elastic Hertz contact with peak pressure
``load_ratio * yield_stress`` on the given radius: ``P = pi R p0^2 / E*`` per unit width,
``E* = E / (2 (1 - nu^2))`` for equal bodies. A positive ``traction`` brakes.

P. Marek, PhD thesis, Warsaw University of Technology (1995), section 5.2.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.late import late
from solver.loading.program import HALVINGS
from solver.materials.elastic_plastic import Material
from solver.parameters import Accuracy, Length, Other, by_accuracy, described
from solver.rolling.plane.lines import MOST_COLUMNS, window_elements
from solver.rolling.scenes.schedule import Schedule
from solver.rolling.scenes.sequence import block_of
from solver.rolling.scenes.wheel_parameters import WheelParameters, check_given_shear
from solver.scenes.scene import Scene

ENDLESS: Literal["endless"] = "endless"
"""Value of `track` for steady passes."""
Track = Annotated[Annotated[float, Interval(gt=0.0, le=1e6)] | Literal["endless"], Unit("mm")]

_ELEMENTS: Mapping[Accuracy, tuple[int, int]] = {
    "draft": (8, 4), "standard": (16, 8), "fine": (32, 16)
}  # fmt: skip
"""Elements per Hertz half-width, on an endless track and on one of given length."""
_GROWTH: Mapping[Accuracy, float] = {"draft": 1.15, "standard": 1.15, "fine": 1.15**0.5}
_LARGEST = 100.0
"""Largest element side [mm]."""
_MARGIN = 2.5
"""Least length with small elements beyond the end of the track, over the Hertz half-width."""
_SPREAD = 0.65
"""Length beyond the end of the track that a sinking wheel touches, over the Hertz half-width times
the load ratio."""
_LONGEST_REACH = 0.8
"""Largest `RollingParameters.reach`, over half the circumference of the wheel."""
_MOST_INCREMENTS = 100_000
_OF_A_PASS = ("load_ratio", "friction", "traction", "control", "given_creepage", "heading")
"""Parameters that may differ from pass to pass."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RollingParameters(WheelParameters):
    """Parameters of rolling (N, mm, MPa; forces per mm of width)."""

    yield_stress: Annotated[float, Interval(gt=0.0, le=1e7), Unit("MPa")] = described(
        502.0, "uniaxial yield stress Re of the half-space"
    )
    load_ratio: Annotated[float, Interval(gt=0.0, le=10.0), Unit("1")] = described(
        1360.0 / 502.0,
        "ratio of the peak pressure of the elastic Hertz contact to the yield stress",
    )
    radius: Length = described(334.92, "radius R of the wheel")
    wheel_turned: Annotated[float, Interval(ge=-math.pi, le=math.pi), Unit("rad")] = described(
        0.0,
        "angle by which the wheel is turned before it is set down",
        needs={"load": ("contact",)},
    )
    passes: Annotated[int, Interval(ge=1, le=1000)] = described(1, "number of passes")
    sequence: tuple[Mapping[str, float | str], ...] = described(
        (),
        "list of different passes, repeated; each is a table of what differs from the run: "
        f"{', '.join(_OF_A_PASS)}, and `times`",
    )
    direction: Literal["same", "back_and_forth"] = described(
        "same", "whether every pass has the same direction, or the wheel rolls back"
    )
    heading: Literal["forward", "backward"] = described(
        "forward", "direction of the first pass along x"
    )
    load: Literal["contact", "hertz"] = described(
        "contact", "a wheel in contact, or a moving Hertz pressure"
    )
    track: Track = described(
        ENDLESS,
        "endless: steady passes, with the load at x = 0; or the length rolled by increments in a "
        "pass, centred on x = 0",
    )
    until: Literal["passes", "decided"] = described(
        "passes",
        "last pass on an endless track: that of `passes`, or the first after which the shakedown "
        "state is decided",
    )
    half_space_size: Annotated[float, Interval(ge=5.0, le=1e5), Unit("1")] = described(
        400.0,
        "ratio of the depth of the half-space, and of its width beyond a track of given length, to "
        "the Hertz half-width; 1600 for an endless track",
    )
    element_size: Annotated[float, Interval(gt=0.0, le=100.0), Unit("mm")] = by_accuracy(
        "element side along the track and at the surface"
    )
    element: Literal["quad8", "quad4"] = described(
        "quad8",
        "element of both bodies, on a track of given length",
        needs={"track": Other(ENDLESS)},
    )
    growth: Annotated[float, Interval(ge=1.0, le=3.0), Unit("1")] = by_accuracy(
        "ratio of neighbouring element sides in depth"
    )
    advance_step: Annotated[float, Interval(gt=0.0, le=100.0), Unit("mm")] = by_accuracy(
        "advance of the axle in an increment, on a track of given length",
        needs={"track": Other(ENDLESS)},
    )
    advance_tolerance: Annotated[float, Interval(ge=0.0, le=1.0), Unit("1")] = described(
        0.0,
        "ratio of the change of residual stress by halving the advance to the yield stress: the "
        f"advance is halved until it is smaller, at most {HALVINGS} times; 0 keeps advance_step",
    )
    press_steps: Annotated[int, Interval(ge=1, le=1000)] = described(
        8, "increments of setting down, and of applying the moment"
    )
    unload_steps: Annotated[int, Interval(ge=1, le=1000)] = described(4, "increments of unloading")

    def __post_init__(self) -> None:
        WheelParameters.__post_init__(self)
        prescribed = self.control == "creepage"
        if prescribed and self.load == "hertz":
            raise ModelError("control", self.control, "must be moment: load = hertz has no wheel")
        if self.load == "hertz":
            check_given_shear(self)
        if self.element_size > self.half_width / 2:
            raise ModelError(
                "element_size", self.element_size,
                f"must be at most {self.half_width / 2:.3g} mm, half the Hertz half-width of "
                f"radius {self.radius:g} and load_ratio {self.load_ratio:.4g}",
            )  # fmt: skip
        if self.sequence and not self.endless:
            raise ModelError("sequence", self.sequence, "must be empty unless track = endless")
        if self.endless:
            self._check_endless()
        else:
            self._check_length()
        self._check_rim()

    def _check_endless(self) -> None:
        """Raise `ModelError` for parameters that an endless track cannot have."""
        for name, usual in (
            ("advance_tolerance", 0.0), ("half_space_size", 400.0), ("element", "quad8")
        ):  # fmt: skip
            if (value := getattr(self, name)) != usual:
                raise ModelError(name, value, f"must be {usual} with track = endless")
        window_elements(self.mesh_width, self.element_size)

    def _check_length(self) -> None:
        """Raise `ModelError` for parameters that a track of given length cannot have."""
        if self.until != "passes":
            raise ModelError("until", self.until, "must be passes unless track = endless")
        if self.advance_step > self.length / 2:
            raise ModelError(
                "advance_step", self.advance_step,
                f"must be at most {self.length / 2:g} mm, half the track",
            )  # fmt: skip
        columns = (self.length + 2 * self.margin) / self.element_size
        if columns > MOST_COLUMNS:
            raise ModelError(
                "element_size", self.element_size,
                f"makes {columns:.0f} elements along a track of {self.length:g} mm and half-widths "
                f"of {self.half_width:.4g} mm; at most {MOST_COLUMNS}",
            )  # fmt: skip
        rolling = self.length / self.advance_step * 2 ** (HALVINGS if self.advance_tolerance else 0)
        increments = self.passes * (2 * self.press_steps + rolling + self.unload_steps)
        if increments > _MOST_INCREMENTS:
            raise ModelError(
                "passes", self.passes,
                f"make {increments:.0f} increments of press_steps, advance_step and unload_steps; "
                f"at most {_MOST_INCREMENTS}",
            )  # fmt: skip

    def _check_rim(self) -> None:
        """Raise `ModelError` if the rim is too short for track and contact."""
        longest = _LONGEST_REACH * math.pi * self.radius
        if self.load == "contact" and self.reach > longest:
            room = 0.0 if self.endless else 2 * (longest - self.margin) / self._turning
            raise ModelError(
                *(("track", self.track) if room > 0 else ("load_ratio", self.load_ratio)),
                f"the rim of a wheel of radius {self.radius:g} has room for a track of at most "
                f"{math.floor(max(room, 0.0))} mm with half-widths of {self.half_width:.4g} mm",
            )  # fmt: skip

    def usual(self) -> Mapping[str, float]:
        """Return element side, growth and advance; for errors see docs/explanation/accuracy.md.

        The side is rounded to two digits.
        """
        endless, of_length = _ELEMENTS[self.accuracy]
        side = self.mesh_width / endless if self.endless else self.half_width / of_length
        h = self.element_size or float(f"{min(side, _LARGEST):.2g}")
        advance = h / 2 if self.endless else min(h / 2, self.length / 2)
        return {"element_size": h, "growth": _GROWTH[self.accuracy], "advance_step": advance}

    @property
    def wheel_material(self) -> Material:
        """The elastic material of the wheel."""
        own = self.wheel_elasticity
        return Material(youngs_modulus=own.youngs_modulus, poisson_ratio=own.poisson_ratio)

    @property
    def peak_pressure(self) -> float:
        """p0 of the elastic Hertz contact [MPa]."""
        return self.load_ratio * self.yield_stress

    @property
    def half_width(self) -> float:
        """Half-width a = 2 R p0 / E* of the elastic Hertz contact [mm]."""
        return 2 * self.radius * self.peak_pressure / self.contact_modulus

    @property
    def force(self) -> float:
        """Vertical force pi a p0 / 2 [N per mm of width]."""
        return math.pi * self.half_width * self.peak_pressure / 2

    @property
    def endless(self) -> bool:
        """Whether passes are steady."""
        return self.track == ENDLESS

    @property
    def length(self) -> float:
        """Length rolled in a pass by increments [mm]."""
        return float(self.track)

    @property
    def margin(self) -> float:
        """Length beyond the end of the track that may come into contact [mm]."""
        return max(_MARGIN * self.half_width, self.spread)

    @property
    def spread(self) -> float:
        """Length beyond the end of the track that a sinking wheel may touch [mm]."""
        return _SPREAD * self.load_ratio * self.half_width

    @property
    def reach(self) -> float:
        """Half the length of the rim that may come into contact [mm]."""
        if self.endless:
            return self.element_size * math.ceil(self.margin / self.element_size)
        return self.length / 2 * self._turning + self.margin

    @property
    def fine(self) -> float:
        """Half the length of the half-space with elements of the given side [mm]."""
        return self.length / 2 + self.margin

    @property
    def guided(self) -> bool:
        """Whether the rotation of the wheel is prescribed; otherwise its moment is."""
        return self.traction == 1.0 or self.control == "creepage" or self.frictionless

    @property
    def _turning(self) -> float:
        """Ratio of the length of rim that rolls to the length of track, at least 1."""
        return 1 + max(0.0, -self.given_creepage)

    @property
    def block(self) -> tuple[RollingParameters, ...]:
        """The parameters of each pass of the sequence; without one those of the run."""
        return block_of(self, self.sequence, _OF_A_PASS) or (self,)

    @property
    def widest(self) -> RollingParameters:
        """The parameters of the pass with the widest contact."""
        return max(self.block, key=lambda own: own.half_width)

    @property
    def mesh_width(self) -> float:
        """Half-width of the mesh of an endless track [mm], rounded so that runs share meshes."""
        return float(f"{self.widest.half_width:.3g}")

    def of_pass(self, number: int) -> RollingParameters:
        """Return the parameters of a pass, counted from 0."""
        return self.block[number % len(self.block)]

    @property
    def directions(self) -> tuple[int, ...]:
        """The direction of each pass along x, 1 or -1."""
        turn = -1 if self.direction == "back_and_forth" else 1
        ways = [1 if own.heading == "forward" else -1 for own in self.block]
        return tuple(ways[k % len(ways)] * turn**k for k in range(self.passes))

    @property
    def cycle(self) -> int:
        """Passes after which the loading repeats itself."""
        return math.lcm(len(self.block), 2 if self.direction == "back_and_forth" else 1)

    @property
    def schedule(self) -> Schedule:
        """The loading history of the passes by increments."""
        return Schedule(
            n=self.passes,
            track=self.length,
            step=self.advance_step,
            directions=self.directions,
            driven=bool(self.traction) and self.traction != 1.0 and self.load == "contact",
            press=self.press_steps,
            release=self.unload_steps,
        )


_method, _program, _view, _refinement, _warnings, _advice = late(
    "rolling.scenes.rolling_setup", "method", "program", "view", "refinement", "warnings", "advice"
)
_model, _sketch, _effort = late("rolling.scenes.rolling_model", "model", "sketch", "effort")
(_trace,) = late("rolling.scenes.passes", "Trace.of")

ROLLING = Scene(
    name="rolling",
    summary="elastic cylinder rolling on an elastic-plastic half-space, pass after pass",
    parameters=RollingParameters,
    branch="passes",
    method=_method,
    model=_model,
    sketch=_sketch,
    program=_program,
    view=_view,
    outputs=(
        *late("results.maps", "maps", "surfaces"),
        *late("results.figures", "residual_extremes"),
        *late("rolling.scenes.rolling_setup", "profile_figures", "surface"),
        *late("results.contact", "contact"),
        *late("results.figures", "extremes"),
        *late("rolling.scenes.rolling_setup", "wheel", "cycles"),
    ),
    costs=(*late("results.figures", "cost"), *late("rolling.scenes.rolling_setup", "progress")),
    trace=_trace,
    refinement=_refinement,
    increment_error=math.inf,  # increments are those of `advance_step`, see `refinement`
    effort=_effort,
    warnings=_warnings,
    advice=_advice,
    derives=0.9,
)  # fmt: skip
