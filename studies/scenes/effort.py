"""What a run of a scene file costs, told from its meshes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

from solver.scenes.effort import Effort
from studies.scenes import tables
from studies.scenes.building import mesh_of_body

if TYPE_CHECKING:
    from studies.scenes.description import Description


class _Size(NamedTuple):
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
    """
    elements = unknowns = 0
    for name, body in scene.bodies.items():
        size = _size(description, body.model_dump_json(exclude={"supports", "material"}))
        elements += size.elements
        sides = [side.split(".") for pair in scene.contacts for side in (pair.slave, pair.master)]
        own = {side[1] for side in sides if side[0] == name}
        material = scene.materials[body.material]
        kept = ("displacement", "temperature")
        driven = any(load.kind in kept and load.body == name for load in scene.loads)
        if getattr(material, "yield_stress", None) is None and own and not driven:
            # reduced to its contact surfaces
            unknowns += 2 * sum(2 * size.edges.get(boundary, 0) + 1 for boundary in own)
        else:
            unknowns += 2 * size.nodes
    total = sum(increments)
    return Effort(elements=elements, unknowns=unknowns, increments=total, most_increments=total)


@lru_cache(maxsize=512)
def _size(description: Description, body: str) -> _Size:
    """Return the size of a body, whose table is given as JSON."""
    table = tables.Body.model_validate_json(f'{{"material": "any", {body[1:]}')
    mesh = mesh_of_body(table, description.meshes)
    quadratic = table.element not in ("quad4", "tri3")
    nodes = mesh.nvertices + quadratic * mesh.nfacets + (table.element == "quad9") * mesh.nelements
    edges = {name: len(facets) for name, facets in (mesh.boundaries or {}).items()}
    return _Size(mesh.nelements, int(nodes), edges)
