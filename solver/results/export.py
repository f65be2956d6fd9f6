"""Fields at the nodes as files of other programs: VTU for ParaView."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np

from solver.errors import ModelError
from solver.tensors import components

if TYPE_CHECKING:
    import meshio
    from numpy.typing import NDArray

    from solver.results.mesh_fields import MeshFields

    Array = NDArray[np.float64]

_CELLS = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9"}
"""Nodes of an element -> cell of meshio. Corners, mid-sides and the middle have the same order in
both."""
_PVD = "stages.pvd"


def write_vtu(fields: MeshFields, folder: Path) -> Path:
    """Write a .vtu for each stage and the .pvd that holds them together; return the latter.

    They take the place of the stages that the folder had.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise ModelError("folder", str(folder), "must be a folder, or not exist yet") from None
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    stages = ElementTree.SubElement(root, "Collection")
    path, before = folder / _PVD, _listed(folder / _PVD)
    with tempfile.TemporaryDirectory(dir=folder) as part:
        for number, name in enumerate(fields.stages):
            file = f"{number}-{''.join(c if c.isalnum() else '-' for c in name)}.vtu"
            to_meshio(fields, name).write(Path(part) / file)
            ElementTree.SubElement(
                stages, "DataSet", timestep=repr(float(number)), name=name, file=file
            )
        whole = ElementTree.ElementTree(root)
        whole.write(Path(part) / _PVD, xml_declaration=True, encoding="utf-8")
        now = [each.attrib["file"] for each in stages]
        for name in (*now, _PVD):  # all are written: nothing is left half-done
            (Path(part) / name).replace(folder / name)
    for name in before - {*now}:
        (folder / name).unlink(missing_ok=True)
    return path


def _listed(path: Path) -> set[str]:
    """Return the files beside a .pvd that it lists; none where there is no such file."""
    try:
        found = ElementTree.parse(path).iter("DataSet")
        return {Path(each.attrib["file"]).name for each in found}
    except (OSError, ElementTree.ParseError, KeyError):
        return set()


def vtu_of(fields: MeshFields, stage: str) -> bytes:
    """Return the content of the .vtu of a stage."""
    with tempfile.TemporaryDirectory() as folder:  # meshio writes to a path only
        path = Path(folder) / "stage.vtu"
        to_meshio(fields, stage).write(path)
        return path.read_bytes()


def to_meshio(fields: MeshFields, stage: str) -> meshio.Mesh:
    """Return a stage as a mesh of meshio, all bodies in one.

    The cell field ``body`` has their number. Displacement has three components for ParaView's
    *Warp By Vector*; stress is in the fields ``stress_xx`` and so on. Numbers are in N, mm, MPa.
    """
    import meshio  # only who writes needs it

    values = dict(fields.stages[stage])
    moved, stress = values.pop("displacement"), values.pop("stress")
    names = components(len(stress))
    every = list(fields.bodies.values())
    return meshio.Mesh(
        _in_space(fields.X),
        [(_CELLS[cells.shape[1]], cells) for _, cells in every],
        point_data={
            "displacement": _in_space(moved),
            **{f"stress_{c}": each for c, each in zip(names, stress, strict=True)},
            **values,
        },
        cell_data={"body": [np.full(len(cells), k) for k, (_, cells) in enumerate(every)]},
    )


def _in_space(vectors: Array) -> Array:
    """Return vectors (n, 3) of (2, n), or of (3, n)."""
    return np.pad(vectors.T, ((0, 0), (0, 3 - len(vectors))))
