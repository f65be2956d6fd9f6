"""What a run of a scene file costs, told from its meshes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from solver.errors import ModelError
from solver.scenes.effort import Effort, per_place
from studies.errors import StudyError
from studies.scenes import tables
from studies.scenes.building import load_of, mesh_of_body, usual_element

if TYPE_CHECKING:
    from skfem import Mesh

    from studies.scenes.description import Description


class _MeshSize(NamedTuple):
    """Elements and nodes of a mesh, and edges of its boundaries."""

    elements: int
    nodes: int
    edges: Mapping[str, int]


def effort_of(
    description: Description, scene: tables.SceneFile, increments: Sequence[int]
) -> Effort:
    """Return the work of walking a path; unknowns are those of all nodes, supported ones too.

    Parameters
    ----------
    scene : tables for the values of its parameters
    increments : of each of its runs, those that are shared once

    Raises
    ------
    StudyError
        for a body that cannot be meshed with these values
    """
    elements = unknowns = 0
    for name, body in scene.bodies.items():
        size = _size_of(description, name, body)
        elements += size.elements
        sides = [side.split(".") for pair in scene.contacts for side in (pair.slave, pair.master)]
        own = {side[1] for side in sides if side[0] == name}
        material = scene.materials[body.material]
        driven = any(_changes(load) for load in scene.loads if load.body == name)
        if getattr(material, "yield_stress", None) is None and own and not driven:
            # reduced to its contact surfaces
            unknowns += 2 * sum(2 * size.edges.get(boundary, 0) + 1 for boundary in own)
        else:
            unknowns += 2 * size.nodes
    total = sum(increments)
    return Effort(elements=elements, unknowns=unknowns, increments=total, most_increments=total)


def _changes(table: tables.LoadTable) -> bool:
    """Whether a load moves a boundary or softens the body, which then is not reduced."""
    load = load_of(table)
    return bool(load.components) or load.softening(np.zeros((2, 1))) is not None


_SIZES: WeakKeyDictionary[Description, dict[str, _MeshSize]] = WeakKeyDictionary()
"""What was found of the bodies of each file that is in use, by their tables."""


def _size_of(description: Description, name: str, body: tables.BodyTable) -> _MeshSize:
    """Return the size of a body."""
    known = _SIZES.setdefault(description, {})
    key = body.model_dump_json(exclude={"supports", "material"})
    if key not in known:
        try:
            known[key] = _size(body, mesh_of_body(body, description.meshes))
        except ModelError as error:
            where = f"bodies.{name}" if body.shape is None else f"bodies.{name}.shape"
            raise StudyError(f"{where}.{error.field}", error.value, error.allowed) from None
    return known[key]


def _size(body: tables.BodyTable, mesh: Mesh) -> _MeshSize:
    _, at_corner, on_edge, inside = per_place(body.element or usual_element(mesh))
    nodes = at_corner * mesh.nvertices + on_edge * mesh.nfacets + inside * mesh.nelements
    edges = {name: len(facets) for name, facets in (mesh.boundaries or {}).items()}
    return _MeshSize(mesh.nelements, int(nodes), edges)
