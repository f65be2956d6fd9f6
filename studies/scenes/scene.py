"""The `Scene` made from a scene file: parameters, model, loading and results from its tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, make_dataclass, replace
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from annotated_types import Interval, Unit

from solver.contact.state import Converged
from solver.derivatives.asked import Derivatives
from solver.errors import ModelError
from solver.loading.program import Program, walked
from solver.model.model import Model
from solver.parameters import Accuracy, by_accuracy, check, described
from solver.results.cycles import LEAST, over_cycles
from solver.results.fields import Samples
from solver.results.figures import cost
from solver.results.named_places import NamedPlaces, at_named_places
from solver.results.outputs import outputs
from solver.results.record import Status
from solver.results.run import FinishedRun, Output, Values
from solver.results.view import View
from solver.scenes.material_parameters import ContactParameters
from solver.scenes.scene import Effort
from studies.errors import SceneError, StudyError
from studies.scenes import tables
from studies.scenes.building import Builder, friction_of, law_of, program_of
from studies.scenes.checking import contradictions, failed_checks, unmet_needs
from studies.scenes.description import Description
from studies.scenes.effort import effort_of, in_one_increment, too_large, too_long
from studies.scenes.examining import examined
from studies.scenes.file_scene import FileScene
from studies.scenes.results import fatigue_of, numbers_of, output_of, places_of, view_of
from studies.scenes.tables import ACCURACY


def file_scene(description: Description, *, built: bool = False) -> FileScene:
    """Return the scene of a description, the same object for the same content.

    Parameters
    ----------
    built : whether to build its bodies once, with the defaults, to find mistakes in them

    Raises
    ------
    SceneError
        with all mistakes
    """
    known = _SCENES.get(description.key)
    if known is None or built:
        scene = examined(description, built=built)
        known = _SCENES.setdefault(description.key, _scene_of(description, scene))
        while len(_SCENES) > _MOST or (len(_SCENES) > 1 and _kept_bytes() > _MOST_BYTES):
            del _SCENES[next(iter(_SCENES))]
    return known


_SCENES: dict[tuple[str, str, bool], FileScene] = {}
_MOST = 64
"""Largest number of scenes of files that a process keeps."""
_MOST_BYTES = 100_000_000
"""Largest size of all their meshes."""


def _kept_bytes() -> int:
    """Return the size of the meshes of all scenes that are kept."""
    kept = (each.description.meshes or {} for each in _SCENES.values())
    return sum(len(mesh.data) for meshes in kept for mesh in meshes.values())


def _scene_of(description: Description, scene: tables.SceneFile) -> FileScene:
    own = tuple(q for number in numbers_of(scene) for q in number.quantities)
    made = FileScene(
        name=scene.name,
        summary=scene.summary or f"scene of the file {description.file}",
        parameters=_parameters(description, scene),
        branch=_branch(description),
        model=partial(_model, description),
        program=partial(_program, description),
        view=partial(_view, description),
        places=partial(_places, description),
        outputs=(
            *(partial(_output, description, word) for word in scene.results.words),
            partial(_at_places, description),
            *([_over_cycles] if scene.repeat else []),
            *([_Assessed(description)] if scene.fatigue else []),
        ),
        costs=(cost,),
        until=partial(_until, description),
        watch=partial(_watch, description),
        effort=partial(_effort, description),
        warnings=partial(_warnings, description),
        advice={
            Status[key.upper()]: text for key, text in scene.advice.model_dump().items() if text
        },
        quantities=own,
        source=description.digest,
        allow=scene.allow,
        increment_error=scene.increment_error,
        description=description,
    )
    if scene.derivatives is None:
        return made
    asked = Derivatives(**scene.derivatives.model_dump())
    try:
        more = asked.quantities(made.parameters, made.known_quantities)
    except ModelError as error:
        mistake = StudyError(f"derivatives.{error.field}", error.value, error.allowed)
        raise SceneError(description.file, [mistake]) from None
    return replace(made, derivatives=asked, quantities=(*own, *more))


def shipped_scene(path: Path) -> FileScene:
    """Return the scene of a file of the package."""
    return file_scene(_shipped(path))


@cache
def _shipped(path: Path) -> Description:
    return Description.read(path, shipped=True)


def stored_scene(name: str, content: dict[str, Any]) -> FileScene:
    """Return the scene of the content of a file, without its mesh files."""
    return file_scene(Description(name, content, None))


def read_scene(path: Path | str) -> FileScene:
    """Return the scene of a file, checked with its default parameters.

    Raises
    ------
    StudyError, SceneError
        if the file cannot be read; with all its mistakes
    """
    return file_scene(Description.read(path), built=True)


# -- functions that the driver of scenes calls -----------------------------------------------------


def _model(description: Description, parameters: Any) -> Model:
    builder = Builder(_tables(description, parameters), description.meshes)
    model = builder.model()
    if model is None:
        raise SceneError(description.file, builder.mistakes)
    return model


def _program(description: Description, parameters: Any) -> Program:
    return program_of(_tables(description, parameters), description.meshes)


def _effort(description: Description, parameters: Any, values: Sequence[Any]) -> Effort:
    scene = _tables(description, parameters)
    branch = _branch(description)
    if in_one_increment(scene):
        return effort_of(description, scene, [1] * (len(values) if branch else 1))
    if not branch:
        most, files = _program(description, parameters).count, description.meshes
        if scene.repeat is None or scene.repeat.until is None:
            return effort_of(description, scene, [most])
        fewest = scene.repeat.model_copy(update={"times": LEAST})
        least = program_of(scene.model_copy(update={"repeat": fewest}), files).count
        return replace(effort_of(description, scene, [least]), most_increments=most)
    runs = [replace(parameters, **{branch: value}) for value in sorted(values)]
    return effort_of(description, scene, [walked([_program(description, r) for r in runs])])


def _view(description: Description, parameters: Any) -> View:
    return view_of(_tables(description, parameters))


def _places(description: Description, parameters: Any) -> NamedPlaces:
    return places_of(_tables(description, parameters))


def _output(description: Description, word: str, run: FinishedRun) -> Values:
    return output_of(_tables(description, run.parameters), word)(run)


def _at_places(description: Description, run: FinishedRun) -> Values:
    program, cycles = _program(description, run.parameters), len(run.outcome.cycles)
    times = [0.0, *(each.time for each in program.targets if each.cycle <= cycles)]
    return at_named_places(run, _places(description, run.parameters), times)


@dataclass(frozen=True, slots=True)
class _Assessed:
    """The output of the table ``fatigue``."""

    description: Description

    def fits(self, parameters: Any, view: Callable[[], View]) -> None:
        """See `solver.results.fatigue.Fatigue`."""
        self._made(parameters, view()).fits(parameters, view)

    def before(self, parameters: Any, system: Any, view: View) -> None:
        """See `solver.results.fatigue.Fatigue`."""
        self._made(parameters, view).before(parameters, system, view)

    def __call__(self, run: FinishedRun) -> Values:
        made = self._made(run.parameters, run.view)
        return made(run, _places(self.description, run.parameters).lines)

    def _made(self, parameters: Any, view: View) -> Any:
        table = _tables(self.description, parameters).fatigue
        assert table is not None
        return fatigue_of(table, view)


def _over_cycles(run: FinishedRun) -> Values:
    laws = [run.system.full(name).body.material for name in run.system.names]
    return over_cycles(run.outcome.cycles, laws)


def _until(description: Description, parameters: Any) -> bool:
    repeat = _tables(description, parameters).repeat
    return repeat is not None and repeat.until is not None


def _watch(
    description: Description, parameters: Any, samples: Samples, converged: Converged
) -> Any:
    from solver.results.increments import observe  # loads scipy

    system: Any = samples.system
    watched = {
        quantity: value
        for each in _outputs(description, parameters)
        if (watch := getattr(each, "watch", None))
        for quantity, value in watch(system, converged).items()
    }
    return replace(observe(system, converged), watched=watched)


def _warnings(description: Description, run: FinishedRun) -> tuple[str, ...]:
    each = [getattr(output, "warnings", None) for output in _outputs(description, run.parameters)]
    return tuple(text for warnings in each if warnings for text in warnings(run))


def _outputs(description: Description, parameters: Any) -> list[Output]:
    scene = _tables(description, parameters)
    return [output_of(scene, word) for word in scene.results.words]


# -- parameters ----------------------------------------------------------------------------------


def _tables(description: Description, parameters: Any) -> tables.SceneFile:
    return _tables_of(description, tuple(_values(parameters).items()))


@lru_cache(maxsize=64)
def _tables_of(description: Description, values: tuple[tuple[str, Any], ...]) -> tables.SceneFile:
    return description.tables(dict(values))


def _values(parameters: Any) -> dict[str, Any]:
    return {item.name: getattr(parameters, item.name) for item in fields(parameters)}


def _branch(description: Description) -> str:
    """Return the parameter that is the load factor or the number of cycles, or an empty text.

    No other entry uses it, except parameters of outputs, which are computed for each run.
    """
    loading = description.content.get("loading", {})
    results = description.content.get("results", {})
    places = {key: each for key, each in results.items() if key not in outputs()}
    for entry in ("factor", "cycles"):
        name = str(loading.get(entry)).removeprefix("$")
        if loading.get(entry) != f"${name}" or name not in description.parameters:
            continue
        rest = {**description.content, "loading": {**loading, entry: 1}, "results": places}
        if name not in Description(description.file, rest, description.meshes).used():
            return name
    return ""


def _parameters(description: Description, scene: tables.SceneFile) -> type[Any]:
    """Return the class of the scene's parameters, a dataclass that checks itself when built."""
    declared, levels = scene.declared, scene.accuracy
    usual: dict[str, dict[str, Any]] = {}
    if levels:
        for level in get_args(Accuracy):
            numbers = levels.level(level).items()
            usual[level] = {name: type(_default(declared[name]))(each) for name, each in numbers}

    def checked(self: Any) -> None:
        check(self)
        for name, number in usual[self.accuracy].items() if usual else ():
            if getattr(self, name) is None:
                object.__setattr__(self, name, number)
        try:
            found = _tables(description, self)
            mistakes = [
                *failed_checks(found, _values(self)),
                *contradictions(found, None),
                *unmet_needs(found),
            ]
            if not mistakes:
                mistakes = [
                    *_wrong_laws(description, found),
                    *too_large(found),
                    *too_long(description, found),
                ]
        except SceneError as error:
            mistakes = list(error.mistakes)
        for first in mistakes[:1]:
            raise ModelError(first.field, first.value, first.allowed)

    def reduced(self: Any) -> tuple[Any, ...]:
        return _rebuilt, (description, _values(self))

    own: dict[str, tuple[Any, Any]] = {
        name: (
            _annotated_type(each),
            by_accuracy(each.description, needs=each.needed)
            if levels and name in levels.standard
            else described(_default(each), each.description, needs=each.needed),
        )
        for name, each in declared.items()
    }
    needs = {name: each for p in ContactParameters.PARTS for name, each in p.needs().items()}
    opened = {
        name: (hint, described(item.default, item.metadata["description"], needs=needs.get(name)))
        for name, (hint, item) in description.opened.items()
    }
    first = [name for name in (ACCURACY,) if name in own]
    usual_order = [
        n for entries in tables.OPEN.values() for n in entries if n in opened or n in own
    ]
    names = dict.fromkeys([*first, *(usual_order if opened else ()), *own])
    return make_dataclass(
        "Parameters",
        [(name, *(own.get(name) or opened[name])) for name in names],
        frozen=True,
        kw_only=True,
        namespace={
            "__post_init__": checked,
            "__reduce__": reduced,
            "__module__": __name__,
        },
    )


