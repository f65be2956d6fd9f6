"""A square-cornered punch on a half-plane: one half of both bodies, meshed towards the corner.

The middle of the contact is the origin, the corner is at x = a, and the lines of the meshes run
through it. A relief groove is a square notch: in the punch it is cut from the free side, at some
height above the contact; in the half-plane from the surface, at some distance from the corner.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np
from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.mesh import grid, refined, within, without
from solver.model.body import Body
from solver.scenes.effort import Lattice, lattice

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from skfem import Mesh

    from solver.materials.law import Law
    from solver.model.kinematics import Kinematics

    Array = NDArray[np.float64]

PunchHeight = Annotated[float, Interval(ge=0.5, le=20.0), Unit("1")]
HalfPlaneSize = Annotated[float, Interval(ge=2.0, le=1000.0), Unit("1")]
SmallestElement = Annotated[float, Interval(ge=1e-5, le=0.1), Unit("1")]
Growth = Annotated[float, Interval(ge=1.05, le=3.0), Unit("1")]

GrooveSize = Annotated[float, Interval(ge=0.0, le=10.0), Unit("1")]
GrooveHeight = Annotated[float, Interval(gt=0.0, le=100.0), Unit("1")]
GrooveDistance = Annotated[float, Interval(ge=0.5, le=100.0), Unit("1")]

_PUNCH_LARGEST = 0.25  # of a, up the punch
_GROOVE_ELEMENT = 0.02  # of the groove
_LIGAMENT_ELEMENT = 0.2  # of what a groove leaves between itself and the contact
_BEYOND = 0.1  # of a, beyond the corner
_MOST_ELEMENTS = 60_000
FACING = "contact"
"""Boundary of the half-plane that may touch the punch."""


class Groove(NamedTuple):
    """A square notch: its distance from the contact or the corner, and its side [mm].

    One in the half-plane may begin at the corner itself.
    """

    distance: float
    side: float

    @property
    def end(self) -> float:
        """Distance at which it ends [mm]."""
        return self.distance + self.side

    @property
    def element(self) -> float:
        """Element at its far corners [mm]."""
        return _GROOVE_ELEMENT * self.side

    @property
    def near_element(self) -> float:
        """Element at its near corners [mm]."""
        return min(self.element, _LIGAMENT_ELEMENT * self.distance)


class Lines(NamedTuple):
    """Lines of the meshes [mm]: x under the punch and beyond it, y up the punch and down below."""

    under: Array
    beyond: Array
    up: Array
    down: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class FlatPunch:
    """Dimensions and elements [mm].

    Attributes
    ----------
    half_width : a
    height : of the punch
    size : width of the half-plane from the middle, and its depth, unless that is given
    smallest : element side at the corner
    growth : ratio of neighbouring element sides
    largest : element under the punch
    middle : element at the middle of the contact; inf leaves it to the growth from the corner
    depth : of the half-plane, where it is not its width
    punch_groove, half_plane_groove : relief grooves
    """

    half_width: float
    height: float
    size: float
    smallest: float
    growth: float
    largest: float
    middle: float = math.inf
    punch_groove: Groove | None = None
    half_plane_groove: Groove | None = None
    depth: float | None = None

    @property
    def lines(self) -> Lines:
        """Lines of the meshes."""
        return _lines(self)

    @property
    def graded(self) -> float:
        """Distance from the corner within which elements grow in proportion to it [mm]."""
        return self.largest / (self.growth - 1)

    @property
    def reach(self) -> float:
        """How far from the middle the half-plane may touch the punch [mm]: beyond the corner."""
        beyond = _BEYOND * self.half_width
        groove = self.half_plane_groove
        return self.half_width + (min(beyond, groove.distance) if groove else beyond)

    def lattices(self, element: str) -> tuple[Lattice, Lattice]:
        """Return what the grids of punch and half-plane have, grooves not counted."""
        under, beyond, up, down = (len(each) - 1 for each in self.lines)
        return lattice(under, up, element), lattice(under + beyond, down, element)

    def elements(self, element: str) -> int:
        """Return the number of elements of both bodies."""
        under, beyond, up, down = self.lines
        cut = 0
        for groove, along, across, corner in (
            (self.punch_groove, up, under, self.half_width),
            (self.half_plane_groove, beyond - self.half_width, down, 0.0),
        ):
            if groove:
                rows = _between(along, groove.distance, groove.end)
                cut += rows * _between(across, corner - groove.side, corner)
        parts = lattice(1, 1, element).elements
        return sum(each.elements for each in self.lattices(element)) - parts * cut

    def facing_nodes(self, element: str) -> int:
        """Return the number of nodes of the half-plane that the punch may touch."""
        under, beyond, *_ = self.lines
        columns = len(under) - 1 + _between(beyond, self.half_width, self.reach)
        return lattice(columns, 1, element).along

    def check_elements(self, given: float) -> None:
        """Raise `ModelError` where the meshes are too large; ``given`` is ``smallest_element``."""
        elements = self.elements("quad8")
        if elements > _MOST_ELEMENTS:
            raise ModelError(
                "smallest_element", given,
                f"makes {elements} elements with growth {self.growth:g}; at most "
                f"{_MOST_ELEMENTS} are allowed: raise growth or smallest_element",
            )  # fmt: skip

    def meshes(self, cells: str) -> tuple[Mesh, Mesh]:
        """Return the meshes of punch and half-plane."""
        under, beyond, up, down = self.lines
        a = self.half_width
        punch = grid(under, up, cells)
        half_plane = grid(np.concatenate([under, beyond[1:]]), down, cells)
        if groove := self.punch_groove:
            punch = without(punch, "groove", (a - groove.side, a), (groove.distance, groove.end))
        half_plane = within(half_plane, FACING, ["top"], x=(0.0, self.reach))
        if groove := self.half_plane_groove:
            sides = (a + groove.distance, a + groove.end)
            half_plane = without(half_plane, "groove", sides, (-groove.side, 0.0))
        return punch, half_plane

    def bodies(
        self, *, punch: Law, half_plane: Law, kinematics: Kinematics, element: str, pressure: float
    ) -> tuple[Body, Body]:
        """Return punch and half-plane of these materials, the pressure [MPa] on top of the punch.

        The middle is held along x, the bottom of the half-plane along y; the punch is held by
        contact alone.
        """
        from solver.mesh.elements import element_type  # only who computes needs the solver

        meshes = self.meshes(element_type(element).cells)
        upper = Body(
            name="punch",
            mesh=meshes[0],
            material=punch,
            kinematics=kinematics,
            element=element,
            supports={"left": "x"},
            pressure={"top": pressure},
        )
        lower = Body(
            name="half_plane",
            mesh=meshes[1],
            material=half_plane,
            kinematics=kinematics,
            element=element,
            supports={"left": "x", "bottom": "y"},
        )
        return upper, lower


def _between(lines: Array, low: float, high: float) -> int:
    """Return how many cells lie between two positions."""
    middle = (lines[1:] + lines[:-1]) / 2
    return int(((middle > low) & (middle < high)).sum())


@lru_cache(maxsize=256)
def _lines(punch: FlatPunch) -> Lines:
    a, h, ratio = punch.half_width, punch.smallest, punch.growth
    deep = punch.size if punch.depth is None else punch.depth
    across, aside = [(0.0, punch.middle)], []
    up, down = [(0.0, h)], [(0.0, h)]
    if groove := punch.punch_groove:
        across += [(a - groove.side, groove.element)]
        up += [(groove.distance, groove.near_element), (groove.end, groove.element)]
    if groove := punch.half_plane_groove:
        near = [(a + groove.distance, groove.near_element)] if groove.distance else []
        aside = [*near, (a + groove.end, groove.element)]
        down += [(groove.side, groove.element)]
    across += [(a, h)]
    return Lines(
        under=_refined(across, ratio, punch.largest),
        beyond=_refined([(a, h), *aside, (punch.size, math.inf)], ratio, punch.size / 4),
        up=_refined([*up, (punch.height, math.inf)], ratio, _PUNCH_LARGEST * a),
        down=-_refined([*down, (deep, math.inf)], ratio, deep / 4)[::-1],
    )


def _refined(nodes: list[tuple[float, float]], ratio: float, largest: float) -> Array:
    """Return lines through points with given elements beside them."""
    points, sizes = zip(*nodes, strict=True)
    return refined(points, sizes, ratio, [largest] * (len(points) - 1))
