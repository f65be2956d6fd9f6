"""Meshes from files: parts, boundaries, curved sides, and files that are none."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import pytest
from skfem import Basis

from solver.errors import ModelError
from solver.mesh.check import check_mesh
from solver.mesh.elements import element_type
from studies.scenes import scene
from studies.scenes.description import Description
from studies.scenes.formats import FORMATS
from studies.scenes.meshdata import MeshData
from studies.scenes.meshfile import OUTLINE, MeshFile
from tests.studies.scenes.conftest import blocks

PIN = Path(__file__).parents[3] / "data/scenes/pin.msh"
SQUARE = np.array([[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]], dtype=float)


def written(tmp_path: Path, mesh: meshio.Mesh, name: str = "mesh.vtu") -> MeshFile:
    path = tmp_path / name
    mesh.write(path)
    return MeshFile(name, path.read_bytes())


def test_parts_of_a_gmsh_file_have_their_boundaries() -> None:
    file = MeshFile("pin.msh", PIN.read_bytes())
    pin, plate = file.mesh("pin"), file.mesh("plate")
    assert {"rim", "bore", "middle", OUTLINE} == set(pin.boundaries)
    assert {"hole", "outside", "middle", OUTLINE} == set(plate.boundaries)
    for name, mesh in (("pin", pin), ("plate", plate)):
        check_mesh(mesh, name, element_type("tri6"))
    rim = np.unique(pin.dofs.facet_dofs[0, np.asarray(pin.boundaries["rim"])])
    assert np.hypot(*pin.doflocs[:, rim]) == pytest.approx(10.0), "middles of sides are on the arc"
    ends = np.unique(plate.facets[:, np.asarray(plate.boundaries["hole"])])
    assert np.hypot(*plate.p[:, ends]) == pytest.approx(10.0)


def two_squares(**data: object) -> meshio.Mesh:
    """Return two squares, the lower side of the right one a line."""
    cells = [("line", np.array([[1, 2]])), ("quad", np.array([[0, 1, 4, 3], [1, 2, 5, 4]]))]
    return meshio.Mesh(np.pad(SQUARE, ((0, 0), (0, 1))), cells, **data)


@pytest.mark.parametrize(
    ("name", "key", "names"),
    [
        ("mesh.msh", "gmsh:physical", {"right": (7, 2), "below": (3, 1)}),  # format 2.2
        ("mesh.msh", "gmsh:physical", {}),
        ("mesh.mesh", "medit:ref", {}),
    ],
)
def test_numbers_of_cells_tell_parts_and_boundaries(
    tmp_path: Path, name: str, key: str, names: dict[str, tuple[int, int]]
) -> None:
    numbers = [np.array([3]), np.array([4, 7])]
    mesh = two_squares(
        cell_data={key: numbers, "gmsh:geometrical": numbers}
        if name == "mesh.msh"
        else {key: numbers},
        field_data={name: np.array(tag) for name, tag in names.items()},
    )
    path = tmp_path / name
    if name == "mesh.msh":
        meshio.write(path, mesh, file_format="gmsh22")
    else:
        mesh.write(path)
    file = MeshFile(name, path.read_bytes())
    part, boundary = ("right", "below") if names else ("7", "3")
    right = file.mesh(part)
    assert right.p[0].min() == 1.0
    assert right.nelements == 1
    assert set(right.boundaries) == {OUTLINE, boundary}
    ends = right.p[:, right.facets[:, right.boundaries[boundary]]]
    assert ends[1] == pytest.approx(0.0)
    assert ends.shape == (2, 2, 1)
    with pytest.raises(ModelError, match=f"4, {part}"):
        file.mesh("below" if names else "3")


def test_points_that_are_not_there_or_none_are_refused(tmp_path: Path) -> None:
    for index in (-1, 6):
        mesh = meshio.Mesh(SQUARE, [("quad", np.array([[0, 1, 4, index]]))])
        with pytest.raises(ModelError, match=r"mesh\.mesh"):
            written(tmp_path, mesh, "mesh.mesh").mesh(None)
    holed = np.where(SQUARE == 2, np.nan, SQUARE)
    mesh = meshio.Mesh(holed, [("quad", np.array([[0, 1, 4, 3]]))])
    with pytest.raises(ModelError, match="finite points"):
        written(tmp_path, mesh, "mesh.mesh").mesh(None)


@pytest.mark.parametrize("kind", ["quad", "quad8", "quad9", "triangle", "triangle6"])
def test_all_kinds_of_cells_are_read(tmp_path: Path, kind: str) -> None:
    quads = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
    corners = quads if "quad" in kind else np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    n = corners.shape[1]
    points, cells = list(SQUARE), []
    for cell in corners:
        nodes = list(cell)
        if kind[-1] in "689":
            middles = [
                (SQUARE[a] + SQUARE[b]) / 2 for a, b in zip(cell, np.roll(cell, -1), strict=True)
            ]
            middles += [SQUARE[cell].mean(axis=0)] if kind == "quad9" else []
            nodes += range(len(points), len(points) + len(middles))
            points += middles
        cells.append(nodes)
    mesh = meshio.Mesh(np.pad(points, ((0, 0), (0, 1))), [(kind, np.array(cells))])
    found = written(tmp_path, mesh).mesh(None)
    usual = "quad8" if n == 4 else "tri6"
    check_mesh(found, "square", element_type(usual))
    assert found.nelements == len(corners)
    assert len(found.boundaries[OUTLINE]) == 6


def test_curved_sides_of_quad8_stay_curved(tmp_path: Path) -> None:
    angle = np.radians([0, 90, 90, 0, 45, 90, 45, 0])
    radius = np.array([1, 1, 2, 2, 1, 1.5, 2, 1.5])
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=1)
    order = np.array([[0, 3, 2, 1, 7, 6, 5, 4]])
    found = written(tmp_path, meshio.Mesh(points, [("quad8", order)])).mesh(None)
    radii = np.sort(np.hypot(*found.doflocs))
    assert radii[[0, 1, 2]] == pytest.approx(1.0)
    assert radii[[-1, -2, -3]] == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("points", "cells", "words"),
    [
        (SQUARE, [("line", [[0, 1]])], "must have cells"),
        (
            SQUARE,
            [
                ("line3", [[0, 2, 1]]),
                ("quad8", [[0, 2, 5, 3, 1, 2, 4, 3]]),
                ("triangle", [[0, 1, 4]]),
            ],
            "quadrilaterals of one kind with triangles of the same order.*, not quad8, triangle",
        ),
        (
            SQUARE,
            [("quad8", [[0, 2, 5, 3, 1, 2, 4, 3]]), ("quad9", [[0, 2, 5, 3, 1, 2, 4, 3, 4]])],
            "quadrilaterals of one kind with triangles of the same order.*, not quad8, quad9",
        ),
        (None, [("quad", [[0, 1, 4, 3]])], "lie in the xy plane: its z differ by 4 mm"),
    ],
)
def test_what_is_no_plane_mesh_is_refused(
    tmp_path: Path, points: np.ndarray | None, cells: list[tuple[str, list[list[int]]]], words: str
) -> None:
    flat = np.pad(SQUARE, ((0, 0), (0, 1)))
    at = flat + (np.arange(6)[:, None] * [0, 0, 1] if points is None else 0)
    mesh = meshio.Mesh(at, [(kind, np.array(each)) for kind, each in cells])
    with pytest.raises(ModelError, match=words):
        written(tmp_path, mesh).mesh(None)


@pytest.mark.parametrize(
    "name", [*(f"mesh{ending}" for ending in FORMATS), "mesh.what", "mesh.xdmf", "mesh"]
)
@pytest.mark.parametrize("data", [b"", b"nothing", bytes(range(256)) * 20])
def test_a_file_that_is_no_mesh_is_refused(name: str, data: bytes) -> None:
    with pytest.raises(ModelError, match=name):
        MeshFile(name, data).mesh(None)


def test_a_damaged_gmsh_file_is_refused() -> None:
    data = PIN.read_bytes()
    for cut in (100, 5000, len(data) // 2):
        with pytest.raises(ModelError, match=r"pin\.msh"):
            MeshFile("pin.msh", data[:cut]).mesh("pin")


@pytest.mark.parametrize(
    ("name", "data", "told"),
    [
        ("a.msh", b"$MeshFormat\n5 0 8\n$EndMeshFormat\n", "save it with Mesh.MshFileVersion"),
        ("a.msh", b"$NOD\n0\n$ENDNOD\n", "gmsh 1: save it with Mesh.MshFileVersion = 4.1"),
        ("a.mesh", b"MeshVersionFormatted 2\nVerticesOfAll\n", "Unknown keyword 'VerticesOfAll'"),
        ("a.bdf", b"BEGIN BULK\nGRID,1,,0,0,0\nCQUADX,1,,1,2,3,4\n", "line 3: CQUADX is not read"),
        (
            "a.bdf",
            b"GRID*                  1               7\n",
            "line 1: coordinates must be in",
        ),
        ("a.vtu", b"<VTKFile", "ReadError; save it in another format, such as .msh"),
        ("a.med", b"\x0emed 2.3 file", "it is no HDF5 file, as those of MED 3 or later"),
        ("a.e", b"CDF\x01aaaa", "it is no netCDF file"),
        ("a.e", b"CDF", "NetCDF: Invalid argument"),
        ("a.xdmf", b"", r"must end in one of \.msh, \.inp, \.med"),
    ],
)
def test_the_reason_of_a_reader_is_in_the_error(name: str, data: bytes, told: str) -> None:
    with pytest.raises(ModelError, match=told):
        MeshFile(name, data).mesh(None)


GROUPS = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
3
1 1 "side"
2 1 "whole"
2 2 "side"
$EndPhysicalNames
$Entities
0 1 1 0
1 0 0 0 1 0 0 1 -1 0
1 0 0 0 1 1 0 2 1 2 0
$EndEntities
$Nodes
1 4 1 4
2 1 0 4
1
2
3
4
0 0 0
1 0 0
1 1 0
0 1 0
$EndNodes
$Elements
2 2 1 2
1 1 1 1
1 1 2
2 1 3 1
2 1 2 3 4
$EndElements
"""