def _wrong_laws(description: Description, scene: tables.SceneFile) -> Iterator[StudyError]:
    """Yield the mistakes in material and friction laws, by parameter or else by entry."""
    made: dict[str, Callable[[], Any]] = {
        f"materials.{name}": partial(law_of, table) for name, table in scene.materials.items()
    }
    made |= {f"contacts[{k}]": partial(friction_of, t) for k, t in enumerate(scene.contacts)}
    for where, make in made.items():
        try:
            make()
        except ModelError as error:
            field = description.parameter_of(f"{where}.{error.field}")
            yield StudyError(field, error.value, error.allowed)


def _rebuilt(description: Description, values: Mapping[str, Any]) -> Any:
    """Return the parameters that another process pickled."""
    return file_scene(description).parameters(**values)


def _default(declared: tables.ParameterTable) -> Any:
    """Return the default of a parameter, as a float if it is an integer with a unit."""
    default = declared.default
    if isinstance(default, int) and not isinstance(default, bool) and declared.unit != "1":
        return float(default)
    return default


def _annotated_type(declared: tables.ParameterTable) -> Any:
    """Return the annotated type of a parameter."""
    default = _default(declared)
    if isinstance(default, bool):
        return bool
    if isinstance(default, str):
        return Literal[declared.choices or (default,)]
    marks: list[Any] = [Unit(declared.unit)]
    if declared.range is not None:
        low, high = declared.range
        marks.append(Interval(ge=low, le=high))
    kind = int if isinstance(default, int) else float
    return Annotated[(kind, *marks)]
