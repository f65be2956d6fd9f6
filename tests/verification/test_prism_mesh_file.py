"""A section from a mesh file: that of the package, whatever its numbering; in a scene; refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
from numpy.typing import NDArray
from skfem import MeshQuad2

from solver.errors import ModelError
from solver.results.record import Status
from solver.rolling.rail.profiles.meshed_rail import MeshedRail, section_of
from solver.rolling.rail.profiles.points import SectionMesh
from solver.rolling.rail.profiles.rail import rail_60e1
from solver.rolling.rail.profiles.zone import Zone, rail_mesh
from solver.rolling.rail.section import Section
from solver.rolling.rail.track import PrismTrack
from solver.rolling.scenes.wheel_rail_contact import canted
from solver.rolling.scenes.wheel_rail_track import geometry, mesh_of, meshed
from solver.shipped import SCENES
from studies import Study, StudyError
from studies.scenes.meshfile import MeshFile
from studies.views.columns import value_text
from tests.verification.prism_blocks import PERFECT

ZONE = Zone(at=0.0, half_width=12.0, depth=8.0, size=4.0)
SPRING = (0.14, 0.14, 0.14)


def written(mesh: MeshQuad2, path: Path, rng: np.random.Generator) -> MeshFile:
    """A gmsh file of 8-node quadrilaterals in another order, with named lines."""
    points, dofs = mesh.doflocs, mesh.dofs.element_dofs[:8]
    used, cells = np.unique(dofs, return_inverse=True)
    mixed = rng.permutation(len(used))
    place = np.zeros((len(used), 3))
    place[mixed, :2] = points[:, used].T
    quads = mixed[cells.reshape(8, -1).T]
    corner = mixed[np.searchsorted(used, mesh.facets)].T
    names = {"running": [1, 1], "foot": [2, 1], "rail": [3, 2]}
    lines = [rng.permutation(corner[mesh.boundaries[name]]) for name in ("running", "foot")]
    quads = rng.permutation(quads)
    tags = [np.full(len(each), k) for k, each in enumerate([*lines, quads], 1)]
    meshio.Mesh(
        place, [("line", lines[0]), ("line", lines[1]), ("quad8", quads)],
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={name: np.array(each) for name, each in names.items()},
    ).write(path, "gmsh22", binary=False)  # fmt: skip
    return MeshFile(path.name, path.read_bytes())


def track(section: Section) -> PrismTrack:
    """A coarse track; elements that may yield are those of the zone."""
    z, y = section.points.mean(axis=2)
    zone: NDArray[np.bool_] = (np.abs(z) < ZONE.half_width) & (y > -ZONE.depth - 1.0)
    return PrismTrack(
        section, zone, "running", length=48.0, spacing=4.0, ahead=16.0, behind=16.0, reach=8.0,
        levels=0,
    )  # fmt: skip


def test_a_section_from_a_mesh_file_is_as_stiff_as_that_it_was_written_from(tmp_path: Path) -> None:
    mesh = rail_mesh(rail_60e1(), ZONE)
    file = written(mesh, tmp_path / "rail.msh", np.random.default_rng(1))
    own, read = (
        track(Section(each, PERFECT.elasticity, springs={"foot": SPRING}))
        for each in (mesh, file.mesh("rail"))
    )
    np.testing.assert_allclose(read.grid.z, own.grid.z, atol=1e-9)
    np.testing.assert_allclose(read.grid.angle, own.grid.angle, atol=1e-9)
    largest = np.abs(own.compliance).max()
    np.testing.assert_allclose(read.compliance, own.compliance, atol=1e-8 * largest)


def test_a_folded_section_is_refused_as_any_mesh(tmp_path: Path) -> None:
    mesh = rail_mesh(rail_60e1(), ZONE)
    folded = mesh.doflocs.copy()
    folded[:, mesh.t[0, 0]] = folded[:, mesh.t[2, 0]] + 1.0
    file = written(
        MeshQuad2(folded, mesh.t, validate=False, sort_t=False).with_boundaries(mesh.boundaries),
        tmp_path / "rail.msh", np.random.default_rng(1),
    )  # fmt: skip
    with pytest.raises(ModelError, match=r"mesh = 'element .* of body .section.': is folded"):
        Section(file.mesh("rail"), PERFECT.elasticity, springs={"foot": SPRING})


# -- as a parameter of the scene -------------------------------------------------------------------

SCENE = SCENES["wheel_rail"]
DRAFT = {"accuracy": "draft", "hardening": "kinematic", "hardening_ratio": 0.0196}
WIDE = Zone(at=-1.0, half_width=24.0, depth=16.0, size=2.0)


@pytest.fixture(scope="module")
def own() -> SectionMesh:
    """60E1, upright, of 2 mm elements as wide as a wheel may need."""
    return section_of(rail_mesh(rail_60e1(), WIDE))


def test_a_meshed_rail_has_the_outline_of_the_rail(own: SectionMesh) -> None:
    """The mesh flattens the corners of the foot, 75 mm away: 0.1 % of the area, 1.2 % across."""
    meshed, rail = canted(own, 0.025), canted("60e1", 0.025)
    assert isinstance(meshed, MeshedRail)
    assert meshed.outline.area == pytest.approx(rail.outline.area, rel=5e-3)
    np.testing.assert_allclose(
        meshed.outline.second_moments, rail.outline.second_moments, rtol=0.015, atol=5e3
    )
    for at in (-20.0, -3.0, 0.0, 15.0):
        one, other = (np.array(each.place(at)) for each in (meshed, rail))
        np.testing.assert_allclose(meshed.outline.at(one), rail.outline.at(other), atol=2e-3)
        np.testing.assert_allclose(
            meshed.outline.direction(one), rail.outline.direction(other), atol=2e-3
        )
    assert meshed.foot == pytest.approx(150.0, rel=0.01)


def test_a_scene_rolls_over_a_mesh_file(tmp_path: Path, own: SectionMesh) -> None:
    """Other elements of the same side: peak pressure and strain differ by some percent."""
    written(rail_mesh(rail_60e1(), WIDE), tmp_path / "rail.msh", np.random.default_rng(2))
    (tmp_path / "study.toml").write_text(
        'name = "own"\nscene = "wheel_rail"\n[parameters]\nrail_profile = "rail.msh"\n'
        + "".join(f"{name} = {value!r}\n" for name, value in DRAFT.items())
    )
    study = Study.from_toml(tmp_path / "study.toml")
    sent = Study.from_dict(json.loads(json.dumps(study.to_dict())))
    assert sent.id == study.id
    (case,) = sent.expansion.cases()
    read = case.parameters.rail_profile
    assert len(read.cells) == len(own.cells)
    assert value_text(json.dumps(read)) == "a mesh"
    each = []
    for profile in (read, "60e1"):
        p = SCENE.parameters(**DRAFT, rail_profile=profile)
        (record,) = SCENE.path(p, [1], lambda share: None)
        assert record.status is Status.OK, record.message
        each.append(record.scalars)
    for name, tolerance in (
        ("peak_patch_pressure", 0.03), ("max_plastic_strain", 0.03), ("axle_height", 0.01),
        ("lateral_force", 0.02),
    ):  # fmt: skip
        assert each[0][name] == pytest.approx(each[1][name], rel=tolerance), name


def test_four_node_elements_become_those_of_eight_nodes(own: SectionMesh) -> None:
    corners = own._replace(cells=tuple(each[:4] for each in own.cells))
    p = SCENE.parameters(**DRAFT, rail_profile=corners)
    zoned, same = mesh_of(geometry(p)), mesh_of(geometry(SCENE.parameters(**DRAFT)))
    assert zoned.mesh.doflocs.shape[1] > 3 * len(own.cells)
    assert zoned.elements == same.elements
    assert zoned.mesh.boundaries is not None
    inside = zoned.mesh.f2t[0, zoned.mesh.boundaries["running"]]
    assert (inside < zoned.elements).all()


HIDDEN = 40
"""Number of an element inside the section."""


def changed(own: SectionMesh, change: str) -> SectionMesh:
    """The mesh with a mistake."""
    if change == "coarse":
        return section_of(rail_mesh(rail_60e1(), replace(WIDE, size=8.0)))
    at = own.points[own.cells[0][0]]
    return {
        "gap": own._replace(running=own.running[:8] + own.running[9:]),
        "inside": own._replace(foot=(own.cells[40][:2],)),
        "none": own._replace(running=()),
        "hole": own._replace(cells=(*own.cells[:HIDDEN], *own.cells[HIDDEN + 1 :])),
        "twice": own._replace(cells=((*own.cells[0][:7], own.cells[0][0]), *own.cells[1:])),
        "below": own._replace(running=own.foot, foot=own.running),
        "few": own._replace(running=own.running[:1], cells=tuple(c[:4] for c in own.cells)),
        "number": own._replace(cells=((0, 1, 2, 10**6, 0, 1, 2, 3), *own.cells[1:])),
        "mixed": own._replace(cells=(own.cells[0][:4], *own.cells[1:])),
        "sides": own._replace(running=own.running + own.foot),
        "folded": own._replace(
            points=tuple((z + 6.0, y) if (z, y) == at else (z, y) for z, y in own.points)
        ),
    }[change]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ("coarse", "must have elements at most 4 mm wide where the wheel may touch, not 8"),
        ("gap", "must have a line running that is one chain of edges"),
        ("sides", "must have a line running that is one chain of edges"),
        ("inside", "must have a line foot of edges of elements, on the outside"),
        ("none", "must have a line running of edges of elements, on the outside"),
        ("number", "must have points numbered from 0 to"),
        ("mixed", "must have elements of four points each, or of eight"),
        ("twice", "must have elements of different points"),
        ("hole", "must be one piece, without holes and cracks"),
        ("below", "must have a line running that fits the cant: it must be above the section"),
        ("few", "must have a line running that fits the cant: it must have at least 4 points"),
        ("folded", "is refused: .* folded"),
    ],
)
def test_a_mesh_that_is_no_section_is_refused(own: SectionMesh, change: str, told: str) -> None:
    with pytest.raises(ModelError, match=f"rail_profile = 'a mesh of .*{told}"):
        p = SCENE.parameters(**DRAFT, rail_profile=changed(own, change))
        meshed(p, geometry(p))


def test_edges_as_wide_as_the_zone_are_refused() -> None:
    """No edge has its middle in the zone."""
    coarse = MeshedRail.of(section_of(rail_mesh(rail_60e1(), replace(WIDE, size=8.0))))
    with pytest.raises(ModelError, match="at most 2 mm wide where the wheel may touch, not 8"):
        coarse.zoned(Zone(at=-1.0, half_width=2.0, depth=2.0, size=1.0), 2.0)


def test_a_file_without_the_lines_is_refused(tmp_path: Path) -> None:
    mesh = rail_mesh(rail_60e1(), ZONE)
    points = np.column_stack([mesh.p.T, np.zeros(mesh.p.shape[1])])
    meshio.Mesh(points, [("quad", mesh.t.T)]).write(tmp_path / "rail.vtu")
    (tmp_path / "study.toml").write_text(
        'name = "own"\nscene = "wheel_rail"\n[sweep]\nrail_profile = ["60e1", "rail.vtu"]\n'
    )
    told = r"sweep.rail_profile\[1\] = 'rail.vtu': mesh must name the lines running and foot"
    with pytest.raises(StudyError, match=told):
        Study.from_toml(tmp_path / "study.toml")
