"""Tables of the shapes of bodies, with their meshes, and of the surfaces of rigid bodies."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from inspect import Parameter, signature
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union

import numpy as np
from pydantic import Field, create_model
from skfem import Mesh

from solver.errors import ModelError
from solver.mesh.grids import grid
from solver.mesh.lines import refined
from solver.mesh.shapes import (
    Growth,
    Near,
    Radius,
    ball,
    ball_lines,
    disc,
    few,
    fillet,
    half_plane,
    pad,
    rectangle,
    ring,
)
from solver.parameters import Coordinate, Length
from solver.typing import Array
from studies.scenes.table import Angles, Count, Place, SceneTable


class NearTable(SceneTable):
    """A place at which a shape is meshed finely.

    Elements have the side ``size`` [mm] within ``radius`` of the place and grow away from there.
    """

    at: Place
    size: Length
    radius: Radius = 0.0


class _MarkTable(SceneTable):
    """The element side ``size`` [mm] at a place; without it that of the neighbouring places.

    ``largest`` is the largest side between this place and the one before, ``parts`` the number of
    equal sides between them.
    """

    size: Length | None = None
    largest: Length | None = None
    parts: Count | None = None


class LineMarkTable(_MarkTable):
    """A position on an axis through which a grid line goes."""

    at: Coordinate


class PointMarkTable(_MarkTable):
    """A point of a surface."""

    at: Place


class GridTable(SceneTable):
    """A rectangle whose grid lines go through given positions: left, right, bottom, top.

    Elements have the sides that are given there and grow away from them.
    """

    kind: Literal["grid"]
    x: Annotated[tuple[LineMarkTable, ...], Field(min_length=2)]
    y: Annotated[tuple[LineMarkTable, ...], Field(min_length=2)]
    growth: Growth = 1.3


SHAPES: Mapping[str, Callable[..., Mesh]] = {
    "rectangle": rectangle, "half_plane": half_plane, "pad": pad, "ring": ring, "sector": ring,
    "fillet": fillet, "disc": disc, "round": ball,
}  # fmt: skip


def _shape(word: str, make: Callable[..., Mesh]) -> type[SceneTable]:
    """Return the table of a shape: the arguments of the function that makes its mesh."""
    known: dict[str, Any] = {"kind": (Literal[word], ...)}
    for name, each in signature(make, eval_str=True).parameters.items():
        hint = tuple[NearTable, ...] if name == "near" else each.annotation
        known[name] = (hint, ... if each.default is Parameter.empty else each.default)
    known.pop("cells", None)
    return create_model(f"{word}_shape", __base__=SceneTable, __doc__=make.__doc__, **known)


if TYPE_CHECKING:
    Shape = Any
else:
    _made = [_shape(word, make) for word, make in SHAPES.items()]
    Shape = Annotated[Union[(GridTable, *_made)], Field(discriminator="kind")]
LINED = ("grid", "round")
"""Shapes of which `lines_of` tells the lines."""


def mesh_of(shape: Any, cells: str) -> Mesh:
    """Return the mesh of a shape, with named boundaries.

    Parameters
    ----------
    shape : one of the tables above
    cells : ``quad`` or ``tri``; shapes with curved sides have quadrilaterals only

    Raises
    ------
    ModelError
        naming the entry of the shape that is wrong
    """
    if isinstance(shape, GridTable):
        return grid(*lines_of(shape), cells)
    given = {name: getattr(shape, name) for name in type(shape).model_fields if name != "kind"}
    if near := given.get("near"):
        given["near"] = [Near(**each.model_dump()) for each in near]
    if "cells" in signature(SHAPES[shape.kind]).parameters:
        given["cells"] = cells
    elif cells == "tri":
        raise ModelError("element", cells, f"a {shape.kind} is meshed with quadrilaterals")
    return SHAPES[shape.kind](**given)


def lines_of(shape: Any) -> tuple[Array, Array]:
    """Return the grid lines of a shape of `LINED` before it is bent, or raise `ModelError` [mm]."""
    if shape.kind == "round":
        y = ball_lines(shape.radius, shape.fine, shape.size, shape.growth)
        x = y if shape.symmetric else np.concatenate([-y[:0:-1], y])
    else:
        x, y = (
            _graded(name, marks, [mark.at for mark in marks], shape.growth)
            for name, marks in (("x", shape.x), ("y", shape.y))
        )
    few((len(x) - 1) * (len(y) - 1))
    return x, y


def _graded(field: str, marks: Sequence[_MarkTable], at: Sequence[float], growth: float) -> Array:
    """Return grid lines through the positions ``at`` with the sides of their marks [mm]."""
    if not all(before < after for before, after in pairwise(at)):
        raise ModelError(field, list(at), "must have increasing places [mm]")
    if marks[0].largest is not None or marks[0].parts is not None:
        given = marks[0].largest or marks[0].parts
        raise ModelError(field, given, "has no side before its first place")
    sizes, largest = (
        [math.inf if side is None else side for side in sides]
        for sides in ((mark.size for mark in marks), (mark.largest for mark in marks[1:]))
    )
    return refined(at, sizes, growth, largest, [mark.parts for mark in marks[1:]])


class LineTable(SceneTable):
    """A polygonal surface of a rigid body; the body is to the left of the path of its points."""

    kind: Literal["line"]
    points: Annotated[tuple[Place, ...], Field(min_length=2, max_length=10_000)]

    def chain(self) -> Array:
        """Return its points (2, n) [mm]."""
        return np.array(self.points).T


class GradedTable(SceneTable):
    """A line through points with graded edges, as those of a grid."""

    kind: Literal["graded"]
    points: Annotated[tuple[PointMarkTable, ...], Field(min_length=2)]
    growth: Growth = 1.3

    def chain(self) -> Array:
        """Return its points (2, n) [mm]."""
        corners = np.array([point.at for point in self.points]).T
        reached = np.append(0.0, np.cumsum(np.hypot(*np.diff(corners))))
        s = _graded("points", self.points, reached.tolist(), self.growth)
        return np.stack([np.interp(s, reached, each) for each in corners])


class ArcTable(SceneTable):
    """An arc [degrees]; if it is counter-clockwise, the rigid body is inside the circle."""

    kind: Literal["arc"]
    centre: Place
    radius: Length
    angles: Angles
    edges: Count = 60
