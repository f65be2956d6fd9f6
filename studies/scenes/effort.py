"""The work of a loading path of a scene file, counted from its tables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from skfem import Mesh
from skfem.assembly import Dofs

from solver.errors import ModelError
from solver.mesh.elements import element_type
from solver.mesh.shapes import few
from solver.scenes.scene import Effort
from studies.errors import StudyError
from studies.scenes import tables
from studies.scenes.building import (
    default_element,
    friction_of,
    increments_of,
    load_of,
    mesh_of_body,
)
from studies.scenes.description import Description
from studies.scenes.shape_tables import LINED, lines_of

_MOST_INCREMENTS = 200_000
"""Largest number of increments of a loading history."""
_PARTS, _DIVIDED, _EACH = 63, 80, 2
"""Increments that yielding may add, since those with a large error are divided
(`solver.loading.integration`): so many to each, but not more than a number and so many to each.
Measured: a roller has 69 in place of 2, a fillet 131 of 12, a bar that necks 62 of 40, a mandrel
that slides through a hole 364 of 120."""
_LARGE = 3.0
"""Time of an increment under large strain over that under small strain: 2.4 to 3."""
_LARGE_REGION = 2.0
"""The same, of large strain in a region: 1.6 to 2."""


def effort_of(
    description: Description, scene: tables.SceneFile, increments: Sequence[int]
) -> Effort:
    """Return the work of a loading path.

    Parameters
    ----------
    scene : tables for the values of its parameters
    increments : numbers for its runs, shared increments counted once

    Raises
    ------
    StudyError
        for a body that cannot be meshed with these values
    """
    elements, unknowns = 0, _free_motions(scene)
    joined = [side for pair in scene.contacts for side in (pair.slave, pair.master)]
    joined += [side for link in scene.links for side in link.sides]
    sides = [side.split(".") for side in joined]
    for name, body in scene.bodies.items():
        size = _size_of(description, name, body)
        elements += size.elements
        own = {boundary for of, boundary in sides if of == name}
        loads = [load_of(load.plain) for load in scene.loads if load.body == name]
        driven = any(
            each.components or each.moves or each.softening(np.zeros((2, 0))) is not None
            for each in loads
        )
        # an elastic body is condensed to its surfaces in contact and links
        whole = driven or body.strain == "large" or not is_elastic(scene, body)
        condensed = size.on(own) if own and not whole else None
        held = [(b, "xy".index(axis)) for b, axes in body.supports.items() for axis in axes]
        held += [(b, axis) for each in loads for b in each.boundaries for axis in each.components]
        for axis in (0, 1):
            fixed = size.on(boundary for boundary, along in held if along == axis)
            kept = range(size.nodes) if condensed is None else condensed
            unknowns += len(kept) - len(fixed.intersection(kept))
    total, bodies = sum(increments), scene.bodies.values()
    yields = not all(is_elastic(scene, body) for body in bodies)
    return Effort(
        elements=elements,
        unknowns=unknowns,
        increments=total,
        most_increments=total,
        divided=yields * min(_PARTS * total, _DIVIDED + _EACH * total),
        slow=max((_slowed(body) for body in bodies), default=1.0),
    )


def _slowed(body: tables.BodyTable) -> float:
    if body.strain == "small":
        return 1.0
    return _LARGE_REGION if body.large_region else _LARGE


def too_large(scene: tables.SceneFile) -> Iterator[StudyError]:
    """Yield mistakes in shapes that are grids: those without lines, or with too many."""
    for name, body in scene.bodies.items():
        if body.shape and body.shape.kind in LINED:
            try:
                lines_of(body.shape)
            except ModelError as error:
                field = f"bodies.{name}.shape.{error.field}"
                yield StudyError(field, error.value, error.allowed)


def too_long(description: Description, scene: tables.SceneFile) -> Iterator[StudyError]:
    """Yield the mistake of a loading history of too many increments, before it is made."""
    count = increments_of(scene, description.meshes)
    if count > _MOST_INCREMENTS:
        field = "loading" if scene.loading else "repeat.times" if scene.repeat else "stages"
        allowed = (
            f"makes more than {_MOST_INCREMENTS} increments: take fewer cycles, fewer increments, "
            "or amplitudes with fewer times"
        )
        yield StudyError(field, scene.repeat.times if scene.repeat else "", allowed)


def in_one_increment(scene: tables.SceneFile) -> bool:
    """Tell whether one increment solves a run: nothing yields, and all is proportional to the load.

    With friction this requires surfaces that touch everywhere before loading, as flat ones do.
    """
    if scene.loading is None or scene.loading.cycles is not None:
        return False
    if any(body.strain == "large" for body in scene.bodies.values()):
        return False
    if any(load_of(load.plain).moves for load in scene.loads):
        return False
    laws = [(friction_of(pair), pair) for pair in scene.contacts]
    flat = [pair.sliding == "small" and not pair.gap for law, pair in laws if law.rough]
    proportional = all(law.proportional for law, _ in laws) and all(flat)
    return proportional and all(is_elastic(scene, body) for body in scene.bodies.values())


def is_elastic(scene: tables.SceneFile, body: tables.BodyTable) -> bool:
    """Tell whether the material of a body has no yield stress."""
    return getattr(scene.materials[body.material], "yield_stress", None) is None


def _free_motions(scene: tables.SceneFile) -> int:
    """Return the number of motions of rigid bodies that are free under a force."""
    motions = [each for body in scene.rigid.values() for each in (body.x, body.y, body.rotation)]
    return sum(motion.pushed is not None for motion in motions)


class _BodySize(NamedTuple):
    """Numbers of elements and nodes of a body, and the numbers of the nodes of each boundary."""

    elements: int
    nodes: int
    boundaries: Mapping[str, frozenset[int]]

    def on(self, boundaries: Iterable[str]) -> frozenset[int]:
        """Return the nodes of boundaries; unknown ones have none."""
        each = (self.boundaries.get(name, frozenset()) for name in boundaries)
        return frozenset().union(*each)


def _size_of_mesh(mesh: Mesh, element: str) -> _BodySize:
    """Return the size of a mesh with an element."""
    nodes = Dofs(mesh, element_type(element).element)
    boundaries = {
        name: frozenset(nodes.get_facet_dofs(np.asarray(facets)).flatten().tolist())
        for name, facets in (mesh.boundaries or {}).items()
    }
    return _BodySize(mesh.nelements, int(nodes.N), boundaries)


_SIZES: WeakKeyDictionary[Description, dict[str, _BodySize]] = WeakKeyDictionary()
"""Sizes of the bodies of each description in use, by the JSON of what decides them."""
_MOST = 256
"""Largest number of sizes that are kept for a description."""


def _size_of(description: Description, name: str, body: tables.BodyTable) -> _BodySize:
    """Return the size of a body; its mesh is made for it, within the limit of shapes.

    All grids of as many lines, without cuts and boxes, have the size of one of them.
    """
    known, leave = _SIZES.setdefault(description, {}), {"supports", "material"}
    boxed = body.cuts or body.cracks or any(each.x or each.y for each in body.boundaries.values())
    try:
        lines = ""
        if body.shape and body.shape.kind in LINED and not boxed:
            lines = f"{body.shape.kind} {[len(each) for each in lines_of(body.shape)]}"
            leave = {*leave, "shape", "move", "regions"}
        key = lines + body.model_dump_json(exclude=leave)
        if key not in known:
            mesh = mesh_of_body(body, description.meshes)
            if body.shape is not None:
                few(mesh.nelements)
            known[key] = _size_of_mesh(mesh, body.element or default_element(mesh, body.strain))
    except ModelError as error:
        beside = body.shape is None or error.field.startswith(("boundaries.", "cuts.", "cracks."))
        where = f"bodies.{name}" if beside else f"bodies.{name}.shape"
        raise StudyError(f"{where}.{error.field}", error.value, error.allowed) from None
    while len(known) > _MOST:
        del known[next(iter(known))]
    return known[key]
