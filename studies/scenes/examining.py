"""All mistakes of a scene file at once: in its entries, between them, and in its bodies."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from studies.errors import SceneError, StudyError
from studies.scenes import tables
from studies.scenes.building import Builder
from studies.scenes.checking import clashes, declarations, defaults, lacking, unmet
from studies.scenes.description import Description
from studies.scenes.mending import Where
from studies.scenes.refusals import dotted
from studies.scenes.results import view_of
from studies.scenes.shipped import is_built_in

if TYPE_CHECKING:
    from solver.contact.system import System

_NEAR = 0.1
"""Ratio of the gap to the shortest edge of a surface, up to which a body held by contact alone
counts as touching."""


def examined(description: Description, *, built: bool) -> tables.SceneFile:
    """Return the tables of a file, for the defaults of its parameters.

    Parameters
    ----------
    built : whether its bodies are built, for the defaults

    Raises
    ------
    SceneError
        with all mistakes; an entry that is wrong hides no mistake of other tables, but for what
        needs the whole model: a free rigid motion, bodies apart or overlapping
    """
    found = description.readable(description.declared)
    mistakes = found.mistakes
    if found.tables:
        others = [*declarations(found.tables, description.used())]
        others += clashes(found.tables, description.meshes)
        if not {where[0] for where in found.own} & {"accuracy", "parameters"}:
            others += defaults(found.tables)
        if not found.own:  # what has a stand-in may be what is needed
            others += lacking(found.tables)
        others += unmet(found.tables, description.declared)
        if not description.shipped and is_built_in(found.tables.name):
            allowed = "a built-in scene has this name: choose another"
            others.append(StudyError("name", found.tables.name, allowed))
        mistakes += _meant(others, found.own)
        if built:
            absent = {dotted(where) for where in found.own}
            builder = Builder(found.tables, description.meshes, [*mistakes], absent)
            _build(builder, found.tables)
            mistakes += _meant(builder.mistakes[len(mistakes) :], found.own)
    if mistakes or found.tables is None:
        raise SceneError(description.file, mistakes)
    return found.tables


def _meant(
    mistakes: Iterable[StudyError], own: Mapping[Where, frozenset[str]]
) -> Iterator[StudyError]:
    """Yield the mistakes of what is the file's own, not of stand-ins."""
    for mistake in mistakes:
        for where, kept in own.items():
            table, field = dotted(where), mistake.field
            inside = field.startswith((f"{table}.", f"{table}["))
            entry = field[len(table) + 1 :].split(".")[0] if inside else ""
            if field == table or (inside and entry not in kept):
                break
        else:
            yield mistake


def _build(builder: Builder, scene: tables.SceneFile) -> None:
    """Build the scene; the builder keeps the mistakes of meshes, bodies, contact and the map."""
    from solver.contact.system import System
    from solver.results.samples import Samples

    model = builder.model()
    if model is not None:
        system = builder.tried("", lambda: System(model))
        if system:
            builder.mistakes += _apart(system)
            builder.tried("results", lambda: Samples(system, view_of(scene)))


def _apart(system: System) -> Iterator[StudyError]:
    """Yield the bodies that contact alone must hold, and that touch nothing at the beginning."""
    from solver.model.rigid import RigidBody

    state = system.initial()
    for number, (name, part) in enumerate(zip(system.all_names, system.parts, strict=True)):
        own = [i for i in system.interfaces if number in (i.slave, i.master)]
        if not part.rigid.shape[1] or not own:
            continue
        gap = min(float(i.pairing(state.u, 0.0).gap.min()) for i in own)
        # a curved surface touches at a point, and its gap is a mean around it
        if gap > _NEAR * min(i.slave_surface.shortest_edge for i in own):
            allowed = f"is held by contact alone and stands {gap:.4g} mm away: move it there"
            kind = "rigid" if isinstance(part.body, RigidBody) else "bodies"
            yield StudyError(f"{kind}.{name}", name, allowed)