def test_parameters_of_nodes_are_refused_with_what_to_do() -> None:
    text = PIN.read_text()
    head, nodes = text.split("$Nodes\n")
    count, first, rest = nodes.split("\n", 2)
    dim, entity, _, number = first.split()
    data = f"{head}$Nodes\n{count}\n{dim} {entity} 1 {number}\n{rest}".encode()
    with pytest.raises(ModelError, match=r"save it with Mesh.SaveParametric = 0"):
        MeshFile("pin.msh", data).mesh("pin")


def test_groups_of_gmsh_that_share_a_name_or_a_cell_or_run_backwards() -> None:
    """The surface has two groups; the line, which runs backwards, has the name of one of them."""
    mesh = MeshFile("a.msh", GROUPS.encode()).mesh("side")
    assert {name: len(own) for name, own in mesh.subdomains.items()} == {"side": 1, "whole": 1}
    assert mesh.p[1, mesh.facets[:, mesh.boundaries["side"]]] == pytest.approx(0.0)
    some = GROUPS.replace("1 0 0 0 1 0 0 1 -1 0", "1 0 0 0 1 0 0 0 0")
    with pytest.raises(ModelError, match=r"no physical group: save it with Mesh\.SaveAll = 0"):
        MeshFile("a.msh", some.encode()).mesh("side")


