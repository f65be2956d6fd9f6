"""Size of the mesh of a body: elements, nodes and boundary edges; of a grid without making it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.errors import ModelError
from solver.mesh.rounding import in_box
from solver.mesh.shapes import few
from solver.scenes.grid_size import node_layout
from studies.scenes import tables
from studies.scenes.building import default_element
from studies.scenes.shape_tables import GridLines, GridTable, RoundTable, lines_of

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from skfem import Mesh

    Flags = NDArray[np.bool_]
    Edges = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class BodySize:
    """The size of a mesh.

    Attributes
    ----------
    elements, nodes : their numbers
    edges : boundary -> indices of the corners at the ends of its edges (n, 2)
    at_corner, on_edge : numbers of nodes at a corner, and inside an edge
    """

    elements: int
    nodes: int
    edges: Mapping[str, Edges]
    at_corner: int
    on_edge: int

    def on(self, boundaries: Iterable[str]) -> set[tuple[int, ...]]:
        """Return the corners and edges of boundaries, as tuples of corner indices."""
        found = (self.edges[name] for name in boundaries if name in self.edges)
        edges = [tuple(sorted(ends)) for each in found for ends in each.tolist()]
        return {*edges, *((corner,) for ends in edges for corner in ends)}

    def count(self, places: Iterable[tuple[int, ...]]) -> int:
        """Return the number of nodes at corners and inside edges."""
        return sum(self.at_corner if len(place) == 1 else self.on_edge for place in places)


def size_of_mesh(mesh: Mesh, element: str | None) -> BodySize:
    """Return the size of a mesh with an element; None is the default element of a body."""
    _, at_corner, on_edge, inside = node_layout(element or default_element(mesh))
    nodes = at_corner * mesh.nvertices + on_edge * mesh.nfacets + inside * mesh.nelements
    edges = {name: mesh.facets[:, each].T for name, each in (mesh.boundaries or {}).items()}
    return BodySize(mesh.nelements, int(nodes), edges, at_corner, on_edge)


def is_grid(body: tables.BodyTable) -> bool:
    """Tell whether the mesh of a body is one grid, bent or not; `size_of_grid` counts its size."""
    boxed = body.cuts or any(each.x or each.y for each in body.boundaries.values())
    return isinstance(body.shape, GridTable) or (isinstance(body.shape, RoundTable) and not boxed)


def size_of_grid(body: tables.BodyTable) -> BodySize:
    """Return the size of the mesh of a body that is one grid; see `is_grid`.

    Raises
    ------
    ModelError
        for entries of the shape that make no mesh, or one of too many elements
    """
    lines = lines_of(body.shape)
    cells, at_corner, on_edge, inside = node_layout(body.element or "quad8")
    grid = _Rectangles(lines, body)
    edges = grid.sides()
    for new, each in body.boundaries.items():
        for old in set(each.of) - edges.keys():
            allowed = f"must name boundaries of the mesh: {', '.join(edges)}"
            raise ModelError(f"boundaries.{new}.of", old, allowed)
        edges[new] = grid.within([edges[old] for old in each.of], each)
    parts = 2 if cells == "tri" else 1  # triangles cut each rectangle along a diagonal
    elements = parts * grid.cells
    few(elements)
    n_edges = grid.n_edges + (parts - 1) * grid.cells
    nodes = at_corner * grid.corners + on_edge * n_edges + inside * elements
    return BodySize(elements, nodes, edges, at_corner, on_edge)


class _Rectangles:
    """Rectangles between grid lines, without those that are cut out.

    Corner (i, j) has the index ``i * len(y) + j``.
    """

    def __init__(self, lines: GridLines, body: tables.BodyTable) -> None:
        self._x, self._y = lines.x + body.move[0], lines.y + body.move[1]
        middles = [(line[1:] + line[:-1]) / 2 for line in (self._x, self._y)]
        there = np.pad(np.ones([len(each) for each in middles], dtype=bool), 1)
        opened: dict[str, Flags] = {}
        for name, cut in body.cuts.items():
            within = [(m > s[0]) & (m < s[1]) for m, s in zip(middles, (cut.x, cut.y), strict=True)]
            opened[name] = there & np.pad(np.logical_and.outer(*within), 1)
            there &= ~opened[name]
        # an edge or a corner exists if a rectangle beside it does
        self._there, self._opened, self._names = there, opened, lines.names
        self._upright = there[:-1, 1:-1] | there[1:, 1:-1]
        self._level = there[1:-1, :-1] | there[1:-1, 1:]
        beside = there[:-1] | there[1:]
        self.cells, self.corners = int(there.sum()), int((beside[:, :-1] | beside[:, 1:]).sum())
        self.n_edges = int(self._upright.sum() + self._level.sum())

    def sides(self) -> dict[str, Edges]:
        """Return the edges of the outer sides and of the boundaries that cuts open."""
        upright, level = np.zeros_like(self._upright), np.zeros_like(self._level)
        ends = {"left": (0, None), "right": (-1, None), "bottom": (None, 0), "top": (None, -1)}
        found: dict[str, Edges] = {}
        for name, side in self._names.items():
            i, j = ends[side]
            one, other = upright.copy(), level.copy()
            if i is not None:
                one[i] = self._upright[i]
            else:
                other[:, j] = self._level[:, j]
            found[name] = self._edges(one, other)
        for name, cut in self._opened.items():
            one = (cut[:-1] & self._there[1:]) | (cut[1:] & self._there[:-1])
            other = (cut[:, :-1] & self._there[:, 1:]) | (cut[:, 1:] & self._there[:, :-1])
            found[name] = self._edges(one[:, 1:-1], other[1:-1])
        return found

    def _edges(self, upright: Flags, level: Flags) -> Edges:
        """Return the corner indices of edges (n, 2)."""
        number = np.arange(len(self._x) * len(self._y)).reshape(len(self._x), len(self._y))
        return np.concatenate([
            np.stack([number[:, :-1][upright], number[:, 1:][upright]], axis=1),
            np.stack([number[:-1][level], number[1:][level]], axis=1),
        ])  # fmt: skip

    def within(self, edges: list[Edges], box: tables.BoundaryTable) -> Edges:
        """Return the edges whose middles lie in a box, each once."""
        found = np.unique(np.concatenate(edges), axis=0)
        i, j = np.divmod(found, len(self._y))
        middles = np.stack([self._x[i].mean(axis=1), self._y[j].mean(axis=1)])
        size = max(np.ptp(self._x), np.ptp(self._y))
        return np.asarray(found[in_box(middles, (box.x, box.y), size)])
