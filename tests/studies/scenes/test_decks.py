"""Decks of Abaqus and CalculiX: what a deck can hold is read, or refused with its line."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
from skfem import Mesh

from solver.errors import ModelError
from solver.results.record import Status
from studies.scenes.description import Description
from studies.scenes.meshfile import OUTLINE, MeshFile
from studies.scenes.scene import file_scene

NODES = """*Heading
 two squares side by side, *** of 1 mm
*NODE, NSET=Nall
** a comment, then empty and absent coordinates, and an exponent of Fortran
1, 0.,
2, 1.d0,,
3, 2., 0.0, 0.
*Node
4, 0, 1
5, 1., 1.
 6, 20.E-1, 1.
"""
SQUARES = """*ELEMENT, TYPE=CPS4, ELSET=Left
1, 1, 2, 5,
4
*element, type = cps4r, elset=Right
2, 2, 3, 6, 5
"""


def deck(text: str) -> MeshFile:
    return MeshFile("deck.inp", text.encode())


def bounds(mesh: Mesh) -> list[float]:
    """Return least and greatest x, then y."""
    return [float(v) for x in mesh.p for v in (x.min(), x.max())]


def edges(mesh: Mesh, name: str) -> list[tuple[float, ...]]:
    """Return the middles of the edges of a boundary, sorted."""
    facets = (mesh.boundaries or {}).get(name, [])
    return sorted(map(tuple, mesh.p[:, mesh.facets[:, facets]].mean(axis=1).T.round(6).tolist()))


def test_blocks_of_nodes_and_elements_add_up() -> None:
    """The second block of nodes does not replace the first."""
    text = "*Elset, elset=left\n 2,\n*MATERIAL, NAME=STEEL\n*ELASTIC\n1., .3\n"
    file = deck(NODES + SQUARES + text)
    assert bounds(file.mesh(None)) == [0, 2, 0, 1]
    assert bounds(file.mesh("Right")) == [1, 2, 0, 1]
    assert file.mesh("Left").nelements == 2, "names are case-insensitive, and sets add up"
    assert edges(file.mesh(None), "Nall") == [(0.5, 0.0), (1.5, 0.0)], "of the first block"


def test_a_block_without_a_name_does_not_shift_the_others() -> None:
    text = SQUARES.replace(", ELSET=Left", "")
    file = deck(NODES + text)
    assert bounds(file.mesh("Right")) == [1, 2, 0, 1]
    with pytest.raises(ModelError, match=r"deck\.inp: Right$"):
        file.mesh("Left")


@pytest.mark.parametrize("data", [
    "*NSET, NSET=Top\n4, 5\n*NSET, NSET=TOP\n6\n",
    "*NSET, NSET=Top, GENERATE\n4, 6, 1\n",
    "*NSET, NSET=Top, GENERATE\n4, 99\n",
    "*NSET, GENERATE, NSET=Top, UNSORTED\n 4, 6 ,\n",
    "*NSET, NSET=some.1\n4, 5\n*NSET, NSET=Top\nSome.1, 6\n",
    "*NSET, NSET=some\n4\n*NSET, NSET=Top\n some, 5,\n6\n",
    '*NSET, NSET="Top"\n4, 5, 6\n',
    "*NSET,\n NSET=Top\n4,5,6\n",
    "*SURFACE, NAME=Top\n1, S3\nRIGHT, S3\n",
    "*Surface, type=element, name=Top\nleft, s3\n2, S3\n",
    "*SURFACE, NAME=Top, TYPE=NODE\n4\n5,\n6, 1.\n",
    "*ELSET, ELSET=both\nLeft, 2\n*SURFACE, NAME=Top\nboth, S3\n",
    "*ELEMENT, TYPE=T2D2, ELSET=Top\n7, 4, 5\n8, 5, 6\n",
    "*ELEMENT, TYPE=R2D2, ELSET=of\n7, 4, 5\n8, 5, 6\n*SURFACE, NAME=Top\nof, SNEG\n",
])  # fmt: skip
def test_a_boundary_in_every_form(data: str) -> None:
    mesh = deck(NODES + SQUARES + data + "*STEP\n*NSET, NSET=Top\n1, 2\n").mesh(None)
    assert edges(mesh, "Top") == [(0.5, 1.0), (1.5, 1.0)]


def test_nodes_of_a_set_of_elements_and_free_edges() -> None:
    mesh = deck(NODES + SQUARES + "*NSET, NSET=N, ELSET=left\n*SURFACE, NAME=S\nright,\n").mesh(
        None
    )
    assert edges(mesh, "N") == [(0.0, 0.5), (0.5, 0.0), (0.5, 1.0)]
    assert edges(mesh, "S") == [(1.5, 0.0), (1.5, 1.0), (2.0, 0.5)], "not the edge in common"


def test_sets_that_repeat_one_another_do_not_grow() -> None:
    """Each line would double the members of the set."""
    text = "*NSET, NSET=low\n1, 2\n" + "low, low\n" * 60
    assert edges(deck(NODES + SQUARES + text).mesh(None), "low") == [(0.5, 0.0)]


def test_a_surface_goes_before_a_set_of_nodes_of_its_name() -> None:
    data = "*SURFACE, NAME=Top\n1, S3\n*NSET, NSET=Top\n4, 5, 6\n"
    assert edges(deck(NODES + SQUARES + data).mesh(None), "Top") == [(0.5, 1.0)]


def test_a_surface_of_nodes_may_have_the_name_of_a_set_of_the_same_nodes() -> None:
    data = "*NSET, NSET=Top\n5, 4\n*SURFACE, NAME=Top, TYPE=NODE\nTop, 1.\n5\n"
    assert edges(deck(NODES + SQUARES + data).mesh(None), "Top") == [(0.5, 1.0)]


def test_numbers_of_nodes_and_elements_may_have_gaps_and_any_order() -> None:
    text = "*ELEMENT, TYPE=CAX4, ELSET=A\n 900, 70, 30, 10, 50\n*NODE\n10, 1, 1\n50, 0, 1\n70,\n"
    mesh = deck(text + "30, 1\n*NSET, NSET=Low\n 30, 70\n").mesh("A")
    assert bounds(mesh) == [0, 1, 0, 1]
    assert edges(mesh, "Low") == [(0.5, 0.0)]


ASSEMBLY = f"""*Part, name=Plate
{NODES}{SQUARES}*Nset, nset=Set-1
 1, 4
