"""Mistakes between the entries of a scene file, such as names that do not exist."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from keyword import iskeyword
from typing import Any, get_args

import numpy as np

from solver.errors import ModelError
from solver.parameters import Accuracy, is_number
from solver.results.outputs import Need, outputs
from solver.results.quantities import IN_SPACE, QUANTITIES
from solver.results.requested import FORCES_OF_CONTACT, OF_PART, of_body
from solver.tensors import AXES
from studies.errors import StudyError, one_of
from studies.scenes import tables
from studies.scenes.arithmetic import is_expression
from studies.scenes.description import LARGEST
from studies.scenes.names import RESERVED, in_use
from studies.scenes.results import fatigue_of, view_of

NO_FILE = "there is no such file beside the scene, or posted with it as meshes"


def contradictions(scene: tables.SceneFile, meshes: Iterable[str] | None) -> Iterator[StudyError]:
    """Yield contradictions between entries, and names that do not exist.

    Parameters
    ----------
    meshes : names of the files beside the scene file; None leaves this check out
    """
    files = None if meshes is None else set(meshes)
    yield from _bodies(scene, files)
    yield from _loads(scene, files)
    yield from _contacts(scene)
    yield from _stages(scene)
    yield from _results(scene)
    yield from _outputs(scene)
    yield from _names(scene)
    yield from _fatigue(scene)
    for k, check in enumerate(scene.checks):
        yield from _one_of(f"checks[{k}].parameter", check.parameter, scene.names)


def _fatigue(scene: tables.SceneFile) -> Iterator[StudyError]:
    if scene.fatigue is None:
        return
    for body in scene.fatigue.bodies:
        yield from _one_of("fatigue.bodies", body, scene.bodies)
    try:
        fatigue_of(scene.fatigue, view_of(scene))
    except ModelError as error:
        yield StudyError(f"fatigue.{error.field}", error.value, error.allowed)


def failed_checks(scene: tables.SceneFile, values: Mapping[str, Any]) -> Iterator[StudyError]:
    """Yield the checks of a file that fail; ``values`` are those of the parameters."""
    for check in scene.checks:
        if not check.that:
            yield StudyError(check.parameter, values.get(check.parameter), check.allowed)


def wrong_parameters(scene: tables.SceneFile, used: set[str]) -> Iterator[StudyError]:
    """Yield mistakes in declared parameters that have a default.

    Parameters
    ----------
    used : parameters that some entry uses
    """
    for name, each in scene.declared.items():
        field, default = f"parameters.{name}", each.default
        if default is None:  # see `wrong_accuracies`
            continue
        if (
            name in QUANTITIES
            or name in IN_SPACE
            or in_use(name, {*scene.declared, *scene.outputs})
        ):
            yield StudyError(field, name, "a data set has a variable of this name: choose another")
        if iskeyword(name):
            yield StudyError(field, name, "is a word of the language Python: choose another")
        if is_number(default) and not -LARGEST <= default <= LARGEST:
            allowed = f"must be at most {LARGEST:g} in absolute value"
            yield StudyError(f"{field}.default", default, allowed)
        if name not in used and not (scene.accuracy and name == tables.ACCURACY):
            yield StudyError(field, default, f"has no effect: no entry uses ${name}")
        if is_expression(default):
            allowed = "must be a value; [derived] may have expressions"
            yield StudyError(f"{field}.default", default, allowed)
            continue
        if each.range is not None and not is_number(default):
            yield StudyError(f"{field}.range", each.range, "needs a number as default")
        elif each.range is not None and not each.range[0] <= default <= each.range[1]:  # type: ignore[operator]
            low, high = each.range
            yield StudyError(
                f"{field}.default", default, f"must be in its range, {low:g} to {high:g}"
            )
        if isinstance(default, str) and each.choices is None:
            yield StudyError(f"{field}.choices", None, "must be given if the default is a word")
        elif each.choices is not None and default not in each.choices:
            listed = ", ".join(each.choices)
            yield StudyError(f"{field}.default", default, f"must be one of its choices: {listed}")


def wrong_needs(scene: tables.SceneFile) -> Iterator[StudyError]:
    """Yield what declared parameters need and cannot be met."""
    for name, each in scene.declared.items():
        for other, of in each.needs.items():
            values = (of.other_than,) if isinstance(of, tables.OtherThan) else of
            field, known = f"parameters.{name}.needs", scene.declared.get(other)
            if known is None:
                yield StudyError(field, other, one_of(other, scene.declared))
                continue
            for value in values:
                if known.choices and value not in known.choices:
                    yield StudyError(f"{field}.{other}", value, one_of(value, known.choices))
                elif not known.choices and isinstance(value, str):
                    yield StudyError(f"{field}.{other}", value, "must be a number")


def wrong_accuracies(scene: tables.SceneFile) -> Iterator[StudyError]:
    """Yield mistakes in the numbers that ``accuracy`` sets, and parameters that have no default."""
    for name, each in scene.parameters.items():
        if each.default is None and (scene.accuracy is None or name not in scene.accuracy.standard):
            allowed = "must be given, or a number in each table of accuracy"
            yield StudyError(f"parameters.{name}.default", None, allowed)
    if scene.accuracy is None:
        return
    if tables.ACCURACY in scene.parameters:
        field = f"parameters.{tables.ACCURACY}"
        yield StudyError(field, tables.ACCURACY, "is declared by the table accuracy")
    usual = scene.accuracy.standard
    for level in get_args(Accuracy):
        numbers = scene.accuracy.level(level)
        for name in sorted(usual.keys() | numbers.keys()):
            field, value = f"accuracy.{level}.{name}", numbers.get(name)
            known = scene.parameters.get(name)
            if value is None or known is None or known.default is not None:
                allowed = "every accuracy must set the same parameters, which have no default"
                yield StudyError(field, value, allowed)
            elif type(value) is float and known.unit == "1" and type(usual[name]) is int:
                yield StudyError(field, value, "must be an integer, as for standard")
            elif known.range is not None and not known.range[0] <= value <= known.range[1]:
                low, high = known.range
                yield StudyError(field, value, f"must be in its range, {low:g} to {high:g}")


def _one_of(field: str, name: str, known: Iterable[str]) -> Iterator[StudyError]:
    names = list(known)
    if name not in names:
        yield StudyError(field, name, one_of(name, names))


def _bodies(scene: tables.SceneFile, meshes: set[str] | None) -> Iterator[StudyError]:
    for name, body in scene.bodies.items():
        where = f"bodies.{name}"
        yield from _one_of(f"{where}.material", body.material, scene.materials)
        if (body.shape is None) == (body.mesh is None):
            given = "both" if body.shape else None
            yield StudyError(f"{where}.shape", given, "must be given, or mesh: one of the two")
        if body.part is not None and body.mesh is None:
            yield StudyError(f"{where}.part", body.part, "needs mesh")
        if body.mesh is not None and meshes is not None and body.mesh not in meshes:
            yield StudyError(f"{where}.mesh", body.mesh, NO_FILE)
        boxes: dict[str, tables.BoundaryTable | tables.CutTable | tables.RegionTable] = {}
        boxes |= {f"regions.{other}": box for other, box in body.regions.items()}
        boxes |= {f"boundaries.{other}": box for other, box in body.boundaries.items()}
        boxes |= {f"cuts.{other}": cut for other, cut in body.cuts.items()}
        for other, span in ((o, s) for o, box in boxes.items() for s in (box.x, box.y)):
            if span is not None and not span[0] < span[1]:
                allowed = "must be two increasing numbers"
                yield StudyError(f"{where}.{other}", list(span), allowed)
    for name, rigid in scene.rigid.items():
        for axis in ("x", "y", "rotation"):
            motion = getattr(rigid, axis)
            if motion.moved is not None and motion.pushed is not None:
                allowed = "must be moved or pushed, not both"
                yield StudyError(f"rigid.{name}.{axis}", "both", allowed)
            if motion.locked is None:
                continue
            if motion.pushed is None:
                yield StudyError(f"rigid.{name}.{axis}.locked", motion.locked, "needs pushed")
            stages = [stage.name for stage in scene.stages]
            yield from _one_of(f"rigid.{name}.{axis}.locked", motion.locked, stages)


def _loads(scene: tables.SceneFile, files: set[str] | None) -> Iterator[StudyError]:
    for k, load in enumerate(scene.loads):
        yield from _one_of(f"loads[{k}].body", load.body, scene.bodies)
        for name, each in load.tabulated.items():
            if files is not None and each.file not in files:
                allowed = NO_FILE
                yield StudyError(f"loads[{k}].{name}.file", each.file, allowed)
    amplitudes: list[tuple[str, tables.Amplitude | None]] = [
        (f"loads[{k}].{name}", given)
        for k, load in enumerate(scene.loads)
        for name, given in load.amplitudes.items()
    ]
    amplitudes += [(f"contacts[{k}].amplitude", a.amplitude) for k, a in enumerate(scene.contacts)]
    amplitudes += [
        (f"rigid.{name}.{axis}.amplitude", getattr(rigid, axis).amplitude)
        for name, rigid in scene.rigid.items()
        for axis in ("x", "y", "rotation")
    ]
    names = [stage.name for stage in scene.stages]
    for where, amplitude in amplitudes:
        for stage, course in (amplitude or {}).items() if names else ():
            yield from _one_of(where, stage, names)
            file = getattr(course, "file", None)
            if file is not None and files is not None and file not in files:
                allowed = NO_FILE
                yield StudyError(f"{where}.{stage}.file", file, allowed)


def _contacts(scene: tables.SceneFile) -> Iterator[StudyError]:
    bodies = [*scene.bodies, *scene.rigid]
    for k, contact in enumerate(scene.contacts):
        for side in ("slave", "master"):
            body = getattr(contact, side).partition(".")[0]
            yield from _one_of(f"contacts[{k}].{side}", body, bodies)
        names = [stage.name for stage in scene.stages]
        for stage in contact.active or () if names else ():
            yield from _one_of(f"contacts[{k}].active", stage, names)
        if contact.active and not names:
            yield StudyError(f"contacts[{k}].active", list(contact.active), "needs stages")
    for k, link in enumerate(scene.links):
        for side, boundary in zip(("slave", "master"), link.sides, strict=False):
            yield from _one_of(f"links[{k}].{side}", boundary.partition(".")[0], scene.bodies)
        if link.rigid is not None:
            yield from _one_of(f"links[{k}].rigid", link.rigid, scene.rigid)


def _stages(scene: tables.SceneFile) -> Iterator[StudyError]:
    if bool(scene.stages) == (scene.loading is not None):
        given = [stage.name for stage in scene.stages]
        what = "must be left out where loading is given" if given else "must be given, or loading"
        yield StudyError("stages", given or None, f"{what}: one of the two")
    for k, stage in enumerate(scene.stages):
        for side in stage.remove:
            yield from _one_of(f"stages[{k}].remove", side.partition(".")[0], scene.bodies)
    if scene.stages and scene.stages[0].release:
        allowed = "must be false in the first stage: it ends all loads, and none has acted before"
        yield StudyError("stages[0].release", True, allowed)
    if scene.repeat is None:
        return
    repeated, names = list(scene.repeat.stages), [stage.name for stage in scene.stages]
    for name in repeated:
        yield from _one_of("repeat.stages", name, names)
    if set(repeated) <= set(names):
        first = names.index(repeated[0])
        if names[first : first + len(repeated)] != repeated:
            allowed = f"must be stages one after the other, in their order: {', '.join(names)}"
            yield StudyError("repeat.stages", repeated, allowed)
        if all(stage.release for stage in scene.stages if stage.name in repeated):
            allowed = "must hold a stage that loads the bodies: they are released once"
            yield StudyError("repeat.stages", repeated, allowed)


def _results(scene: tables.SceneFile) -> Iterator[StudyError]:
    taken = scene.results
    for axis in ("x", "y") if taken.map else ():
        yield from _spaced(f"results.map.{axis}", getattr(taken.map, axis))
    if taken.s:
        yield from _spaced("results.s", taken.s)
    if taken.profile:
        yield from _spaced("results.profile.depth", taken.profile.depth)
        yield from _one_of("results.profile.body", taken.profile.body, scene.bodies)
    for side in taken.surfaces:
        yield from _one_of("results.surfaces", side.partition(".")[0], scene.bodies)
    for word in taken.words:
        ends = scene.stage_names
        known: dict[str, Iterable[str]] = {
            "body": scene.bodies, "rigid": scene.rigid, "since": ends, "until": ends,
        }  # fmt: skip
        for entry, names in known.items():
            name = getattr(getattr(taken, word, None), entry, None)
            if name is not None:
                yield from _one_of(f"results.{word}.{entry}", name, names)
    if not math.isclose(math.hypot(*taken.axis.along), 1.0, rel_tol=1e-9):
        yield StudyError("results.axis.along", list(taken.axis.along), "must have the length 1")
    for name, line in scene.results.lines.items():
        where = f"results.lines.{name}"
        yield from _one_of(f"{where}.body", line.body, scene.bodies)
        straight = (line.start is not None, line.end is not None)
        arc = tuple(each is not None for each in (line.centre, line.radius, line.angles))
        if not (all(straight) and not any(arc)) and not (all(arc) and not any(straight)):
            allowed = "must have start and end, or centre, radius and angles"
            yield StudyError(where, line.model_dump(exclude_none=True), allowed)
    for name, point in scene.results.points.items():
        yield from _one_of(f"results.points.{name}.body", point.body, scene.bodies)


def unmet_needs(scene: tables.SceneFile) -> Iterator[StudyError]:
    """Yield the requested outputs that need something that the file does not have."""
    taken = scene.results
    there: Mapping[Need, tuple[bool, str]] = {
        "map": (taken.map is not None, "results.map"),
        "profile": (taken.profile is not None, "results.profile"),
        "s": (taken.s is not None, "results.s"),
        "surfaces": (bool(taken.surfaces), "results.surfaces"),
        "contact": (bool(scene.contacts), "contacts"),
        "crack": (any(body.cracks for body in scene.bodies.values()), "a body with cracks"),
        "release": (bool(scene.released), "a last stage that releases the bodies"),
    }
    for word in taken.words:
        missing = [words for need in outputs()[word].needs for is_there, words in [there[need]]
                   if not is_there]  # fmt: skip
        if missing:
            yield StudyError("results.outputs", word, f"needs {', '.join(missing)}")
    bodies = [side.partition(".")[0] for side in taken.surfaces]  # those with results
    if taken.profile and bodies:
        yield from _one_of("results.profile.body", taken.profile.body, bodies)


def _spaced(where: str, axis: tables.Spaced) -> Iterator[StudyError]:
    if isinstance(axis, tables.SpacedTable):
        yield from _piece(where, axis)
        return
    wrong = [
        mistake
        for k, each in enumerate(axis)
        if isinstance(each, tables.SpacedTable)
        for mistake in _piece(f"{where}[{k}]", each)
    ]
    yield from wrong
    if not wrong and not (np.diff(tables.positions(axis)) > 0).all():
        yield StudyError(where, "several pieces", "must be in increasing order without overlap")


def _piece(where: str, axis: tables.SpacedTable) -> Iterator[StudyError]:
    start, stop = axis.start, axis.stop
    if not start < stop:
        yield StudyError(f"{where}.stop", stop, f"must be > start = {start:g}")
    elif (axis.near is None) != (axis.size is None):
        missing = "size" if axis.size is None else "near"
        yield StudyError(f"{where}.{missing}", None, "must be given: near and size go together")
    elif axis.near is not None and not start <= axis.near <= stop:
        yield StudyError(f"{where}.near", axis.near, f"must be from {start:g} to {stop:g}")
    else:
        try:
            if not axis.positions().size:
                yield StudyError(f"{where}.within", axis.within, "must hold a point")
        except ModelError as error:
            yield StudyError(f"{where}.{error.field}", error.value, error.allowed)


def _outputs(scene: tables.SceneFile) -> Iterator[StudyError]:
    for name, output in scene.outputs.items():
        where = f"outputs.{name}"
        yield from _one_of(f"{where}.stage", output.stage, scene.stage_names)
        if output.minus:
            yield from _one_of(f"{where}.minus", output.minus, scene.stage_names)
        places: dict[str, list[str]] = {
            "body": list(scene.bodies),
            "line": list(scene.results.lines),
            "contact": [contact.name for contact in scene.contacts],
            "part": [*scene.rigid, *(scene.bodies if output.of.startswith("reaction") else ())],
        }
        fitting: tuple[str, ...] = ("contact",)
        if output.of in (*of_body(2), *OF_PART):
            fitting = ("part",) if output.of in OF_PART else ("body", "line")
        given = {key: getattr(output, key) for key in places if getattr(output, key) is not None}
        if len(given) != 1 or not set(given) <= set(fitting):
            allowed = f"needs one of {', '.join(fitting)} for {output.of}"
            yield StudyError(where, given, allowed)
            continue
        ((key, value),) = given.items()
        yield from _one_of(f"{where}.{key}", value, places[key])
        if output.of in (*OF_PART, *FORCES_OF_CONTACT):
            if "take" in output.model_fields_set:
                allowed = "must be left out: the number is the value at the end of the stage"
                yield StudyError(f"{where}.take", output.take, allowed)
        elif key == "contact" and output.minus:
            yield StudyError(f"{where}.minus", output.minus, "needs a body or a line")
        if key == "body" and output.take in ("integral", "extent"):
            yield StudyError(f"{where}.take", output.take, "needs a line or a contact")
        if key != "body" and (output.x or output.y):
            yield StudyError(where, given, "a box of x and y needs a body")


def _names(scene: tables.SceneFile) -> Iterator[StudyError]:
    groups: Mapping[str, list[str]] = {
        "rigid": [name for name in scene.rigid if name in scene.bodies],
        "stages": _twice([stage.name for stage in scene.stages]) or _twice(scene.stage_names),
        "contacts": _twice([contact.name for contact in scene.contacts]),
        "results.outputs": _twice(list(scene.results.outputs or ())),
        "results.surfaces": _twice([side.partition(".")[0] for side in scene.results.surfaces]),
    }
    for field, names in groups.items():
        for name in names:
            listed, named = "is listed twice", "two have this name: give each its own"
            yield StudyError(field, name, listed if field.startswith("results.") else named)
    taken = {*QUANTITIES, *IN_SPACE, *RESERVED, *scene.names}
    for name in scene.outputs:
        own = {name, *(f"{name}_{axis}" for axis in AXES)}
        for each in sorted(each for each in own if each in taken or in_use(each, scene.names)):
            allowed = f"the data set has {each} already: choose another name"
            yield StudyError(f"outputs.{name}", name, allowed)
        taken |= own


def _twice(names: list[str]) -> list[str]:
    return sorted(name for name, count in Counter(names).items() if count > 1)
