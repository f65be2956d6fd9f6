"""How much work a loading path is, told before any mesh is made."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """The work of one loading path.

    Attributes
    ----------
    elements : of all bodies, those included that are condensed to their surface
    unknowns : displacement unknowns that no support holds, as `System.n_unknowns` counts them
    increments : of all its runs together, shared ones once, when none is cut; where passes end as
        soon as the state is decided, the fewest
    most_increments : the same where `Scene.refinement` halves them as often as it may, or where the
        state is never decided
    """

    elements: int
    unknowns: int
    increments: int
    most_increments: int


class Lattice(NamedTuple):
    """What a grid of rectangles has: elements, nodes in all, nodes along x and along y."""

    elements: int
    nodes: int
    along: int
    up: int


@cache
def per_place(element: str) -> tuple[str, int, int, int]:
    """Return the cells of an element, and its nodes at a corner, on an edge and inside."""
    from solver.mesh.elements import element_type  # scikit-fem takes a third of a second to import

    kind = element_type(element)
    shape = kind.element
    return kind.cells, shape.nodal_dofs, shape.facet_dofs, shape.interior_dofs


def lattice(columns: int, rows: int, element: str) -> Lattice:
    """Return what `solver.mesh.grid` makes of so many columns and rows of rectangles."""
    cells, at_corner, on_edge, inside = per_place(element)
    parts = 2 if cells == "tri" else 1  # triangles cut each rectangle along a diagonal
    corners, rectangles = (columns + 1) * (rows + 1), columns * rows
    edges = columns * (rows + 1) + rows * (columns + 1) + (parts - 1) * rectangles
    return Lattice(
        elements=parts * rectangles,
        nodes=at_corner * corners + on_edge * edges + inside * parts * rectangles,
        along=at_corner * (columns + 1) + on_edge * columns,
        up=at_corner * (rows + 1) + on_edge * rows,
    )