def binary_of_gmsh(text: str) -> bytes:
    """Return the binary form of GROUPS."""
    forms = {"Entities": "4qi6dqiqi6dq2iq", "Nodes": "4q3i5q12d", "Elements": "4q3i4q3i6q"}
    made = text.partition("$Entities")[0].replace("4.1 0 8\n", "4.1 1 8\n\1\0\0\0\n").encode()
    for name, form in forms.items():
        numbers = text.partition(f"${name}\n")[2].partition("$")[0].split()
        values = struct.pack("=" + form, *map(int, numbers))
        made += b"$%b\n%b\n$End%b\n" % (name.encode(), values, name.encode())
    return made


@pytest.mark.parametrize("form", [str.encode, binary_of_gmsh])
@pytest.mark.parametrize("named", [2, 1, 0])
def test_every_group_of_an_entity_of_gmsh_is_read_with_or_without_a_name(
    form: Callable[[str], bytes], named: int
) -> None:
    """A group without a name has its number, also on a line that runs backwards."""
    text = GROUPS.replace("-1 0\n", "-3 0\n")
    for number, name in list(enumerate(("whole", "side"), start=1))[named:]:
        text = text.replace(f'2 {number} "{name}"\n', "")
    text = text.replace("$PhysicalNames\n3", f"$PhysicalNames\n{1 + named}")
    mesh = MeshFile("a.msh", form(text)).mesh(None)
    whole, side = ["whole", "side"][:named] + ["1", "2"][named:]
    assert {name: len(own) for name, own in mesh.subdomains.items()} == {whole: 1, side: 1}
    assert mesh.p[1, mesh.facets[:, mesh.boundaries["3"]]] == pytest.approx(0.0)
    assert set(mesh.boundaries) == {"3", OUTLINE}
    assert MeshFile("a.msh", form(text)).mesh(side).nelements == 1


