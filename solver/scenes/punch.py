"""Elastic-plastic punch pressed on an elastic-plastic half-plane, and released.

A square-cornered punch of half-width a and a half-plane of the same material, symmetric about
x = 0, so that half of it is meshed. Uniform pressure on top of the punch is raised to
``load_ratio * yield_stress`` and removed. The punch is held by contact alone.

The outer dimensions are not given in the source; they are parameters here. The error of a finite
half-plane is inversely proportional to its size: with 40 a, residual tension is less than 1 % and
plastic work less than 2 % too small.

P. Marek, PhD thesis, Warsaw University of Technology (1995), section 5.1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Literal, NamedTuple

from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.late import late
from solver.mesh.lines import refined
from solver.model.singular import SingularPoint
from solver.parameters import Accuracy, Length, Ratio, by_accuracy, described
from solver.results.record import Status
from solver.scenes.material_parameters import ContactParameters
from solver.scenes.scene import Scene
from solver.typing import Array

_USUAL: Mapping[Accuracy, Mapping[str, float]] = {
    "draft": {"smallest_element": 5e-3, "growth": 1.6, "load_step": 0.1},
    "standard": {"smallest_element": 5e-4, "growth": 1.4, "load_step": 0.05},
    "fine": {"smallest_element": 1e-4, "growth": 1.2, "load_step": 0.025},
}
"""Parameters of each accuracy; docs/explanation/accuracy.md has their errors."""
_LARGEST, _PUNCH_LARGEST = 0.08, 0.25
"""Largest element sides along the contact, and along the height of the punch, over a."""
_MOST_ELEMENTS = 60_000
NEAREST = 0.005
"""Distance from the corner of the first published number, over a."""
_DIAGONAL = 1.5
"""Diagonal of an element at the corner over its side: sqrt(2), rounded up."""


class Lines(NamedTuple):
    """Grid lines [mm]: x under the punch and beyond it, y of the punch and of the half-plane."""

    under: Array
    beyond: Array
    up: Array
    down: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class PunchParameters(ContactParameters):
    """Parameters of the punch (N, mm, MPa)."""

    load_ratio: Ratio = described(
        0.5714, "ratio of the mean pressure on the punch to the yield stress"
    )
    state: Literal["plane_stress", "plane_strain", "axisymmetric"] = described(
        "plane_stress", "two-dimensional state; axisymmetric is a flat-ended cylinder"
    )
    half_width: Length = described(50.0, "half-width a of the punch")
    punch_height: Annotated[float, Interval(ge=0.5, le=20.0), Unit("1")] = described(
        2.0, "ratio of the height of the punch to a"
    )
    half_plane_size: Annotated[float, Interval(ge=2.0, le=1000.0), Unit("1")] = described(
        40.0, "ratio of width and depth of the half-plane to a"
    )
    punch_stiffness: Annotated[float, Interval(ge=1e-4, le=1e4), Unit("1")] = described(
        1.0, "ratio of Young's modulus of the punch to that of the half-plane"
    )
    elastic_punch: bool = described(False, "whether the punch never yields")
    smallest_element: Annotated[float, Interval(ge=1e-5, le=0.1), Unit("1")] = by_accuracy(
        "ratio of the smallest element side, at the corner, to a"
    )
    growth: Annotated[float, Interval(ge=1.05, le=3.0), Unit("1")] = by_accuracy(
        "ratio of neighbouring element sides away from the corner"
    )
    element: Literal["quad8", "quad9", "quad4", "tri6", "tri3"] = described(
        "quad8", "element of both bodies"
    )
    strain: Literal["small", "large", "region"] = described(
        "small",
        "strain of both bodies: large strain is logarithmic, and forces balance in the deformed "
        "bodies; region has it near the corner of the punch alone",
    )
    load_step: Annotated[float, Interval(ge=1e-4, le=1.0), Unit("1")] = by_accuracy(
        "largest increment of load_ratio"
    )
    unload_steps: Annotated[int, Interval(ge=1, le=1000)] = described(5, "increments of unloading")

    def __post_init__(self) -> None:
        ContactParameters.__post_init__(self)
        under, beyond, up, down = (len(each) - 1 for each in self.lines)
        elements = under * up + (under + beyond) * down
        if elements > _MOST_ELEMENTS:
            raise ModelError(
                "smallest_element", self.smallest_element,
                f"makes {elements} elements with growth {self.growth:g}; at most "
                f"{_MOST_ELEMENTS} are allowed: raise growth or smallest_element",
            )  # fmt: skip

    @property
    def lines(self) -> Lines:
        """Grid lines of both meshes; their spacing decreases towards the corner."""
        a = self.half_width
        return _lines(
            a, self.punch_height * a, self.half_plane_size * a, self.smallest_element * a,
            self.growth,
        )  # fmt: skip

    @property
    def corner(self) -> SingularPoint:
        """The corner of the punch, at which strain is unbounded.

        Its radius is the distance of the first published number: there strain converges as the mesh
        is refined, nearer to the corner it does not.
        """
        radius = max(NEAREST, _DIAGONAL * self.smallest_element) * self.half_width
        return SingularPoint(at=(self.half_width, 0.0), radius=radius)

    def usual(self) -> Mapping[str, float]:
        """Return the mesh and the increments of an accuracy."""
        return _USUAL[self.accuracy]


@lru_cache(maxsize=256)
def _lines(a: float, height: float, size: float, smallest: float, growth: float) -> Lines:
    away = (smallest, math.inf)
    return Lines(
        under=refined((0.0, a), away[::-1], growth, [_LARGEST * a]),
        beyond=refined((a, size), away, growth, [size / 4]),
        up=refined((0.0, height), away, growth, [_PUNCH_LARGEST * a]),
        down=-refined((0.0, size), away, growth, [size / 4])[::-1],
    )


_model, _program, _view, _effort = late("scenes.punch_setup", "model", "program", "view", "effort")

PUNCH = Scene(
    name="punch",
    summary="elastic-plastic punch pressed on an elastic-plastic half-plane, and released",
    parameters=PunchParameters,
    branch="load_ratio",
    model=_model,
    program=_program,
    view=_view,
    outputs=(
        *late("results.maps", "maps", "profiles", "surfaces"),
        *late("results.contact", "contact"),
        *late("results.figures", "extremes", "residual_extremes"),
        *late("scenes.punch_setup", "figures"),
    ),
    costs=late("results.figures", "cost"),
    increment_error=0.04,  # the error of the mesh is larger
    effort=_effort,
    advice={
        Status.LIMIT_LOAD: "lower load_ratio, or let the material harden",
        Status.NOT_CONVERGED: "reduce load_step, or refine the mesh by smallest_element or growth",
    },
)
