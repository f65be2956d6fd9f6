"""Every format of mesh files, written and read: areas, parts and boundaries are the same."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import meshio
import netCDF4
import numpy as np
import pytest
from skfem import Basis, Mesh

from studies.scenes.formats import FORMATS
from studies.scenes.meshfile import OUTLINE, MeshFile

PIN = Path(__file__).parents[3] / "data/scenes/pin.msh"
TURNS, RADII = np.radians(np.linspace(0, 90, 9)), np.linspace(1, 2, 5)  # every second a corner
NAMES = ("core", "rim", "inner", "base")
NUMBERS = ("1", "2", "3", "4")


def ring(kind: str) -> meshio.Mesh:
    """Return a quarter of a ring, 1 to 2 mm: a quarter of it, the rest, its inner arc, its base."""
    r, turn = np.meshgrid(RADII, TURNS, indexing="ij")
    points = np.stack([r * np.cos(turn), r * np.sin(turn), 0 * r], axis=-1).reshape(-1, 3).round(12)
    n = np.arange(45).reshape(5, 9)
    cells = []
    for k in range(0, 8, 2):
        for i in (0, 2):
            a, b, c, d = n[i, k], n[i + 2, k], n[i + 2, k + 2], n[i, k + 2]
            middles = n[i + 1, k], n[i + 2, k + 1], n[i + 1, k + 2], n[i, k + 1], n[i + 1, k + 1]
            if kind == "triangle6":
                cells += [[a, b, c, *middles[:2], middles[4]], [a, c, d, middles[4], *middles[2:4]]]
            elif kind == "triangle":
                cells += [[a, b, c], [a, c, d]]
            else:
                cells.append([a, b, c, d, *middles][: int(kind[4:] or 4)])
    half = len(cells) // 4
    line = "line3" if kind[-1] in "689" else "line"
    ends = [[n[0, k], n[0, k + 2], n[0, k + 1]] for k in range(0, 8, 2)]
    base = [[n[i, 0], n[i + 2, 0], n[i + 1, 0]] for i in (0, 2)]
    blocks = [(kind, cells[:half]), (kind, cells[half:]), (line, ends), (line, base)]
    cells = [(t, np.array(each)[:, : 2 if t == "line" else None]) for t, each in blocks]
    kept = np.unique(np.concatenate([each.ravel() for _, each in cells]))
    return meshio.Mesh(points[kept], [(t, np.searchsorted(kept, each)) for t, each in cells])


def numbered(mesh: meshio.Mesh, key: str) -> meshio.Mesh:
    mesh.cell_data[key] = [np.full(len(b.data), k, dtype=int) for k, b in enumerate(mesh.cells, 1)]
    return mesh


def of_gmsh(version: str, binary: bool) -> Callable[[meshio.Mesh, Path], None]:
    def write(mesh: meshio.Mesh, path: Path) -> None:
        mesh = numbered(numbered(mesh, "gmsh:physical"), "gmsh:geometrical")
        mesh.field_data = {n: np.array([k, 2 - k // 3]) for k, n in enumerate(NAMES, 1)}
        if version == "gmsh":
            tags = np.zeros((len(mesh.points), 2), dtype=int)
            for k, block in enumerate(mesh.cells, 1):  # each has nodes of its own
                tags[block.data.ravel()] = [2 - k // 3, k]
            mesh.point_data["gmsh:dim_tags"] = tags
        meshio.write(path, mesh, file_format=version, binary=binary)

    return write


def of_numbers(key: str, **options: object) -> Callable[[meshio.Mesh, Path], None]:
    return lambda mesh, path: numbered(mesh, key).write(path, **options)


def of_abaqus(mesh: meshio.Mesh, path: Path) -> None:
    """Write a deck: edges of the arc as a surface, of the base as a set of nodes."""
    kind = {"quad8": "CPE8R", "triangle6": "CPE6M"}
    rows = ["*NODE", *(f"{k}, {x!r}, {y!r}" for k, (x, y, _) in enumerate(mesh.points.tolist(), 1))]
    count = 0
    arc = set(map(frozenset, mesh.cells[2].data[:, :2].tolist()))
    surface = []
    for name, block in zip(NAMES, mesh.cells[:2], strict=False):
        rows.append(f"*ELEMENT, TYPE={kind[block.type]}, ELSET={name}")
        corners = 3 if block.type[0] == "t" else 4
        for cell in block.data.tolist():
            count += 1
            rows.append(", ".join(map(str, [count, *(k + 1 for k in cell)])))
            for k in range(corners):
                if frozenset((cell[k], cell[(k + 1) % corners])) in arc:
                    surface.append(f"{count}, S{k + 1}")
    rows += ["*SURFACE, NAME=inner", *surface, "*NSET, NSET=base"]
    rows += [str(k + 1) for k in np.unique(mesh.cells[3].data)]
    path.write_text("\n".join(rows))


def of_med(mesh: meshio.Mesh, path: Path) -> None:
    """Write families of two groups each; the base is one of nodes."""
    core, rim, inner, base = (block.data for block in mesh.cells)
    cells = [(mesh.cells[0].type, np.vstack([core, rim])), (mesh.cells[2].type, inner)]
    families = [np.repeat([-1, -2], [len(core), len(rim)]), np.full(len(inner), -3)]
    made = meshio.Mesh(mesh.points, cells, cell_data={"cell_tags": families})
    made.cell_tags = {-k: ["all", name] for k, name in enumerate(NAMES[:3], 1)}
    made.point_data["point_tags"] = np.isin(np.arange(len(mesh.points)), base).astype(int)
    made.point_tags = {1: ["low", NAMES[3]]}
    made.write(path)


def of_exodus(mesh: meshio.Mesh, path: Path) -> None:
    """Write blocks, a set of nodes, and what meshio cannot write: names, and sides of elements."""
    quads = [(block.type, block.data) for block in mesh.cells[:2]]
    base = {"base": np.unique(mesh.cells[3].data)}
    meshio.Mesh(mesh.points, quads, point_sets=base).write(path)
    arc = set(map(frozenset, mesh.cells[2].data[:, :2].tolist()))
    sides = [
        (k, s + 1)
        for k, cell in enumerate(np.vstack([each for _, each in quads]).tolist(), 1)
        for s in range(4)
        if frozenset((cell[s], cell[(s + 1) % 4])) in arc
    ]
    with netCDF4.Dataset(path, "a") as file:
        for name, values in (
            ("elem_ss1", np.array([k for k, _ in sides])),
            ("side_ss1", np.array([s for _, s in sides])),
            ("ss_prop1", np.array([7])),
            ("ss_names", np.array([list("inner")], dtype="S1")),
            ("eb_names", np.array([list("core"), ["r", "i", "m", ""]], dtype="S1")),
        ):
            axes = tuple(f"{name}_{k}" for k in range(values.ndim))
            for axis, size in zip(axes, values.shape, strict=True):
                file.createDimension(axis, size)
            file.createVariable(name, "S1" if values.ndim == 2 else "i4", axes)[:] = values


FORMS = {
    "msh 2.2": ("a.msh", of_gmsh("gmsh22", binary=False), "quad8", NAMES),
    "msh 2.2 binary": ("a.msh", of_gmsh("gmsh22", binary=True), "quad", NAMES),
    "msh 4.1": ("a.msh", of_gmsh("gmsh", binary=False), "quad9", NAMES),
    "msh 4.1 binary": ("a.msh", of_gmsh("gmsh", binary=True), "triangle6", NAMES),
    "inp": ("a.inp", of_abaqus, "quad8", NAMES),
    "inp of triangles": ("a.INP", of_abaqus, "triangle6", NAMES),
    "med": ("a.med", of_med, "triangle6", NAMES),
    "exodus": ("a.exo", of_exodus, "quad8", NAMES),
    "vtk": ("a.vtk", of_numbers("gmsh:physical"), "quad8", NUMBERS),
    "vtu": ("a.vtu", of_numbers("gmsh:physical"), "triangle6", NUMBERS),
    "medit": ("a.mesh", of_numbers("medit:ref"), "triangle", NUMBERS),
    "nastran": ("a.bdf", of_numbers("nastran:ref"), "quad", NUMBERS),
}


def area(mesh: Mesh) -> float:
    return float(np.abs(Basis(mesh, mesh.elem(), intorder=6).dx).sum())


@pytest.mark.parametrize("form", FORMS)
def test_a_format_keeps_areas_parts_and_boundaries(tmp_path: Path, form: str) -> None:
    name, write, kind, (core, rim, inner, base) = FORMS[form]
    write(ring(kind), tmp_path / name)
    file = MeshFile(name, (tmp_path / name).read_bytes())
    curved = kind[-1] in "689"
    # a chord cuts off the rest; a parabola is right to the fourth power of the angle
    sector = 1.5 * (np.pi / 8 if curved else np.sin(np.pi / 8))
    for part, count in ((core, 1), (rim, 3), (None, 4)):
        mesh = file.mesh(part)
        assert area(mesh) == pytest.approx(count * sector, rel=3e-4 if curved else 1e-7)
        assert OUTLINE in mesh.boundaries
        arc = mesh.p[:, mesh.facets[:, mesh.boundaries[inner]]]
        assert arc.shape[2] == count
        assert np.hypot(*arc) == pytest.approx(1.0, rel=1e-7)
        assert (base in mesh.boundaries) == (part != rim)
        if part != rim:
            assert mesh.p[1, mesh.facets[:, mesh.boundaries[base]]] == pytest.approx(0, abs=1e-15)
            assert len(mesh.boundaries[base]) == 2
    regions = file.mesh(None).subdomains
    assert len(regions[rim]) == 3 * len(regions[core]) == 3 * file.mesh(core).nelements


def test_every_ending_is_that_of_a_format_tried_here() -> None:
    tried = {Path(name).suffix.lower() for name, *_ in FORMS.values()}
    assert set(FORMATS) - tried == {".e", ".nas"}, "other endings of two that are tried"
    assert FORMATS[".e"] is FORMATS[".exo"] and FORMATS[".nas"] is FORMATS[".bdf"]


def test_areas_of_a_file_of_gmsh_are_those_of_its_geometry() -> None:
    file = MeshFile("pin.msh", PIN.read_bytes())
    assert area(file.mesh("pin")) == pytest.approx(np.pi / 2 * (10**2 - 0.5**2), rel=1e-5)
    assert area(file.mesh("plate")) == pytest.approx(400 * 200 - np.pi / 2 * 10**2, rel=1e-8)
