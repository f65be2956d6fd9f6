"""Fields of all bodies at the nodes of their meshes, for drawing and for ParaView (.vtu)."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from solver.errors import ModelError
from solver.files import appearing, read_file
from solver.results.body_fields import BODY_FIELDS
from solver.typing import Array, Ints

NO_NODE = -1
"""Node number that fills the rows of faces and cells with fewer nodes."""

_QUAD8 = (0, 4, 7), (1, 5, 4), (2, 6, 5), (3, 7, 6), (4, 5, 6, 7)
_ENDS = (0, 1, 2, 3, 8, 9, 10, 11), (4, 5, 6, 7, 12, 13, 14, 15)
"""Nodes of two opposite faces of a hexahedron, in the order of a quadrilateral."""
_FACES: Mapping[int, tuple[tuple[int, ...], ...]] = {
    3: ((0, 1, 2),),
    4: ((0, 1, 2, 3),),
    6: ((0, 3, 5), (1, 4, 3), (2, 5, 4), (3, 4, 5)),
    8: _QUAD8,
    9: ((0, 4, 8, 7), (4, 1, 5, 8), (8, 5, 2, 6), (7, 8, 6, 3)),
    20: (*(tuple(end[k] for k in face) for end in _ENDS for face in _QUAD8), (16, 17, 18, 19)),
}
"""Triangles and quadrilaterals that together use all nodes, by number of nodes of an element."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshFields:
    """Fields at the nodes of all bodies, body after body, in N, mm, MPa.

    Attributes
    ----------
    X : (n_axes, n_nodes) positions of the nodes before loading
    bodies : for each body its element and the nodes (n_cells, k) of its cells: corners, mid-sides,
        middle; in two dimensions counterclockwise, for hexahedra in the order of VTK
    stages : for each stage the fields of `BodyValues` by name
    """

    X: Array
    bodies: Mapping[str, tuple[str, Ints]]
    stages: Mapping[str, Mapping[str, Array]]

    @property
    def faces(self) -> tuple[Ints, Ints]:
        """Triangles and quadrilaterals through all nodes, and the number of their body.

        Elements with mid-side nodes are divided. The last node of a triangle is `NO_NODE`.

        Returns
        -------
        (n_faces, 4) nodes and (n_faces,) numbers
        """
        faces, numbers = [], []
        for number, (_, cells) in enumerate(self.bodies.values()):
            for corners in _FACES[cells.shape[1]]:
                nodes = cells[:, corners]
                lacking = ((0, 0), (0, 4 - len(corners)))
                faces.append(np.pad(nodes, lacking, constant_values=NO_NODE))
                numbers.append(np.full(len(nodes), number))
        return np.vstack(faces), np.concatenate(numbers)

    def parts(self, stage: str) -> Iterator[tuple[str, Array]]:
        """Yield the fields of a stage as numbers (n_nodes,) with names such as ``stress_xx``."""
        for name, field in BODY_FIELDS.items():
            values = np.atleast_2d(self.stages[stage][name])
            yield from zip(field.numbers(len(self.X)), values, strict=True)

    def joined(self, other: MeshFields) -> MeshFields:
        """Return the bodies of both; axes and stages must be the same."""
        first = self.X.shape[1]
        moved = {name: (element, first + cells) for name, (element, cells) in other.bodies.items()}
        stages = {
            stage: {
                name: np.concatenate([values, other.stages[stage][name]], axis=-1)
                for name, values in own.items()
            }
            for stage, own in self.stages.items()
        }
        return MeshFields(
            X=np.hstack([self.X, other.X]), bodies={**self.bodies, **moved}, stages=stages
        )


def counterclockwise(cells: Ints, X: Array) -> Ints:
    """Return the nodes of cells (n, k) in counterclockwise order, as other programs expect."""
    corners = 4 if cells.shape[1] in (4, 8, 9) else 3
    (x, y), ahead = X[:, cells[:, :corners]], np.roll(X[:, cells[:, :corners]], -1, axis=2)
    right = (x * ahead[1] - y * ahead[0]).sum(axis=1) < 0
    order = np.arange(cells.shape[1])
    order[1:corners] = order[1:corners][::-1]
    order[corners : 2 * corners] = order[corners : 2 * corners][::-1]
    return np.where(right[:, None], cells[:, order], cells)


_CELLS = {
    3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9", 20: "hexahedron20",
}  # fmt: skip
"""Cell type of meshio by number of nodes of an element. The order of nodes is the same: corners,
mid-sides, middle."""
_PVD, _FORMAT = "stages.pvd", "vtu"


def write_vtu(fields: MeshFields, folder: Path) -> Path:
    """Write a .vtu for each stage and a .pvd that lists them; return the path of the .pvd.

    They replace the stages of an earlier call. Raises `ModelError` if ``folder`` is a file.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise ModelError("folder", str(folder), "must be a folder, or not exist yet") from None
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    stages = ElementTree.SubElement(root, "Collection")
    path, before = folder / _PVD, _listed(folder / _PVD)
    with ExitStack() as written:  # all files appear when all are complete, the list last
        listed = written.enter_context(appearing(path))
        for number, name in enumerate(fields.stages):
            file = f"{number}-{''.join(c if c.isalnum() else '-' for c in name)}.vtu"
            part = written.enter_context(appearing(folder / file))
            to_meshio(fields, name).write(part, file_format=_FORMAT)
            ElementTree.SubElement(
                stages, "DataSet", timestep=repr(float(number)), name=name, file=file
            )
        ElementTree.ElementTree(root).write(listed, xml_declaration=True, encoding="utf-8")
    for name in before - {each.attrib["file"] for each in stages}:
        (folder / name).unlink(missing_ok=True)
    return path


def _listed(path: Path) -> set[str]:
    """Return the names of the files that a .pvd lists; empty if there is no such file."""
    try:
        found = ElementTree.fromstring(read_file(path)).iter("DataSet")
        return {Path(each.attrib["file"]).name for each in found}
    except (OSError, ElementTree.ParseError, KeyError):
        return set()


def vtu_of(fields: MeshFields, stage: str) -> bytes:
    """Return the content of the .vtu file of a stage."""
    with tempfile.TemporaryFile() as file:  # meshio can only write to a path
        to_meshio(fields, stage).write(f"/dev/fd/{file.fileno()}", file_format=_FORMAT)
        return file.read()


def to_meshio(fields: MeshFields, stage: str) -> Any:
    """Return a stage as one `meshio.Mesh` with all bodies.

    The cell field ``body`` is the number of the body. Displacement has three components for
    ParaView's *Warp By Vector*; stress is in the fields ``stress_xx`` and so on, and so are strain
    and plastic strain. Units: N, mm, MPa.
    """
    meshio = import_module("meshio")  # only export needs it

    values = fields.stages[stage]
    every = list(fields.bodies.values())
    return meshio.Mesh(
        _in_space(fields.X),
        [(_CELLS[cells.shape[1]], cells) for _, cells in every],
        point_data={
            "displacement": _in_space(values["displacement"]),
            **{name: each for name, each in fields.parts(stage) if name[:-2] != "displacement"},
        },
        cell_data={"body": [np.full(len(cells), k) for k, (_, cells) in enumerate(every)]},
    )


def _in_space(vectors: Array) -> Array:
    """Return vectors (2, n) or (3, n) as (n, 3), with z = 0 in two dimensions."""
    return np.pad(vectors.T, ((0, 0), (0, 3 - len(vectors))))
