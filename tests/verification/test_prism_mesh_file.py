"""A section from a mesh file is that of the package, whatever the numbering of its nodes."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest
from numpy.typing import NDArray
from skfem import MeshQuad2

from solver.errors import ModelError
from solver.mesh.rail import rail_60e1
from solver.mesh.zone import Zone, rail_mesh
from solver.prism import PrismTrack, Section
from studies.scenes.meshfile import MeshFile
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
