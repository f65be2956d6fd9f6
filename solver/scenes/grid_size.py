"""Numbers of elements and nodes of grids, counted without a mesh."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

from solver.mesh.elements import element_type


class GridSize(NamedTuple):
    """Numbers of elements and nodes of a grid, and of nodes on one line along x and along y."""

    elements: int
    nodes: int
    along: int
    up: int


@cache
def node_layout(element: str) -> tuple[str, int, int, int]:
    """Return the cells of an element, and its numbers of nodes per corner, per edge and inside."""
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
