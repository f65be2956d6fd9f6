"""What the mesh of a body has, counted without it where its shape is a grid or a bent one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.mesh.shapes import few
from solver.scenes.effort import per_place
from studies.scenes import tables
from studies.scenes.building import usual_element
from studies.scenes.shape_tables import GridLines, lines_of

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from skfem import Mesh

    Edges = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class BodySize:
    """What a mesh has.

    Attributes
    ----------
    elements, nodes : how many
    edges : boundary -> numbers of the corners at the ends of its edges (n, 2)
    at_corner, on_edge : nodes at a corner, and inside an edge
    """

    elements: int
    nodes: int
    edges: Mapping[str, Edges]
    at_corner: int
    on_edge: int

    def on(self, boundaries: Iterable[str]) -> set[tuple[int, ...]]:
        """Return corners and edges of boundaries; each stands for the nodes that it has."""
        edges = [tuple(sorted(ends)) for name in boundaries for ends in self.edges[name].tolist()]
        return {*edges, *((corner,) for ends in edges for corner in ends)}

    def count(self, places: Iterable[tuple[int, ...]]) -> int:
        """Return how many nodes corners and edges have."""
        return sum(self.at_corner if len(place) == 1 else self.on_edge for place in places)


def size_of_mesh(mesh: Mesh, element: str | None) -> BodySize:
    """Return what a mesh has with an element; without one, with that of a body that names none."""
    _, at_corner, on_edge, inside = per_place(element or usual_element(mesh))
    nodes = at_corner * mesh.nvertices + on_edge * mesh.nfacets + inside * mesh.nelements
    edges = {name: mesh.facets[:, each].T for name, each in (mesh.boundaries or {}).items()}
    return BodySize(mesh.nelements, int(nodes), edges, at_corner, on_edge)


def size_of_lines(body: tables.BodyTable) -> BodySize | None:
    """Return what the mesh of a body has; None where that is not seen without making it.

    Raises
    ------
    ModelError
        for entries of the shape that make no mesh
    """
    lines = lines_of(body.shape) if body.shape is not None else None
    boxed = any(each.x or each.y for each in body.boundaries.values())
    if lines is None or (lines.bent and boxed):
        return None
    cells, at_corner, on_edge, inside = per_place(body.element or "quad8")
    grid = _Rectangles(lines, body.move)
    edges = grid.sides()
    for new, each in body.boundaries.items():
        edges[new] = grid.within([edges[old] for old in each.of], each)
    parts = 2 if cells == "tri" else 1  # triangles cut each rectangle along a diagonal
    elements = parts * grid.cells
    few(elements)
    n_edges = grid.n_edges + (parts - 1) * grid.cells
    nodes = at_corner * grid.corners + on_edge * n_edges + inside * elements
    return BodySize(elements, nodes, edges, at_corner, on_edge)


class _Rectangles:
    """Rectangles between lines: corner (i, j) has the number i * (n_y + 1) + j."""

    def __init__(self, lines: GridLines, move: tuple[float, float]) -> None:
        self._x, self._y = lines.x + move[0], lines.y + move[1]
        self._names = lines.names
        nx, ny = len(lines.x) - 1, len(lines.y) - 1
        self.cells, self.corners = nx * ny, (nx + 1) * (ny + 1)
        self.n_edges = nx * (ny + 1) + ny * (nx + 1)

    def sides(self) -> dict[str, Edges]:
        """Return the edges of the outer sides."""
        number = np.arange(self.corners).reshape(len(self._x), len(self._y))
        sides = {"left": number[0], "right": number[-1], "bottom": number[:, 0],
                 "top": number[:, -1]}  # fmt: skip
        each = {name: sides[old] for name, old in self._names.items()}
        return {name: np.stack([side[:-1], side[1:]], axis=1) for name, side in each.items()}

    def within(self, edges: list[Edges], box: tables.BoundaryTable) -> Edges:
        """Return the edges whose middles lie in a box, each once."""
        found = np.unique(np.concatenate(edges), axis=0)
        i, j = np.divmod(found, len(self._y))
        inside = np.ones(len(found), dtype=bool)
        for at, span in ((self._x[i].mean(axis=1), box.x), (self._y[j].mean(axis=1), box.y)):
            if span is not None:
                inside &= (at >= span[0]) & (at <= span[1])
        return np.asarray(found[inside])
