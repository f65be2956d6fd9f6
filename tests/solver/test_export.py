"""Solutions as files of other programs."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest

from solver import Body, ContactPair, Material, Model, ModelError, Solution, solve
from solver.files import NoFile
from solver.mesh import grid

pytestmark = pytest.mark.solves

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=300.0)
x = np.linspace(0.0, 2.0, 4)


def pressed(element: str, **own: Any) -> Solution:
    """Press a block on another one, beyond yield."""
    cells = "tri" if element.startswith("tri") else "quad"
    upper = Body(name="upper", mesh=grid(x, x, cells), material=STEEL, element=element,
                 supports={"left": "x"}, pressure={"top": 200.0})  # fmt: skip
    lower = Body(name="lower", mesh=grid(np.linspace(0, 4, 6), x - 2, cells), material=STEEL,
                 element=element, supports={"left": "x", "bottom": "y"})  # fmt: skip
    pair = ContactPair(slave=("upper", "bottom"), master=("lower", "top"))
    return solve(Model(bodies=(upper, lower), contacts=(pair,)), **own)


def area(mesh: meshio.Mesh) -> float:
    """Return the area of the straight polygons through the corners of all cells."""
    total = 0.0
    for block in mesh.cells:
        corners = 3 if block.type.startswith("tri") else 4
        p, q = mesh.points[block.data[:, :corners], 0], mesh.points[block.data[:, :corners], 1]
        total += (p * np.roll(q, -1, axis=1) - np.roll(p, -1, axis=1) * q).sum() / 2
    return float(total)


@pytest.mark.parametrize("element", ["quad8", "quad9", "quad4", "tri6", "tri3"])
def test_files_for_paraview_hold_the_mesh_and_the_fields(element: str, tmp_path: Path) -> None:
    found = pressed(element)
    index = found.to_vtu(tmp_path / "out")
    sets = ElementTree.parse(index).getroot().findall("Collection/DataSet")
    assert [each.get("name") for each in sets] == ["loaded", "unloaded"]
    for stage, each in zip(("loaded", "unloaded"), sets, strict=True):
        mesh = meshio.read(index.parent / str(each.get("file")))
        assert area(mesh) == pytest.approx(4.0 + 8.0)
        n = found.nodes("upper").shape[1]
        np.testing.assert_allclose(mesh.points[:n, :2].T, found.nodes("upper"))
        told = mesh.point_data["displacement"][:n, :2].T
        np.testing.assert_allclose(told, found.displacement("upper", stage))
        np.testing.assert_allclose(
            mesh.point_data["stress_yy"][n:], found.stress("lower", stage)[1]
        )
        assert {int(b) for block in mesh.cell_data["body"] for b in np.ravel(block)} == {0, 1}
        if element in ("quad8", "quad9", "tri6"):  # nodes in the middle of the sides
            cells, corners = mesh.cells[0].data, 3 if element == "tri6" else 4
            for k in range(corners):
                ends = mesh.points[cells[:, [k, (k + 1) % corners]]].mean(axis=1)
                np.testing.assert_allclose(mesh.points[cells[:, corners + k]], ends, atol=1e-12)


def test_a_file_in_the_place_of_a_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")
    with pytest.raises(ModelError, match="must be a folder"):
        pressed("quad4").to_vtu(tmp_path / "out")


def test_a_folder_holds_the_stages_of_the_last_export_alone(tmp_path: Path) -> None:
    solution = pressed("quad4")
    (tmp_path / "mine.txt").write_text("stays")
    solution.to_vtu(tmp_path)
    before = {each.name for each in tmp_path.iterdir()}
    one = replace(solution, stages={"alone": solution.stages["loaded"]})
    one.to_vtu(tmp_path)
    after = {each.name for each in tmp_path.iterdir()}
    assert before == {"mine.txt", "stages.pvd", "0-loaded.vtu", "1-unloaded.vtu"}
    assert after == {"mine.txt", "stages.pvd", "0-alone.vtu"}


def test_stages_replace_only_files_and_appear_together(tmp_path: Path) -> None:
    found = pressed("quad4")
    os.mkfifo(tmp_path / "1-unloaded.vtu")
    with pytest.raises(NoFile, match=r"1-unloaded\.vtu: it is a pipe, and only files are replaced"):
        found.to_vtu(tmp_path)
    assert [each.name for each in tmp_path.iterdir()] == ["1-unloaded.vtu"]
