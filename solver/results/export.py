"""Write fields at the nodes as VTU files for ParaView."""

from __future__ import annotations

import tempfile
from contextlib import ExitStack
from importlib import import_module
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from solver.errors import ModelError
from solver.files import appearing, read_file
from solver.results.mesh_fields import MeshFields
from solver.typing import Array

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
