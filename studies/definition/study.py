"""A study: one scene, some fixed parameters, some swept ones; checked before anything runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property, reduce
from operator import getitem
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    PrivateAttr,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from solver.scenes import Scene
from studies.definition.cases import Case, LoadingPath
from studies.definition.expansion import Expansion
from studies.definition.extending import EXTENDS, SCHEMA, Extended, extended
from studies.definition.files import read_study
from studies.definition.identity import content_id
from studies.definition.labels import checked_labels
from studies.definition.parameters import build, parameters_of
from studies.definition.points import ENTRIES, POINT, SCHEMAS, Points, with_points
from studies.definition.sweep import (
    Axes,
    checked_axes,
    checked_table,
    checked_text,
    labels,
    linked_values,
    owners,
    run_count,
)
from studies.definition.vocabulary import taken
from studies.errors import StudyError, one_of
from studies.kinds import DESCRIBED, KINDS
from studies.kinds.kind import Kind
from studies.kinds.sweep import SweepStudy
from studies.scenes.names import in_use
from studies.scenes.registry import Find, beside, name_of, nothing, scene_named

Kept = Callable[[str], Mapping[str, Any] | None]
"""Returns the content of a study that is known by its name or its id; None if there is none."""


def _none(name: str) -> None:
    """Know no study."""
    return


def _described(schema: dict[str, Any]) -> None:
    """Add entries that are not kept to the JSON Schema of a study."""
    schema["properties"].pop("choice", None)
    schema["properties"] |= DESCRIBED | SCHEMAS | {EXTENDS: SCHEMA}


class Study(BaseModel):
    """One scene swept over some of its parameters.

    Build it with `from_toml` or `from_dict`, which raise `StudyError` for bad input.

    Attributes
    ----------
    name : 1 to 80 of ``A-Z a-z 0-9 . _ -``, not beginning with a dot
    scene : name of the scene; of a scene from a file its content id
    parameters : fixed parameters; the rest are the scene's defaults
    sweep : axes: lists of values by parameter; and axes with names of their own, which set several
        parameters: tables of labels, and lists of points, such as ``point``, which has what the
        entries ``points`` and ``sample`` of a study say. See `checked_axes` for their order
    note, tags : the user's own text and labels, shown with the study; a tag finds studies
    keep : ``fields`` keeps the fields at all nodes in the file of each run
    allow : ``large_strain`` makes runs outside small-strain theory count as ok (see `taken`); it
        includes what the scene allows
    choice : the entry of a kind of `KINDS`, by the name of the kind; empty for a plain sweep
    """

    model_config = ConfigDict(frozen=True, extra="forbid", json_schema_extra=_described)

    name: str
    scene: str
    parameters: dict[str, Any] = Field(default_factory=dict)
    sweep: Axes = Field(default_factory=dict)
    note: str = ""
    tags: list[str] = Field(default_factory=list)
    keep: Literal["", "fields"] = ""
    allow: list[Literal["large_strain"]] = Field(default_factory=list)
    choice: dict[str, dict[str, Any]] = Field(default_factory=dict, exclude=True)
    _problem: Scene = PrivateAttr()

    @classmethod
    def from_toml(
        cls,
        path: Path | str,
        measured: Sequence[Path] = (),
        studies: Kept = _none,
        scenes: Find = nothing,
    ) -> Self:
        """Read a study file; the scene may be a file beside it: ``scene = "pin.toml"``.

        So may be the points of a curve: ``wheel_profile = "worn.csv"``; and the study that it
        extends: ``extends = "before.toml"``.

        Parameters
        ----------
        path : the file
        measured : files of the lines of its fit
        studies, scenes : find what the file names that is no file, such as a study of a store
        """
        content, files = read_study(path, measured), beside(Path(path).parent)
        return cls.from_dict(
            content, scenes=lambda name: files(name) or scenes(name), studies=studies
        )

    @classmethod
    def from_dict(
        cls,
        content: Mapping[str, Any],
        scene: Scene | None = None,
        scenes: Find = nothing,
        studies: Kept = _none,
    ) -> Self:
        """Check and normalise the content of a study file (or of its JSON equivalent).

        All combinations of the sweep are checked once; none is kept in memory.

        Parameters
        ----------
        content : name, scene, parameters and sweep
        scene : the user's own scene, in place of the name of a scene
        scenes : finds scenes that are neither built in nor installed
        studies : finds the study that this one extends, such as `Store.definition`
        """
        if scene is not None:
            own = scene
            content, scenes = {**content, "scene": name_of(own)}, lambda name: own
        return cls.known(content, scenes, studies).checked()

    @classmethod
    def known(
        cls, content: Mapping[str, Any], scenes: Find = nothing, studies: Kept = _none
    ) -> Self:
        """Return the study without checking its combinations; the rest is checked.

        Use it for content that `from_dict` has accepted before, and to get the size of a study
        before `checked`.
        """
        if not isinstance(content, Mapping):
            raise StudyError("study", content, "must be a table with name, scene and sweep")
        if EXTENDS in content:
            content = cls._extended(content, scenes, studies)
        run_count(content)
        try:
            return cls.model_validate(dict(content), context={"scenes": scenes})
        except ValidationError as error:
            first = error.errors()[0]
            cause = first.get("ctx", {}).get("error")
            if isinstance(cause, StudyError):
                raise cause from None
            field = ".".join(str(part) for part in first["loc"])
            raise StudyError(field, first["input"], first["msg"]) from None

    @classmethod
    def _extended(cls, content: Mapping[str, Any], scenes: Find, studies: Kept) -> dict[str, Any]:
        """Return the content of a study that extends another one, in full."""
        named = content[EXTENDS]
        theirs = studies(named) if isinstance(named, str) else named
        if not isinstance(theirs, Mapping):
            allowed = "must be a study file, or name or id of a study of the output directory"
            raise StudyError(EXTENDS, named, allowed)
        base = cls.known(theirs, scenes, studies)
        if not base.kind.everywhere:
            raise StudyError(EXTENDS, base.name, "chooses its runs itself: extend another study")
        own = content.get("scene", base.scene)
        if own != base.scene and name_of(scene_named(own, scenes)) != base.scene:
            allowed = f"must be that of {base.name}, which is extended, or left out"
            raise StudyError("scene", own, allowed)
        before = Extended(
            base.name, base.scene, base.parameters, base.sweep, base.choice, base.fixed
        )
        full: dict[str, Any] = extended(content, before, parameters_of(base.problem))
        return full

    def checked(self) -> Self:
        """Return the study after a check of all its combinations.

        Raises
        ------
        StudyError
            for combinations that the scene refuses, or parameters that change nothing
        """
        fixed, axes, fields = self.kind.trial
        runs = self.expansion
        if fixed or axes:
            runs = Expansion(self.problem, {**self.parameters, **fixed}, self.sweep | axes)
        try:
            runs.check()
        except StudyError as error:

            def told(field: str) -> str:
                head, bracket, rest = field.partition("[")
                return fields.get(head, head) + bracket + rest

            raise error.renamed(told) from None
        return self

    @model_validator(mode="before")
    @classmethod
    def _check(cls, content: dict[str, Any], info: ValidationInfo) -> dict[str, Any]:
        known_entries = [*cls.model_fields.keys() - {"choice"}, *KINDS, *ENTRIES]
        for key in content:
            if key not in known_entries:
                raise StudyError(str(key), content[key], one_of(key, known_entries))
        context = info.context if info.context is not None else {}
        scene = scene_named(content.get("scene"), context.get("scenes", nothing))
        context["found"] = scene
        known = parameters_of(scene)
        fixed = checked_table("parameters", content.get("parameters", {}), known)
        axes = checked_axes(with_points(content, known), known)
        _check_names(scene, axes)
        kinds = [kind for name, kind in KINDS.items() if name in content]
        of_runs = [kind.name for kind in kinds if kind.of_runs]
        own_points = (
            (of_runs or POINT in axes)
            and scene.places is not None
            and scene.places(build(scene, {})).points
        )
        if own_points and of_runs:
            allowed = "the runs of this scene have a dimension `point`, that of the runs chosen"
            raise StudyError(of_runs[0], content[of_runs[0]], allowed)
        if own_points:
            allowed = (
                "the runs of this scene have a dimension of this name, the points of the scene "
                "file: give the points of the study another one, [sweep.NAME]"
            )
            raise StudyError(f"sweep.{POINT}", f"{len(axes[POINT])} points", allowed)
        for parameter, axis in owners(axes).items():
            if parameter in fixed:
                by = "the points" if axis == POINT else f"sweep.{axis}"
                allowed = f"is swept too, by {by}: keep one"
                raise StudyError(f"parameters.{parameter}", fixed[parameter], allowed)
        name = checked_text("name", content.get("name"))
        parameters = {
            key: known[key].normalise(value, f"parameters.{key}") for key, value in fixed.items()
        }
        labels = checked_labels(content) | ({"allow": [*scene.allow]} if scene.allow else {})
        own = {"name": name, "scene": name_of(scene), "parameters": parameters, "sweep": axes}
        if kinds:
            kind, *others = kinds
            found = kind.read(content[kind.name], scene, axes)
            own["choice"] = {kind.name: found.content}
            for name, field in kind.searched(found.content).items():
                if name in fixed or name in owners(axes):
                    where = "parameters" if name in fixed else f"sweep.{owners(axes)[name]}"
                    allowed = f"is what the {kind.name} searches: take it out of {where}"
                    given = {**found.content, **content[kind.name]}
                    value = reduce(getitem, field.split(".")[1:], given)
                    raise StudyError(field, value, allowed)
            for other in others:
                allowed = f"chooses the runs, and so does the {kind.name}: keep one"
                raise StudyError(other.name, content[other.name], allowed)
            context["kind"] = found
        return own | labels

    def model_post_init(self, context: Any) -> None:
        """Store the scene that was found."""
        self._problem = context["found"] if context else scene_named(self.scene)
        if context and "kind" in context:
            self.__dict__["kind"] = context["kind"]

    @property
    def problem(self) -> Scene:
        """The scene that is swept."""
        return self._problem

    @cached_property
    def kind(self) -> Kind:
        """What kind of study it is, with what chooses its runs."""
        for name, content in self.choice.items():
            return KINDS[name].read(content, self.problem, self.sweep)
        return SweepStudy()

    @cached_property
    def expansion(self) -> Expansion:
        """The runs, built when they are requested; if it chooses them, the places of the axes."""
        return Expansion(self.problem, self.parameters, self.sweep)

    @cached_property
    def id(self) -> str:
        """Content id of the study.

        The name counts, because it is the title of the data set: a copy with another name is
        another data set, although the two share every run. ``note``, ``tags``, ``keep`` and
        ``allow`` count if they are given. The order of values and labels counts.
        """
        axes = {
            name: list(axis.items()) if isinstance(axis, dict) else axis
            for name, axis in self.sweep.items()
        }
        source = self.expansion.source
        labels = checked_labels(self.model_dump(include={"note", "tags", "keep", "allow"}))
        beside = [each for each in (labels, *self.choice.values()) if each]
        return content_id("study", self.name, self.scene, self.fixed, axes, source, *beside)

    @property
    def fixed(self) -> dict[str, Any]:
        """All parameters that are not swept, the scene's defaults included."""
        known = parameters_of(self.problem)
        swept = {
            *owners(self.sweep),
            *self.kind.searched(self.choice.get(self.kind.name, {})),
        }
        defaults = {name: p.default for name, p in known.items() if name not in swept}
        return defaults | self.parameters

    @cached_property
    def axes(self) -> dict[str, list[Any]]:
        """Values on each axis, labels or numbers of points, in the order of `Case.index`."""
        return {name: labels(name, axis) for name, axis in self.sweep.items()}

    @property
    def linked(self) -> dict[str, tuple[str, list[Any]]]:
        """Parameter set by a linked axis or by points -> the axis, and the values over it."""
        return linked_values(self.sweep)

    @property
    def size(self) -> int:
        """Number of runs; of a study that chooses them the largest possible one."""
        return self.kind.most_runs(self.expansion.size)

    def stage(self, ended: int = 0, told: str = "") -> str:
        """Return how far a study that chooses its runs is, as text; empty for others.

        Parameters
        ----------
        ended : number of its programs that have ended
        told : what its program tells, if it has one
        """
        return self.kind.stage(self.expansion.size, ended, told)

    def run_ids(self) -> Iterator[str]:
        """Yield the ids of the runs, in the order of `cases`, without building the cases.

        Those of a study that chooses its runs are not known: there are none.
        """
        return iter(()) if self.kind.chooses else self.expansion.run_ids()

    def cases(self) -> Iterator[Case]:
        """Yield the runs of the study, the last axis fastest; none is kept in memory.

        Of a study that chooses its runs they are the places of its axes, with the defaults of the
        parameters that it searches.
        """
        return self.expansion.cases()

    def place(self, case: Case) -> dict[str, Any]:
        """Return the value, or the label, of a run of the study on each axis."""
        pairs = zip(self.axes.items(), case.index, strict=True)
        return {name: values[position] for (name, values), position in pairs}

    def taken(self, status: str) -> str:
        """Return the status of a run in this study: ok if the study allows large strain."""
        return taken(status, self.allow)

    def paths(self) -> Iterator[LoadingPath]:
        """Yield the loading paths of the study: the cases that one task computes together."""
        return self.expansion.paths()

    def with_points(self, points: Points) -> Self:
        """Return this study with other runs under its id: those that it has chosen."""
        content = self.to_dict() | {"sweep": {POINT: points}}
        del content[self.kind.name]
        chosen = self.known(content, lambda name: self.problem)
        chosen.__dict__["id"] = self.id
        return chosen

    def to_dict(self) -> dict[str, Any]:
        """Return what `from_dict` reads."""
        whole = self.model_dump(include={"parameters", "sweep"})
        return self.model_dump(exclude_defaults=True) | whole | self.choice


def _check_names(scene: Scene, axes: Axes) -> None:
    """Refuse a parameter or an axis of labels if data sets have its name for something else."""
    known, numbers = parameters_of(scene), {each.name for each in scene.quantities}
    ours = scene.parameters.__module__.startswith("solver.")  # a test checks their names
    for name in known if not ours else ():
        if in_use(name, {*known, *numbers}):
            allowed = f"has a parameter {name}: data sets have something else of this name"
            raise StudyError("scene", name_of(scene), allowed)
    for axis in numbers & axes.keys():
        allowed = "the data set has a variable of this name: give the axis another one"
        raise StudyError(f"sweep.{axis}", f"{len(axes[axis])} values", allowed)