def test_cells_that_are_there_twice_are_one(tmp_path: Path) -> None:
    """Format 2.2 of gmsh repeats a cell in each of its groups."""
    quads = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
    numbers = {"gmsh:physical": [np.array([1, 2]), np.array([3, 3])]}
    mesh = meshio.Mesh(np.pad(SQUARE, ((0, 0), (0, 1))), [("quad", quads)] * 2, cell_data=numbers)
    found = written(tmp_path, mesh, "mesh.vtu").mesh(None)
    assert found.nelements == 2
    assert {name: own.tolist() for name, own in found.subdomains.items()} == {
        "1": [0], "2": [1], "3": [0, 1],
    }  # fmt: skip
    assert len(found.boundaries[OUTLINE]) == 6


@pytest.mark.parametrize("quads", ["quad", "quad8", "quad9"])
def test_a_body_of_quadrilaterals_with_some_triangles_is_one_of_triangles(
    tmp_path: Path, quads: str
) -> None:
    """A curved quadrilateral keeps its sides; two triangles have its area."""
    angle = np.radians([0, 0, 90, 90, 0, 45, 90, 45, 45])
    radius = np.array([1, 2, 2, 1, 1.5, 2, 1.5, 1, 1.5])
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=1)
    points = np.concatenate([points, [[1.5, -0.5, 0], [1.25, -0.25, 0], [1.75, -0.25, 0]]])
    count = int(quads[4:] or 4)
    triangle = [0, 9, 1, 10, 11, 4][: 3 if quads == "quad" else 6]
    cells = [(quads, np.array([range(count)]))]
    cells.append(("triangle" if quads == "quad" else "triangle6", np.array([triangle])))
    numbers = {"gmsh:physical": [np.array([1]), np.array([2])]}
    used = np.unique(np.concatenate([each.ravel() for _, each in cells]))
    cells = [(kind, np.searchsorted(used, each)) for kind, each in cells]
    mesh = written(tmp_path, meshio.Mesh(points[used], cells, cell_data=numbers)).mesh(None)
    assert mesh.t.shape == (3, 3)
    assert {name: len(own) for name, own in mesh.subdomains.items()} == {"1": 2, "2": 1}
    check_mesh(mesh, "ring", element_type("tri6"))
    straight = 1.5 + 0.25  # of the chords
    bulge = 2 / 3 * (np.sqrt(2) * (1 - np.sqrt(0.5))) * (4 - 1)  # of parabolas over them
    area = float(np.abs(Basis(mesh, mesh.elem(), intorder=6).dx).sum())
    assert area == pytest.approx(straight + (bulge if count > 4 else 0), rel=1e-12)


