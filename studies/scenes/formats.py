"""The formats of mesh files: what each has of points, cells, and names of sets.

Decks of Abaqus, MED and Exodus are read here, since meshio loses their sets; meshio reads the
others.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import re
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.errors import ModelError
from studies.scenes.abaqus import read_deck
from studies.scenes.meshdata import MeshData
from studies.scratch import scratch

_NUMBERS = ("gmsh:physical", "medit:ref", "nastran:ref")
"""Cell data of meshio that hold the number of the set of each cell."""
_MED = {
    "PO1": "vertex", "SE2": "line", "SE3": "line3", "TR3": "triangle", "TR6": "triangle6",
    "QU4": "quad", "QU8": "quad8", "QU9": "quad9",
}  # fmt: skip
_EXODUS = {
    ("BAR", 2): "line", ("BEAM", 2): "line", ("TRUSS", 2): "line", ("EDGE", 2): "line",
    ("BAR", 3): "line3", ("BEAM", 3): "line3", ("TRUSS", 3): "line3", ("EDGE", 3): "line3",
    ("TRI", 3): "triangle", ("TRI", 6): "triangle6", ("QUAD", 4): "quad", ("QUAD", 8): "quad8",
    ("QUAD", 9): "quad9", ("SHELL", 4): "quad", ("SHELL", 8): "quad8", ("SHELL", 9): "quad9",
}  # fmt: skip
_NASTRAN = ("CTRIA3", "CTRIA6", "CTRIAR", "CTRIAX6", "CQUAD4", "CQUAD8", "CQUADR", "CSHEAR")
"""Plane elements of Nastran that are read."""


_ADVICE = {
    "parametric nodes": "its nodes have parameters: save it with Mesh.SaveParametric = 0",
    "Need mesh format": "save it with Mesh.MshFileVersion = 4.1",
    "ENS_MAA": "it has no mesh of MED 3 or later: save it as such",
    "file signature not found": "it is no HDF5 file, as those of MED 3 or later",
    "Unknown file format": "it is no netCDF file, as those of Exodus are",
}
"""What to do, by words of the libraries that read files."""


def read_mesh(name: str, data: bytes) -> MeshData:
    """Return the content of a mesh file.

    Raises
    ------
    ModelError
        if its format is not read, or with the reason why it cannot be read
    """
    reader = next((FORMATS[end] for end in FORMATS if name.lower().endswith(end)), None)
    if reader is None:
        raise ModelError("mesh", name, f"must end in one of {', '.join(FORMATS)}")
    try:
        with contextlib.redirect_stdout(None), contextlib.redirect_stderr(None):
            return reader(data)  # meshio prints remarks
    except MemoryError:
        raise
    except Exception as error:  # a damaged file may raise any
        reason = str(error) or f"{type(error).__name__}; save it in another format, such as .msh"
        if isinstance(error, LookupError | AssertionError):
            reason = f"{type(error).__name__} {error}"
        known = (advice for words, advice in _ADVICE.items() if words in reason)
        raise ModelError("mesh", name, f"cannot be read: {next(known, reason)}") from None


def load_readers() -> None:
    """Import what reads files, so that copies of this process find it loaded."""
    for library in ("h5py", "meshio", "netCDF4"):
        importlib.import_module(library)


def _abaqus(data: bytes) -> MeshData:
    return read_deck(data.decode("utf-8-sig", errors="replace"))


def _by_meshio(kind: str, data: bytes) -> Any:
    """Return what a reader of meshio makes of a file; it can only read from a path."""
    with scratch() as folder:
        path = folder / "mesh"
        path.write_bytes(data)
        try:
            return importlib.import_module(f"meshio.{kind}").read(str(path))
        except Exception as error:
            if not error.args or not isinstance(error.args[0], str):
                raise
            error.args = (error.args[0].replace(str(path), "the file"), *error.args[1:])
            raise


def _plain(kind: str, data: bytes) -> MeshData:
    return _arrays(_by_meshio(kind, data))


def _gmsh(data: bytes) -> MeshData:
    """Return the mesh of a file of gmsh.

    A group of lines and one of surfaces may share a name; an entity whose line runs backwards has
    the number of its group with a minus.
    """
    if b"$MeshFormat" not in data:
        reason = "it has no $MeshFormat, as those of gmsh 1: save it with Mesh.MshFileVersion = 4.1"
        raise ValueError(reason)
    section = data.partition(b"$PhysicalNames")[2].partition(b"$EndPhysicalNames")[0].decode()
    named = re.findall(r'(\d+)\s+(\d+)\s+"(.*)"', section)
    names = {(int(dim), int(number)): name for dim, number, name in named}
    try:
        found = _by_meshio("gmsh", data)
    except ValueError as error:
        if "gmsh:physical" not in str(error):
            raise
        reason = "some of its cells are in no physical group: save it with Mesh.SaveAll = 0"
        raise ValueError(reason) from None
    first, groups = found.cell_data.pop("gmsh:physical", None), _groups_of_entities(data)
    made = _arrays(found)
    for k, block in enumerate(found.cells if first else ()):
        rows = np.arange(len(block.data))
        if groups and len(rows):
            entity = int(found.cell_data["gmsh:geometrical"][k][0])
            numbers = dict.fromkeys(groups[block.dim, entity], rows)
        else:
            numbers = {each: rows[first[k] == each] for each in np.unique(first[k]).tolist()}
        for number, own in numbers.items():
            group = abs(number)
            _add(made.sets, names.get((block.dim, group), str(group)), k, own)
    return made


def _groups_of_entities(data: bytes) -> dict[tuple[int, int], list[int]]:
    """Return dimension and number of an entity of gmsh 4 -> its groups.

    meshio keeps the first of them. Format 2 has no entities: it repeats a cell in each group.
    """
    head = re.search(rb"\$MeshFormat\s+(\S+)\s+([01])\s+(\d)", data)
    begin = re.search(rb"^\$Entities\s*?\n", data, re.MULTILINE)
    if head is None or begin is None:
        return {}
    version, binary, size = head.groups()
    section = data[begin.end() : data.find(b"$EndEntities", begin.end())]
    values = np.array(section.split(), dtype=float) if binary == b"0" else None
    at, count_type = 0, f"u{size.decode()}"

    def take(kind: str, count: int) -> list[int]:
        nonlocal at
        if values is None:
            found = np.frombuffer(section, kind, count, at)
            at += found.nbytes
        else:
            found = values[at : at + count]
            at += count
        if len(found) != count:
            raise ValueError("its entities end too early")
        return [int(each) for each in found] if kind != "f8" else []

    groups = {}
    for dim, entities in enumerate(take(count_type, 4)):
        for _ in range(entities):
            (entity,) = take("i4", 1)
            take("f8", 3 if dim == 0 and version != b"4.0" else 6)  # its place or its box
            groups[dim, entity] = take("i4", *take(count_type, 1))
            if dim:
                take("i4", *take(count_type, 1))  # what bounds it
    return groups


def _nastran(data: bytes) -> MeshData:
    """Return the mesh of bulk data, which may stand without the lines before and behind it."""
    text = data.decode("utf-8", errors="replace").upper()
    for line, row in enumerate(text.splitlines(), start=1):
        word = row.partition(",")[0][:8].strip()
        coordinates = (
            row.split(",")[2:3] if "," in row else [row[24:40] if "*" in word else row[16:24]]
        )
        if word in ("INCLUDE", "GRDSET") or (
            re.match("C(QUAD|TRI|TRAX|PLST|SHEAR)", word) and word not in _NASTRAN
        ):
            raise ValueError(f"line {line}: {word} is not read, but {', '.join(_NASTRAN)}")
        if word in ("GRID", "GRID*") and "".join(coordinates).strip() not in ("", "0"):
            raise ValueError(f"line {line}: coordinates must be in the global system")
    begin, end = ("" if each in text else each for each in ("BEGIN BULK", "ENDDATA"))
    return _plain("nastran", f"{begin}\n{text}\n{end}\n".encode())


def _arrays(found: Any) -> MeshData:
    """Return the arrays of a mesh; a set of cells has its number for a name."""
    sets: dict[str, dict[int, NDArray[np.int64]]] = {}
    for key in set(_NUMBERS) & found.cell_data.keys():
        for k, numbers in enumerate(found.cell_data[key]):
            for number in np.unique(numbers):
                _add(sets, str(number), k, np.flatnonzero(numbers == number))
    return MeshData(
        points=np.asarray(found.points, dtype=float),
        cells=[(block.type, np.asarray(block.data)) for block in found.cells],
        sets=sets,
        nodes={},
    )


def _add(
    sets: dict[str, dict[int, NDArray[np.int64]]], name: str, block: int, rows: NDArray[Any]
) -> None:
    own = sets.setdefault(name, {})
    own[block] = np.union1d(own.get(block, rows), rows).astype(np.int64)


def _med(data: bytes) -> MeshData:
    """Return the mesh of a MED file; a family is what belongs to the same groups."""
    import h5py

    with h5py.File(io.BytesIO(data)) as file:
        meshes = file["ENS_MAA"]
        if len(meshes) != 1:
            raise ValueError(f"must have one mesh, not {', '.join(meshes) or 'none'}")
        ((name, mesh),) = meshes.items()
        if "NOE" not in mesh:
            if len(mesh) != 1:
                raise ValueError(f"must have one step of {name}, not {len(mesh)}")
            (mesh,) = mesh.values()
        families = file.get(f"FAS/{name}", {})
        place = mesh["NOE/COO"]
        points = place[()].reshape((place.attrs["NBR"], -1), order="F")
        made = MeshData(points, [], {}, {})
        if "FAM" in mesh["NOE"]:
            for group, rows in _groups(families.get("NOEUD", {}), mesh["NOE/FAM"][()]):
                made.nodes[group] = np.union1d(made.nodes.get(group, rows), rows)
        for k, (kind, own) in enumerate(mesh["MAI"].items()):
            if kind in ("POG", "POG2"):
                raise ValueError("polygons are not read: save them as triangles or quadrilaterals")
            numbers = own["NOD"]
            cells = numbers[()].reshape((numbers.attrs["NBR"], -1), order="F") - 1
            made.cells.append((_MED.get(kind, kind), cells.astype(np.int64)))
            if "FAM" in own:
                for group, rows in _groups(families.get("ELEME", {}), own["FAM"][()]):
                    _add(made.sets, group, k, rows)
    return made


def _groups(
    families: Mapping[str, Any], own: NDArray[np.int64]
) -> list[tuple[str, NDArray[np.int64]]]:
    """Return the groups of families of MED, and what belongs to them."""
    found = []
    for family in families.values():
        names = family["GRO/NOM"][()] if "GRO" in family else ()
        rows = np.flatnonzero(own == family.attrs["NUM"])
        for name in names if len(rows) else ():
            found.append(
                (bytes(np.array(name, dtype=np.uint8)).decode(errors="replace").strip("\0 "), rows)
            )
    return found


def _exodus(data: bytes) -> MeshData:
    """Return the mesh of an Exodus file, with its blocks, sets of nodes, and sets of sides."""
    import netCDF4

    with netCDF4.Dataset("mesh", memory=data) as file:
        file.set_auto_mask(False)
        own = {name: each for name, each in file.variables.items() if not name.startswith("vals")}
        axes = [own[f"coor{axis}"][:] for axis in "xyz" if f"coor{axis}" in own]
        made = MeshData(np.array(own["coord"][:] if "coord" in own else axes, float).T, [], {}, {})
        shell = []
        for k, name in _exodus_names(own, "eb", "connect"):
            block = own[f"connect{k}"]
            kind = re.sub(r"\d", "", block.elem_type.upper()).replace("TRIANGLE", "TRI")
            shell.append("SHELL" in kind)
            cells = block[:].astype(np.int64) - 1
            kind = kind.replace("TRISHELL", "TRI")
            _add(made.sets, name, len(made.cells), np.arange(len(cells)))
            made.cells.append((_EXODUS.get((kind, cells.shape[1]), kind), cells))
        for k, name in _exodus_names(own, "ns", "node_ns"):
            made.nodes[name] = own[f"node_ns{k}"][:].astype(np.int64) - 1
        first = np.cumsum([0, *(len(cells) for _, cells in made.cells)])
        for k, name in _exodus_names(own, "ss", "elem_ss"):
            element, side = (
                own[f"{what}_ss{k}"][:].astype(np.int64) - 1 for what in ("elem", "side")
            )
            within = np.searchsorted(first, element, side="right") - 1
            edges = []
            for at in np.unique(within).tolist():
                kind, cells = made.cells[at]
                corners = {"t": 3, "q": 4}.get(kind[0], 0)
                start = side[within == at] - 2 * shell[at]  # sides 1 and 2 of a shell are its faces
                if not (corners and 0 <= start.min() <= start.max() < corners):
                    raise ValueError(f"the set of sides {name} must have edges of plane elements")
                rows = cells[element[within == at] - first[at]]
                pairs = [rows[np.arange(len(rows)), each % corners] for each in (start, start + 1)]
                edges.append(np.stack(pairs, axis=1))
            _add(made.sets, name, len(made.cells), np.arange(len(element)))
            made.cells.append(("line", np.concatenate([np.zeros((0, 2), np.int64), *edges])))
    return made


def _exodus_names(own: Mapping[str, Any], kind: str, data: str) -> list[tuple[int, str]]:
    """Return the numbers of blocks or sets that are there, and their names, else their ids."""
    ids = own[f"{kind}_prop1"][:].tolist() if f"{kind}_prop1" in own else []
    names = own[f"{kind}_names"][:] if f"{kind}_names" in own else [[]] * len(ids)
    found = []
    for k, (number, name) in enumerate(zip(ids, names, strict=True), start=1):
        if f"{data}{k}" in own:
            found.append((k, b"".join(name).decode().strip("\0 ") or str(number)))
    return found


FORMATS: dict[str, Callable[[bytes], MeshData]] = {
    ".msh": _gmsh,
    ".inp": _abaqus,
    ".med": _med,
    ".e": _exodus,
    ".exo": _exodus,
    ".vtk": partial(_plain, "vtk"),
    ".vtu": partial(_plain, "vtu"),
    ".mesh": partial(_plain, "medit"),
    ".bdf": _nastran,
    ".nas": _nastran,
}
"""Ending of a mesh file -> its reader. None refers to other files."""