*Elset, elset=_Side_S4, internal
 1
*Surface, type=ELEMENT, name=Side
_Side_S4, S4
*End Part
*Part, name=Unused
*Node
1, 99., 99.
*End Part
*Assembly, name=Assembly
*Instance, name=Low, part=Plate
 10., 20., 0.
*End Instance
*Instance, name=Turned, part=PLATE
 1., 0., 0.
 1., 0., 0., 1., 0., 5., 90.
*End Instance
*Node
 1, 5., 5., 7.
*Nset, nset=Set-1, instance=Low
 4, 5, 6
*Nset, nset=Both
 Low.1, Low.4, turned.1, turned.4
*Elset, elset=Rights
 Low.Right, Turned.2
*Surface, type=ELEMENT, name=Top
 Low.Right, S3
*End Assembly
"""


def test_instances_are_moved_and_turned() -> None:
    """A translation, then a rotation; sets of parts and of the assembly keep apart."""
    file = deck(ASSEMBLY)
    low, turned = file.mesh("Low"), file.mesh("Turned")
    assert bounds(low) == pytest.approx([10, 12, 20, 21])
    assert bounds(turned) == pytest.approx([0, 1, 0, 2])
    assert bounds(file.mesh("Turned.Right")) == pytest.approx([0, 1, 1, 2])
    assert file.mesh("Right").nelements == file.mesh("Rights").nelements == 2
    assert edges(low, "Set-1") == [(10.5, 21.0), (11.5, 21.0)], "the set of the assembly"
    assert edges(low, "Low.Set-1") == [(10.0, 20.5)], "that of the part"
    assert edges(turned, "Turned.Set-1") == edges(turned, "Both") == [(0.5, 0.0)]
    assert edges(low, "Side") == edges(low, "Low.Side") == [(10.0, 20.5)]
    assert edges(turned, "Side") == [(0.5, 0.0)]
    assert edges(low, "Top") == [(11.5, 21.0)]
    assert not any("_Side" in name for name in low.subdomains)


def test_an_instance_may_have_a_mesh_of_its_own_and_parts_need_no_assembly() -> None:
    own = "*Part, name=P\n*End Part\n*Assembly, name=A\n*Instance, name=I, part=P\n1,\n"
    assert bounds(deck(own + NODES + SQUARES + "*End Instance\n*End Assembly\n").mesh("I")) == [
        1,
        3,
        0,
        1,
    ]
    part = f"*Part, name=P\n{NODES}{SQUARES}*End Part\n"
    assert bounds(deck(part).mesh("P")) == [0, 2, 0, 1]


@pytest.mark.parametrize(("kind", "count"), [
    ("CPE3", 3), ("cps3", 3), ("CAX3H", 3), ("S3R", 3), ("STRI3", 3), ("R3D3", 3), ("M3D3", 3),
    ("CPE4", 4), ("CPS4I", 4), ("CPE4RH", 4), ("CAX4RT", 4), ("CPEG4I", 4), ("CGAX4R", 4),
    ("S4R5", 4), ("S4", 4), ("M3D4R", 4), ("DC2D4", 4), ("DCAX4", 4), ("SFM3D4R", 4),
    ("CPE6M", 6), ("CAX6", 6), ("CPS6MT", 6), ("STRI65", 6), ("S6", 6), ("M3D6", 6),
    ("CPE8R", 8), ("CAX8RHT", 8), ("CPS8", 8), ("S8R5", 8), ("M3D8", 8), ("S9R5", 9),
])  # fmt: skip
def test_plane_elements_of_every_name_are_read(kind: str, count: int) -> None:
    corners = [(0, 0), (2, 0), (2, 2), (0, 2)][: 4 if count in (4, 8, 9) else 3]
    middles = (np.array(corners) + np.roll(corners, -1, axis=0)) / 2
    points = [*corners, *middles.tolist(), (1, 1)][:count]
    nodes = [f"{k}, {x}, {y}" for k, (x, y) in enumerate(points, 1)]
    cell = ", ".join(map(str, [7, *range(1, count + 1)]))
    mesh = deck("\n".join(["*NODE", *nodes, f"*ELEMENT, TYPE={kind}", cell])).mesh(None)
    assert mesh.nelements == 1
    assert len(mesh.t) == len(mesh.boundaries[OUTLINE]) == len(corners)
    assert (mesh.doflocs.shape[1] > len(corners)) == (count > 4)


def test_collapsed_quadrilaterals_and_triangles_make_a_body_of_triangles() -> None:
    """Regions follow the cells; a quadrilateral is divided along its shorter diagonal."""
    text = NODES + SQUARES.replace("2, 2, 3, 6, 5", "2, 2, 3, 6, 6")
    mesh = deck(text.replace("2, 1.d0", "2, 1.1d0")).mesh(None)
    assert mesh.t.shape == (3, 3)
    assert {name: len(own) for name, own in mesh.subdomains.items()} == {"Left": 2, "Right": 1}
    ends = {frozenset(map(tuple, mesh.p[:, each].T.tolist())) for each in mesh.facets.T}
    assert frozenset({(0.0, 0.0), (1.0, 1.0)}) in ends, "2 and 4 are farther apart"


@pytest.mark.parametrize(("text", "told"), [
    ("*NGEN, NSET=A\n1, 3\n", r"line 17: \*NGEN is not read"),
    ("*Elgen\n1, 2\n", r"line 17: \*ELGEN is not read"),
    ("*INCLUDE, INPUT=other.inp\n", r"line 17: \*INCLUDE is not read: put the lines"),
    ("*SYSTEM\n0., 1.\n", r"line 17: \*SYSTEM is not read: give coordinates"),
    ("*NODE, SYSTEM=C\n7, 1., 2.\n", "line 17: SYSTEM is not read: give coordinates"),
    ("*NODE, INPUT=other.txt\n", r"line 17: the parameter INPUT of \*NODE is not read"),
    ("*NODE\n1, 5., 5.\n", "line 18: node 1 has other coordinates before"),
    ("*NODE\n7, 5., a\n", "line 18: could not convert"),
    ("*NODE\n7.5, 5., 1.\n", r"line 18: '7\.5' is not a whole number"),
    ("*ELEMENT, TYPE=C3D8\n3, 1, 2, 3, 4, 5, 6\n", "line 17: elements C3D8 are not read"),
    ("*ELEMENT, TYPE=COH2D4\n3, 1, 2, 3, 4\n", "line 17: elements COH2D4"),
    ("*ELEMENT, TYPE=CPS4\n3, 1, 2, 3\n", "line 18: an element CPS4 has 4 nodes, not 3"),
    ("*ELEMENT, TYPE=CPS4\n3, 1, 2, 3, 4, 5\n", "line 18: an element CPS4 has 4 nodes, not 5"),
    ("*ELEMENT, TYPE=CPS4\n2, 1, 2, 3, 4\n", "line 18: element 2 is there before"),
    ("*ELEMENT, TYPE=CPS4\n3, 1, 2, 3, 44\n", "line 18: node 44 does not exist"),
    ("*ELEMENT\n3, 1, 2, 3, 4\n", r"line 17: \*ELEMENT needs TYPE="),
    ("*NSET, NSET=A\n1, 77\n", "line 18: node 77 does not exist"),
    ("*NSET, NSET=A\n1, B\n", "line 18: there is no NSET B before"),
    ("*ELSET, ELSET=A\n1, Nall\n", "line 18: there is no ELSET Nall before"),
    ("*NSET, NSET=A, GENERATE\n1, 3, 0\n", "line 18: must have a first and a last number"),
    ("*NSET, NSET=A, GENERATE\n,\n1, 2\n", "line 18: must have a first and a last number"),
    ("*ELEMENT, TYPE=T2D2, ELSET=T\n3, 4, 5\n*SURFACE, NAME=T\n1, S1\n", "line 20: a surface and"),
    ("*NSET, NSET=T\n4, 5\n*SURFACE, NAME=T, TYPE=NODE\n6\n", "line 20: a surface has other"),
    ("*SURFACE, NAME=T\n1, S1\n*SURFACE, NAME=t, TYPE=NODE\n6\n", "line 19: the surface t"),
    ("*NSET, NSET=A, INSTANCE=I\n1\n", "line 17: there is no instance I"),
    ("*SURFACE, NAME=A\n1, S5\n", "line 18: S5 must be an edge of a CPS4: S1, S2, S3, S4"),
    ("*ELEMENT, TYPE=MASS\n9, 1\n*SURFACE, NAME=A\n9, S1\n", "line 20: element 9 is MASS, which"),
    ("*SURFACE, NAME=A, COMBINE=UNION\nB, C\n", "line 17: the parameter COMBINE"),
    ("*PART, NAME=A\n*NODE\n", r"line 17: \*PART has no end"),
    ("*INSTANCE, NAME=A, PART=B\n", "line 17: there is no part B"),
])  # fmt: skip
def test_what_is_not_understood_is_refused_with_its_line(text: str, told: str) -> None:
    with pytest.raises(ModelError, match=rf"deck\.inp.*cannot be read: {told}"):
        deck(NODES + SQUARES + text).mesh(None)


def test_a_file_without_keywords_is_refused() -> None:
    with pytest.raises(ModelError, match="line 2: 'nothing' has no keyword before it"):
        deck("\nnothing").mesh(None)


def test_masses_springs_and_points_outside_the_plane_do_not_matter() -> None:
    other = "*NODE\n 90, 0., 0., 5.\n*ELEMENT, TYPE=MASS, ELSET=M\n91, 90\n"
    other += "*Element, type=CONN2D2\n92, , 1\n"
    mesh = deck(NODES + SQUARES + other + "*ELSET, ELSET=Left\n91\n").mesh(None)
    assert mesh.nelements == 2
    assert set(mesh.subdomains) == {"Left", "Right"}


@pytest.mark.parametrize(("order", "told"), [
    ((0, 2, 1), "it lies in the xz plane"), ((2, 0, 1), "it lies in the yz plane"),
])  # fmt: skip
def test_a_mesh_in_another_plane_is_refused_by_its_name(
    order: tuple[int, int, int], told: str
) -> None:
    square = np.array([[0, 0, 0], [2, 0, 1e-9], [2, 2, 0], [0, 2, 0]])[:, order]
    rows = [", ".join(map(str, [k, *x])) for k, x in enumerate(square.tolist(), 1)]
    text = "\n".join(["*NODE", *rows, "*ELEMENT, TYPE=S4", "1, 1, 2, 3, 4"])
    with pytest.raises(ModelError, match=told):
        deck(text).mesh(None)


EDGE = """
name = "edge"
summary = "a wall of a deck in single precision"
[parameters.push]
default = 10.0
range = [0.1, 100]
description = "pressure"
[materials.steel]
youngs_modulus = 2e5
poisson_ratio = 0.3
[bodies.wall]
material = "steel"
mesh = "deck.inp"
supports = { low = "xy" }
[[loads]]
body = "wall"
kind = "pressure"
boundary = "high"
value = "$push"
[[stages]]
name = "pressed"
increments = 1
[results.points]
corner = { body = "wall", at = [0.005, 0.007] }
[results.lines.edge]
body = "wall"
start = [0.005, 0.001]
end = [0.005, 0.007]
[outputs.least]
of = "stress.yy"
take = "minimum"
line = "edge"
stage = "pressed"
"""


@pytest.mark.solves
def test_results_at_the_edges_that_a_deck_rounds_are_those_of_the_body() -> None:
    """Abaqus writes 0.005 as 0.00499999989; a place on the edge is inside, and its audit agrees."""
    x, y = (np.float32(np.linspace(*ends)) for ends in ((0.005, 0.006, 11), (0.001, 0.007, 5)))
    rows = [f"{11 * j + i + 1}, {x[i]:.9g}, {y[j]:.9g}" for j in range(5) for i in range(11)]
    assert rows[-11].startswith("45, 0.00499999989, 0.00700000022")
    cells = []
    for k in range(40):
        a = k // 10 * 11 + k % 10 + 1
        cells.append(f"{k + 1}, {a}, {a + 1}, {a + 12}, {a + 11}")
    sets = ["*NSET, NSET=low, GENERATE", "1, 11", "*NSET, NSET=high, GENERATE", "45, 55"]
    text = "\n".join(["*NODE", *rows, "*ELEMENT, TYPE=CPE4", *cells, *sets])
    scene = file_scene(Description("edge.toml", tomllib.loads(EDGE), {"deck.inp": deck(text)}))
    (record,) = scene.path(scene.parameters(), [None], lambda share: None)
    assert record.status is Status.OK, record.message
    assert np.isfinite(record.fields["point_stress"][1]).all()
    assert record.scalars["least"] < -10.0
