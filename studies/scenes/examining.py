"""Find all mistakes of a scene file: in its entries, between them, and in its bodies."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from solver.contact.system import System
from studies.errors import SceneError, StudyError
from studies.scenes import tables
from studies.scenes.building import Builder, program_of
from studies.scenes.checking import (
    contradictions,
    failed_checks,
    unmet_needs,
    wrong_accuracies,
    wrong_needs,
    wrong_parameters,
)
from studies.scenes.description import Description
from studies.scenes.effort import too_long
from studies.scenes.refusals import Where, dotted
from studies.scenes.results import fatigue_of, places_of, view_of
from studies.scenes.shipped import is_built_in

_NEAR = 0.1
"""Ratio of the gap to the shortest edge of a surface; up to it a body that contact alone holds
counts as touching."""


def examined(description: Description, *, built: bool) -> tables.SceneFile:
    """Return the tables of a file, for the defaults of its parameters.

    Parameters
    ----------
    built : whether to build its bodies too

    Raises
    ------
    SceneError
        with all mistakes. A wrong entry hides only mistakes of the whole model: a free rigid
        motion, bodies apart or overlapping
    """
    found = description.readable(description.declared)
    mistakes = found.mistakes
    if found.tables:
        others = [*wrong_parameters(found.tables, description.used()), *wrong_needs(found.tables)]
        others += contradictions(found.tables, description.meshes)
        others += too_long(description, found.tables)
        if not {where[0] for where in found.own} & {"accuracy", "parameters"}:
            others += wrong_accuracies(found.tables)
        if not found.own:  # a table with a stand-in may be the one that is needed
            others += unmet_needs(found.tables)
        others += failed_checks(found.tables, description.declared)
        if not description.shipped and is_built_in(found.tables.name):
            allowed = "a built-in scene has this name: choose another"
            others.append(StudyError("name", found.tables.name, allowed))
        mistakes += _without_stand_ins(others, found.own)
        if built:
            absent = {dotted(where) for where in found.own}
            builder = Builder(found.tables, description.meshes, [*mistakes], absent)
            _build(builder, found.tables)
            mistakes += _without_stand_ins(builder.mistakes[len(mistakes) :], found.own)
    if mistakes or found.tables is None:
        raise SceneError(description.file, mistakes)
    return found.tables


def _without_stand_ins(
    mistakes: Iterable[StudyError], own: Mapping[Where, frozenset[str]]
) -> Iterator[StudyError]:
    """Yield the mistakes in entries of the file, without those in stand-ins."""
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
    """Build model, system and samples; the builder collects the mistakes."""
    from solver.contact.system import System
    from solver.loading.checks import check_freed
    from solver.results.fields import Samples

    model = builder.model()
    if model is not None:
        system = builder.attempt("", lambda: System(model))
        if system:
            builder.mistakes += _bodies_apart(system)
            if not builder.mistakes:  # such as a program of too many increments
                builder.attempt("", lambda: check_freed(system, program_of(scene, builder.meshes)))
            builder.attempt("results", lambda: Samples(system, view_of(scene)))
            if not any(each.field.startswith("results") for each in builder.mistakes):
                builder.mistakes += _places_outside(system, scene)
            if scene.fatigue is not None and not builder.mistakes:
                view = view_of(scene)
                made = fatigue_of(scene.fatigue, view)
                builder.attempt("", lambda: made.before(None, system, view))


def _places_outside(system: System, scene: tables.SceneFile) -> Iterator[StudyError]:
    """Yield the lines and points that have no place in their body."""
    found = places_of(scene)
    for kind, places in (("lines", found.lines), ("points", found.points)):
        for name, place in places.items():
            known = place.body in system.names
            if known and not system.sampler(place.body, place.X).inside.any():
                ends = [[float(f"{x:.6g}") for x in at] for at in place.X.T[[0, -1]]]
                where = ends if kind == "lines" else ends[0]
                allowed = f"must meet the body {place.body}: no place of it is inside"
                yield StudyError(f"results.{kind}.{name}", where, allowed)


def _bodies_apart(system: System) -> Iterator[StudyError]:
    """Yield the bodies that contact alone holds and that touch nothing before loading."""
    from solver.model.rigid import RigidBody

    state = system.initial()
    for number, (name, part) in enumerate(zip(system.all_names, system.parts, strict=True)):
        own = [i for i in system.interfaces if number in (i.slave, i.master)]
        if not part.rigid.shape[1] or not own or system.links.rows[number] is not None:
            continue
        gap = min(float(i.pairing(state.u, 0.0).gap.min()) for i in own)
        # the gap of a curved surface is a mean around the point where it touches
        if gap > _NEAR * min(i.slave_surface.shortest_edge for i in own):
            allowed = f"is held by contact alone and stands {gap:.4g} mm away: move it there"
            kind = "rigid" if isinstance(part.body, RigidBody) else "bodies"
            yield StudyError(f"{kind}.{name}", name, allowed)
