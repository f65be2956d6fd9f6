"""The files beside a scene file: meshes of bodies, and tables of values."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

from solver.errors import ModelError
from solver.memory import kept
from solver.mesh.cells import collapsed, facets_of, mesh_of_cells, triangles_of
from solver.mesh.rounding import ROUNDED, with_zeros
from solver.model.tabulated import Tabulated, columns_of
from solver.rolling.rail.profiles.meshed_rail import section_of
from solver.rolling.rail.profiles.points import FOOT, RUNNING, SectionMesh
from solver.typing import Array, Ints
from studies.scenes.formats import read_mesh
from studies.scenes.meshdata import MeshData

OUTLINE = "outline"
"""Boundary of every mesh: all edges with an element on one side only."""

TABLE = ".csv"
"""Ending of a file with a table of values."""

MOST_POINTS = 1_000_000
"""Largest number of points of a mesh file."""

MOST_LINES = 100_000
"""Largest number of lines of a table of values."""

_CELLS = {"quad": 4, "quad8": 4, "quad9": 4, "triangle": 3, "triangle6": 3}
"""Cells of meshio that a body may have -> number of their corners."""
_TRIANGLE = {"quad": "triangle", "quad8": "triangle6", "quad9": "triangle6"}
"""Quadrilaterals -> the triangles into which they are divided."""
_LINES = ("line", "line3")
_POINTS = {"quad": 4, "quad8": 8, "quad9": 9, "triangle": 3, "triangle6": 6, "line": 2, "line3": 3}
"""Numbers of points of these cells and lines."""


@dataclass(frozen=True, eq=False, slots=True)
class MeshFile:
    """The content of a mesh file, or of a table of values.

    Attributes
    ----------
    name : name of the file; its ending tells the format
    data : its bytes
    arrays : what was read from them before (`MeshData.packed`); empty if they are to be read here
    """

    name: str
    data: bytes
    arrays: bytes = b""

    def read(self) -> Self:
        """Return the file with its arrays, so that nobody else needs to read its data.

        A table is text, which needs none.
        """
        if self.name.lower().endswith(TABLE):
            return self
        return replace(self, arrays=_read(self.name, self.data).packed())

    def columns(self, *names: str) -> NDArray[np.float64]:
        """Return columns (n, n_names) of a table of numbers.

        Raises
        ------
        ModelError
            if the file is no such table
        """
        return np.stack(list(columns_of(self._text(), names).values()), axis=1)

    def _text(self) -> str:
        if self.data.count(b"\n") > MOST_LINES:
            raise ModelError("table", "too many lines", f"must have at most {MOST_LINES} lines")
        try:
            return self.data.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise ModelError("table", self.name, f"cannot be read: {error}") from None

    def table(self, column: str) -> Tabulated:
        """Return the table of values of a column.

        Raises
        ------
        ModelError
            if the file is no such table
        """
        return Tabulated.of(self._text(), column)

    def mesh(self, part: str | None) -> Mesh:
        """Return the part of this name, or all cells, with named boundaries.

        Raises
        ------
        ModelError
            if the file cannot be read, has no such part, or is no plane mesh
        """
        return _mesh(self.name, self.data, self.arrays, part)

    def section(self) -> SectionMesh:
        """Return the section of a rail: all cells, and the lines `running` and `foot`.

        Raises
        ------
        ModelError
            if the file is no mesh of quadrilaterals, or has no such lines
        """
        mesh = self.mesh(None)
        if mesh.elem.refdom.nnodes != 4:
            allowed = "must have quadrilaterals alone: in gmsh set Mesh.SubdivisionAlgorithm = 1"
            raise ModelError("mesh", self.name, allowed)
        known = mesh.boundaries or {}
        for name in (RUNNING, FOOT):
            if name not in known:
                allowed = f"must name the lines {RUNNING} and {FOOT}; it has {', '.join(known)}"
                raise ModelError("mesh", self.name, allowed)
        return section_of(mesh)


@kept
def _mesh(name: str, data: bytes, arrays: bytes, part: str | None) -> Mesh:
    try:
        points, blocks, sets, nodes = MeshData.unpacked(arrays) if arrays else _read(name, data)
    except ModelError:
        raise
    except ValueError as error:
        raise ModelError("mesh", name, f"cannot be read: {error}") from None
    if len(points) > MOST_POINTS:
        raise ModelError("mesh", name, f"must have at most {MOST_POINTS} points, not {len(points)}")
    if not (points.size and np.isfinite(points).all()):
        raise ModelError("mesh", name, "must have finite points")
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise ModelError("mesh", name, "must have points of two or three coordinates")
    for kind, each in blocks:
        if each.ndim != 2 or each.shape[1] != _POINTS.get(kind, each.shape[1]):
            raise ModelError("mesh", name, f"has a {kind} of another number of points")
        if not _exist(each, points):
            raise ModelError("mesh", name, f"has a {kind} of points that do not exist")
    for key, numbers in nodes.items():
        if not _exist(numbers, points):
            raise ModelError("mesh", name, f"has a set {key} of points that do not exist")
    for key, own in sets.items():
        for k, rows in own.items():
            if not (0 <= k < len(blocks) and _exist(rows, blocks[k][1])):
                raise ModelError("mesh", name, f"has a set {key} of cells that do not exist")
    plane = [k for k, (kind, _) in enumerate(blocks) if kind in _CELLS]
    if not plane:
        listed = ", ".join(sorted({kind for kind, _ in blocks})) or "none"
        raise ModelError("mesh", name, f"must have cells {', '.join(_CELLS)}; it has {listed}")
    first = np.cumsum([0, *(len(cells) for _, cells in blocks)])  # number of the first of a block
    chosen = {k: np.arange(len(blocks[k][1])) for k in plane}
    if part is not None:
        parts = {key for key, own in sets.items() if any(_rows(own, k).size for k in plane)}
        if part not in parts:
            raise ModelError(
                "part",
                part,
                f"must be a part of {name}: {', '.join(sorted(parts)) or 'it has none'}",
            )
        chosen = {k: _rows(sets[part], k) for k in plane}
    taken = [
        (blocks[k][0], blocks[k][1][own], first[k] + own) for k, own in chosen.items() if len(own)
    ]
    if not taken:
        raise ModelError("mesh", name, f"must have cells {', '.join(_CELLS)}; it has none")
    points, body = _of_one_kind(name, points, taken)
    _check_plane(name, points[body.cells])
    mesh, number = mesh_of_cells(points[:, :2], body.cells, _CELLS[body.kind])
    mesh = with_zeros(mesh)
    lines = {k: cells[:, :2] for k, (kind, cells) in enumerate(blocks) if kind in _LINES}
    mesh = mesh.with_boundaries(_boundaries(mesh, number, lines, sets, nodes))
    regions = {}
    for key, own in sets.items():
        inside = np.zeros(first[-1], dtype=bool)
        for k in plane:
            inside[first[k] + _rows(own, k)] = True
        regions[key] = np.unique(body.place[inside[body.numbers]])
    return replace(mesh, _subdomains={name: own for name, own in regions.items() if len(own)})


class _BodyCells(NamedTuple):
    """Cells of one kind, and the places in them of cells of the file.

    A cell may be twice in the file, in two groups of gmsh, and be two of these.
    """

    kind: str
    cells: Ints
    numbers: Ints
    place: Ints

    @classmethod
    def of(cls, kind: str, cells: Ints, numbers: Ints) -> Self:
        """Return cells in their order, each once."""
        _, first, same = np.unique(cells, axis=0, return_index=True, return_inverse=True)
        order = np.sort(first)
        return cls(kind, cells[order], numbers, np.searchsorted(order, first[same.ravel()]))

    def joined(self, others: Self) -> Self:
        """Return these cells, and others of the same kind behind them."""
        return self._replace(
            cells=np.vstack([self.cells, others.cells]),
            numbers=np.concatenate([self.numbers, others.numbers]),
            place=np.concatenate([self.place, len(self.cells) + others.place]),
        )


def _of_one_kind(
    name: str, points: Array, taken: Iterable[tuple[str, Ints, Ints]]
) -> tuple[Array, _BodyCells]:
    """Return the cells of a body, of one kind, and the points with those that are new.

    Quadrilaterals with two corners at one point are triangles; among triangles the others are
    divided into triangles too.
    """
    found: dict[str, _BodyCells] = {}
    for kind, cells, numbers in taken:
        split = [(kind, cells, numbers)]
        if _CELLS[kind] == 4:
            which, triangles = collapsed(cells)
            own = np.delete(cells, which, axis=0), np.delete(numbers, which)
            split = [(kind, *own), (_TRIANGLE[kind], triangles, numbers[which])]
        for each, rows, at in split:
            if len(rows):
                new = _BodyCells.of(each, rows, at)
                found[each] = found[each].joined(new) if each in found else new
    for kind in _TRIANGLE.keys() & found.keys():
        if found.keys() == {kind, _TRIANGLE[kind]}:
            quads = found.pop(kind)
            points, halves = triangles_of(points, quads.cells)
            place = np.concatenate([2 * quads.place, 2 * quads.place + 1])
            new = _BodyCells(_TRIANGLE[kind], halves, np.tile(quads.numbers, 2), place)
            found[new.kind] = found[new.kind].joined(new)
    if len(found) > 1:
        listed = ", ".join(sorted(found))
        allowed = (
            "a body must have quadrilaterals of one kind with triangles of the same order "
            f"(quad and triangle, quad8 or quad9 and triangle6), not {listed}"
        )
        raise ModelError("mesh", name, allowed)
    (body,) = found.values()
    return points, body


def _check_plane(name: str, used: Array) -> None:
    """Refuse a mesh that does not lie in the xy plane, to the rounding of its coordinates."""
    span = np.ptp(used.reshape(-1, used.shape[-1]), axis=0)
    flat = span <= ROUNDED * span.max()
    if len(span) == 2 or flat[2]:
        return
    found = f"its z differ by {span[2]:g} mm"
    if flat.any():
        found = f"it lies in the {'yz' if flat[0] else 'xz'} plane; turn it in the mesher"
    raise ModelError("mesh", name, f"must lie in the xy plane: {found}")


_read = kept(read_mesh)


def _exist(numbers: NDArray[np.int64], rows: NDArray[Any]) -> bool:
    """Tell whether all numbers are those of rows of an array."""
    return not numbers.size or 0 <= int(numbers.min()) <= int(numbers.max()) < len(rows)


def _rows(own: dict[int, Any], block: int) -> NDArray[np.int64]:
    """Return the cells of a block that belong to a set."""
    return own.get(block, np.zeros(0, dtype=np.int64))


def _boundaries(
    mesh: Mesh,
    number: NDArray[np.int64],
    lines: dict[int, Any],
    sets: dict[str, dict[int, Any]],
    nodes: dict[str, Any],
) -> dict[str, NDArray[np.int64]]:
    """Return the outline, and the facets of each set of lines or nodes that lies on the mesh."""
    outline = np.asarray(mesh.boundary_facets())
    found = {OUTLINE: outline}
    for name, own in nodes.items():  # the edges of the outline with both ends in the set
        inside = np.isin(mesh.facets[:, outline], number[own])
        if inside.all(0).any():
            found[name] = outline[inside.all(0)]
    for name, own in sets.items():
        pairs = [number[cells[_rows(own, k)]] for k, cells in lines.items()]
        facets = facets_of(mesh, np.vstack([np.zeros((0, 2), dtype=int), *pairs]))
        if (facets >= 0).any():
            found[name] = np.unique(facets[facets >= 0])
    return found