def test_an_unknown_part_is_refused_with_those_there_are() -> None:
    with pytest.raises(ModelError, match="pin, plate"):
        MeshFile("pin.msh", PIN.read_bytes()).mesh("lug")


@pytest.mark.parametrize("part", ["pin", "plate", None])
def test_a_mesh_is_the_same_from_its_arrays_alone(
    part: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = MeshFile("pin.msh", PIN.read_bytes()) if part else square()
    again = file.read() if part else file
    expected = file.mesh(part)
    monkeypatch.delattr("studies.scenes.meshfile._read")
    found = MeshFile(file.name, b"", again.arrays).mesh(part)
    assert type(found) is type(expected)
    np.testing.assert_array_equal(found.doflocs, expected.doflocs)
    np.testing.assert_array_equal(found.t, expected.t)
    assert found.boundaries.keys() == expected.boundaries.keys()
    for name, facets in expected.boundaries.items():
        np.testing.assert_array_equal(found.boundaries[name], facets)
    assert part or found.boundaries["low"].size == 1


def square() -> MeshFile:
    """Return an element with a set of nodes, as nobody's library writes it."""
    points, cells = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), np.array([[0, 1, 2, 3]])
    data = MeshData(points, [("quad", cells)], {}, {"low": np.array([0, 1])})
    return MeshFile("square.msh", b"", data.packed())


@pytest.mark.parametrize(
    "arrays",
    [
        b"nothing",
        b"{}\n",
        b"[" * 100_000,
        b'[[["points"], [2, 2]]]\n' + bytes(8),
        b'[[["points"], [4]]]\n' + bytes(32),
        b'[[["other"], [1, 1]]]\n' + bytes(8),
        b'[[["points"], [-1, 2]]]\n' + bytes(8),
        b'[[["points"], [%d]]]\n' % 10**30,
    ],
)
def test_what_are_no_arrays_of_a_mesh_is_refused(arrays: bytes) -> None:
    with pytest.raises(ModelError, match=r"a\.msh"):
        MeshFile("a.msh", b"", arrays).mesh(None)


CORNERS = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
QUAD = ("quad", np.array([[0, 1, 2, 3]]))


@pytest.mark.parametrize(
    ("data", "told"),
    [
        (MeshData(CORNERS, [("quad", QUAD[1][:, :3])], {}, {}), "quad of another number of points"),
        (MeshData(CORNERS, [QUAD], {"low": {0: np.array([7])}}, {}), "set low of cells that"),
        (MeshData(CORNERS, [QUAD], {"low": {5: np.array([0])}}, {}), "set low of cells that"),
        (MeshData(CORNERS, [QUAD], {}, {"low": np.array([0, 4])}), "set low of points"),
        (MeshData(CORNERS, [QUAD], {}, {"low": np.array([0, -1])}), "set low of points"),
        (MeshData(CORNERS, [("quad", QUAD[1][:0])], {}, {}), "must have cells .*; it has none"),
        (MeshData(CORNERS[:0], [], {}, {}), "must have finite points"),
    ],
)
def test_arrays_that_do_not_fit_together_are_refused(data: MeshData, told: str) -> None:
    with pytest.raises(ModelError, match=told):
        MeshFile("a.msh", b"", data.packed()).mesh(None)


def test_the_meshes_of_scenes_that_a_process_keeps_have_a_largest_size(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(scene, "_SCENES", {})
    monkeypatch.setattr(scene, "_MOST_BYTES", 1000)
    for number in range(5):
        mesh = MeshFile("a.msh", bytes([number]) * 400)
        last = scene.file_scene(Description("a.toml", blocks(), {"a.msh": mesh}))
    assert len(scene._SCENES) == 2 and last in scene._SCENES.values()
