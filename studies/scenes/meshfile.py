"""The files beside a scene file: meshes of bodies, read by meshio, and tables of values."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from solver.errors import ModelError
from solver.memory import kept
from solver.mesh.cells import facets_of, mesh_of_cells
from solver.mesh.section_mesh import FOOT, RUNNING, SectionMesh
from solver.model.tabulated import Tabulated, columns_of
from studies.scenes.meshdata import MeshData
from studies.scratch import scratch

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from skfem import Mesh

OUTLINE = "outline"
"""Boundary of every mesh: all edges with an element on one side only."""

FORMATS = (".msh", ".vtk", ".vtu", ".mesh", ".bdf", ".nas")
"""Endings of mesh files in formats that do not refer to other files."""

TABLE = ".csv"
"""Ending of a file with a table of values."""

MOST_POINTS = 1_000_000
"""Largest number of points of a mesh file."""

MOST_LINES = 100_000
"""Largest number of lines of a table of values."""

_CELLS = {"quad": 4, "quad8": 4, "quad9": 4, "triangle": 3, "triangle6": 3}
"""Cells of meshio that a body may have -> number of their corners."""
_LINES = ("line", "line3")
_POINTS = {"quad": 4, "quad8": 8, "quad9": 9, "triangle": 3, "triangle6": 6, "line": 2, "line3": 3}
"""Numbers of the points of these cells and lines."""
_NUMBERS = ("gmsh:physical", "medit:ref", "nastran:ref")
"""Cell data of meshio that hold the number of the set of each cell."""


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
        if self.name.endswith(TABLE):
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
            raise ModelError("mesh", self.name, "must have quadrilaterals")
        known = mesh.boundaries or {}
        for name in (RUNNING, FOOT):
            if name not in known:
                allowed = f"must name the lines {RUNNING} and {FOOT}; it has {', '.join(known)}"
                raise ModelError("mesh", self.name, allowed)
        return SectionMesh.of(mesh)


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
    if points.shape[1] == 3 and np.ptp(points[:, 2]) > 0:
        raise ModelError("mesh", name, "must lie in a plane: its z differ")
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
    taken = {k: np.arange(len(blocks[k][1])) for k in plane}
    if part is not None:
        parts = {key for key, own in sets.items() if any(_rows(own, k).size for k in plane)}
        if part not in parts:
            raise ModelError(
                "part",
                part,
                f"must be a part of {name}: {', '.join(sorted(parts)) or 'it has none'}",
            )
        taken = {k: _rows(sets[part], k) for k in plane}
    chosen = {k: blocks[k][1][own] for k, own in taken.items() if len(own)}
    if not chosen:
        raise ModelError("mesh", name, f"must have cells {', '.join(_CELLS)}; it has none")
    kind, *others = sorted({blocks[k][0] for k in chosen})
    if others:
        raise ModelError(
            "mesh", name, f"a body must have cells of one kind, not {', '.join((kind, *others))}"
        )
    mesh, number = mesh_of_cells(points[:, :2], np.vstack(list(chosen.values())), _CELLS[kind])
    lines = {k: cells[:, :2] for k, (kind, cells) in enumerate(blocks) if kind in _LINES}
    mesh = mesh.with_boundaries(_boundaries(mesh, number, lines, sets, nodes))
    regions = {
        name: np.flatnonzero(np.concatenate([np.isin(taken[k], _rows(own, k)) for k in chosen]))
        for name, own in sets.items()
    }
    return replace(mesh, _subdomains={name: own for name, own in regions.items() if len(own)})


@kept
def _read(name: str, data: bytes) -> MeshData:
    import meshio

    with scratch() as folder:
        path = folder / f"mesh{''.join(Path(name).suffixes[-1:])}"
        path.write_bytes(data)
        try:
            with contextlib.redirect_stdout(None), contextlib.redirect_stderr(None):
                return _arrays(meshio.read(path))  # meshio prints remarks
        except SystemExit:  # meshio exits if it does not know a format
            reason = "its format is not known"
        except MemoryError:
            raise
        except IndexError:
            reason = "a cell or a set names a point that is not there"
        except Exception as error:  # a damaged file may raise any
            reason = str(error).replace(str(path), name) or type(error).__name__
    raise ModelError("mesh", name, f"cannot be read: {reason}")


def _arrays(found: Any) -> MeshData:
    return MeshData(
        points=np.asarray(found.points, dtype=float),
        cells=[(block.type, np.asarray(block.data)) for block in found.cells],
        sets=_sets(found),
        nodes={name: np.asarray(own, dtype=np.int64) for name, own in found.point_sets.items()},
    )


def _sets(found: Any) -> dict[str, dict[int, Any]]:
    """Return the cells of each set by block; the name of a set without one is its number."""
    sets = {
        name: {
            k: np.asarray(rows, dtype=np.int64) for k, rows in enumerate(each) if rows is not None
        }
        for name, each in found.cell_sets.items()
        if not name.startswith("gmsh:")
    }
    names = {tuple(map(int, each)): name for name, each in found.field_data.items()}
    for key in set(_NUMBERS) & found.cell_data.keys():
        for k, (block, numbers) in enumerate(zip(found.cells, found.cell_data[key], strict=True)):
            for number in np.unique(numbers):
                name = names.get((int(number), block.dim), str(number))
                sets.setdefault(name, {}).setdefault(k, np.flatnonzero(numbers == number))
    return sets


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
