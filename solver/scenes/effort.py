"""The work of a loading path: elements, unknowns and increments, counted without a mesh."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.prism.section import Section


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """The work of one loading path.

    Attributes
    ----------
    elements : number in all bodies, also in those condensed to their surface
    unknowns : displacement unknowns that no support holds, as `System.n_unknowns` counts them
    increments : number in all runs, shared ones counted once, if none is cut; the smallest number
        if passes end when the shakedown state is decided
    most_increments : the same with all halvings of `Scene.refinement`, or if the shakedown state is
        never decided
    """

    elements: int
    unknowns: int
    increments: int
    most_increments: int


def effort_of(section: Section, passes: Sequence[float]) -> Effort:
    """Return the work of so many passes over a prism with this section."""
    count = int(max(passes))
    return Effort(
        elements=len(section.weights),
        unknowns=len(section.free),
        increments=count,
        most_increments=count,
    )


class GridSize(NamedTuple):
    """Numbers of elements and nodes of a grid, and of nodes on one line along x and along y."""

    elements: int
    nodes: int
    along: int
    up: int


@cache
def node_layout(element: str) -> tuple[str, int, int, int]:
    """Return the cells of an element, and its numbers of nodes per corner, per edge and inside."""
    from solver.mesh.elements import element_type  # scikit-fem takes a third of a second to import

    kind = element_type(element)
    shape = kind.element
    return kind.cells, shape.nodal_dofs, shape.facet_dofs, shape.interior_dofs


def grid_size(columns: int, rows: int, element: str) -> GridSize:
    """Return the size of the mesh that `solver.mesh.grid` makes of these columns and rows."""
    cells, at_corner, on_edge, inside = node_layout(element)
    parts = 2 if cells == "tri" else 1  # triangles cut each rectangle along a diagonal
    corners, rectangles = (columns + 1) * (rows + 1), columns * rows
    edges = columns * (rows + 1) + rows * (columns + 1) + (parts - 1) * rectangles
    return GridSize(
        elements=parts * rectangles,
        nodes=at_corner * corners + on_edge * edges + inside * parts * rectangles,
        along=at_corner * (columns + 1) + on_edge * columns,
        up=at_corner * (rows + 1) + on_edge * rows,
    )
