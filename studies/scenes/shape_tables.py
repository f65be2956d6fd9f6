"""Tables of shapes: of bodies that are meshed here, and of the surfaces of rigid ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal

from annotated_types import Interval
from pydantic import Field

from solver.errors import ModelError
from solver.mesh import Near, ball, disc, fillet, half_plane, pad, rectangle, ring
from solver.parameters import Length
from studies.scenes.table import Count, Place, SceneTable, Span

if TYPE_CHECKING:
    from skfem import Mesh


class NearTable(SceneTable):
    """Where a built-in shape is meshed finely.

    Elements have the side ``size`` [mm] within ``radius`` of the place, and grow away from there.
    """

    at: Place
    size: Length
    radius: Annotated[float, Interval(ge=0.0, le=1e6)] = 0.0


class _MeshedTable(SceneTable):
    """What shapes that are divided along two directions have.

    ``size`` is the largest element side, ``growth`` the ratio of neighbouring sides.
    """

    size: Length
    growth: Annotated[float, Interval(gt=1.0, le=3.0)] = 1.3
    near: tuple[NearTable, ...] = ()


class RectangleTable(_MeshedTable):
    """From ``x[0]`` to ``x[1]`` and ``y[0]`` to ``y[1]``: left, right, bottom, top."""

    kind: Literal["rectangle"]
    x: Span
    y: Span


class HalfPlaneTable(_MeshedTable):
    """A rectangle below y = 0, as deep as it reaches to either side; its half where symmetric."""

    kind: Literal["half_plane"]
    extent: Length
    symmetric: bool = False


class PadTable(_MeshedTable):
    """A block on y = 0, its bottom an arc that touches x = 0: left, right, bottom, top.

    It is as high at its sides as in its middle.
    """

    kind: Literal["pad"]
    width: Length
    height: Length
    radius: Length


class RingTable(_MeshedTable):
    """Between two radii, and between two angles [degrees]: inner, outer, start, end."""

    kind: Literal["ring", "sector"]
    centre: Place = (0.0, 0.0)
    radii: tuple[Length, Length]
    angles: Span = (0.0, 360.0)


class FilletTable(_MeshedTable):
    """A bar that narrows from ``wide`` to ``narrow`` over a fillet at y = 0, its axis at x = 0.

    It reaches ``lengths`` below and above: left (the axis), bottom, right (the end of the wide
    part), surface, fillet, top. Where something is ``near``, the whole fillet is fine.
    """

    kind: Literal["fillet"]
    wide: Length
    narrow: Length
    radius: Length
    lengths: tuple[Length, Length]


class DiscTable(SceneTable):
    """A whole disc, meshed evenly: rim, and its quarters east, north, west, south."""

    kind: Literal["disc"]
    centre: Place = (0.0, 0.0)
    radius: Length
    size: Length


class RoundTable(SceneTable):
    """A disc that touches y = 0 at ``at``, fine there, without a cap on its far side.

    Its boundaries are those of `solver.mesh.ball`.
    """

    kind: Literal["round"]
    at: Place = (0.0, 0.0)
    radius: Length
    size: Length
    fine: Length
    growth: Annotated[float, Interval(gt=1.0, le=3.0)] = 1.3
    above: bool = True
    symmetric: bool = False


Shape = Annotated[
    RectangleTable | HalfPlaneTable | PadTable | RingTable | FilletTable | DiscTable | RoundTable,
    Field(discriminator="kind"),
]
_MESHED: Mapping[str, Callable[..., Mesh]] = {
    "rectangle": rectangle, "half_plane": half_plane, "pad": pad, "ring": ring, "sector": ring,
    "fillet": fillet, "disc": disc, "round": ball,
}  # fmt: skip


def mesh_of(shape: Any, cells: str) -> Mesh:
    """Return the mesh of a shape, its boundaries named.

    Parameters
    ----------
    shape : one of the tables above
    cells : ``quad`` or ``tri``; shapes with curved sides have quadrilaterals

    Raises
    ------
    ModelError
        naming the entry of the shape that is wrong
    """
    given = {name: getattr(shape, name) for name in type(shape).model_fields if name != "kind"}
    if near := given.get("near"):
        given["near"] = [Near(**each.model_dump()) for each in near]
    if isinstance(shape, RectangleTable | HalfPlaneTable):
        given["cells"] = cells
    elif cells == "tri":
        raise ModelError("element", cells, f"a {shape.kind} is meshed with quadrilaterals")
    return _MESHED[shape.kind](**given)


class LineTable(SceneTable):
    """A straight surface of a rigid body, which lies on the left of one who walks along it."""

    kind: Literal["line"]
    points: Annotated[tuple[Place, ...], Field(min_length=2, max_length=10_000)]


class ArcTable(SceneTable):
    """An arc [degrees]; counter-clockwise the rigid body is inside the circle."""

    kind: Literal["arc"]
    centre: Place
    radius: Length
    angles: Span
    edges: Count = 60
