"""A study: one scene, some fixed parameters, some swept ones; checked before anything runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
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
from studies.definition.fit import Fit, checked_fit
from studies.definition.goal import Goal, checked_goal
from studies.definition.identity import content_id
from studies.definition.labels import checked_labels
from studies.definition.parameters import build, parameters_of
from studies.definition.points import ENTRIES, POINT, SCHEMAS, Points, with_points
from studies.definition.refine import Refine, checked_refine
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
from studies.scenes.names import in_use
from studies.scenes.registry import Find, beside, name_of, nothing, scene_named

Kept = Callable[[str], Mapping[str, Any] | None]
"""Returns the content of a study that is known by its name or its id; None if there is none."""


def _none(name: str) -> None:
    """Know no study."""
    return


def _described(schema: dict[str, Any]) -> None:
    """Add entries that are not kept to the JSON Schema of a study."""
    schema["properties"] |= SCHEMAS | {EXTENDS: SCHEMA}


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
    goal : parameter, threshold and bracket of a value that is searched at each place of the axes
        (`studies.definition.goal`); empty if the runs are those of the axes
    refine : numbers by which runs are chosen within the ranges of the axes, and how closely
        (`studies.definition.refine`); empty if the runs are those of the axes
    fit : measured lines, and bounds of the parameters with which runs come closest to them
        (`studies.definition.fit`); empty if the runs are those of the axes
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
    goal: dict[str, Any] = Field(default_factory=dict)
    refine: dict[str, Any] = Field(default_factory=dict)
    fit: dict[str, Any] = Field(default_factory=dict)
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
        if base.asks and not base.goal:
            raise StudyError(EXTENDS, base.name, "chooses its runs itself: extend another study")
        own = content.get("scene", base.scene)
        if own != base.scene and name_of(scene_named(own, scenes)) != base.scene:
            allowed = f"must be that of {base.name}, which is extended, or left out"
            raise StudyError("scene", own, allowed)
        before = Extended(base.name, base.scene, base.parameters, base.sweep, base.goal, base.fixed)
        full: dict[str, Any] = extended(content, before, parameters_of(base.problem))
        return full

    def checked(self) -> Self:
        """Return the study after a check of all its combinations.

        Raises
        ------
        StudyError
            for combinations that the scene refuses, or parameters that change nothing
        """
        if isinstance(self.asks, Fit):
            try:
                Expansion(self.problem, self.parameters | self.asks.first, self.sweep).check()
            except StudyError as error:
                own = {f"parameters.{name}": f"fit.first.{name}" for name in self.asks.free}
                raise error.renamed(lambda field: own.get(field, field)) from None
            return self
        if not isinstance(self.asks, Goal):
            self.expansion.check()
            return self
        ends: Axes = {self.asks.parameter: list(self.asks.between)}
        try:
            Expansion(self.problem, self.parameters, self.sweep | ends).check()
        except StudyError as error:
            own_axis = f"sweep.{self.asks.parameter}"
            raise error.renamed(lambda field: field.replace(own_axis, "goal.between")) from None
        return self

    @model_validator(mode="before")
    @classmethod
    def _check(cls, content: dict[str, Any], info: ValidationInfo) -> dict[str, Any]:
        for key in content:
            if key not in cls.model_fields and key not in ENTRIES:
                raise StudyError(str(key), content[key], one_of(key, [*cls.model_fields, *ENTRIES]))
        context = info.context if info.context is not None else {}
        scene = scene_named(content.get("scene"), context.get("scenes", nothing))
        context["found"] = scene
        known = parameters_of(scene)
        fixed = checked_table("parameters", content.get("parameters", {}), known)
        axes = checked_axes(with_points(content, known), known)
        _check_names(scene, axes)
        over_points = "refine" in content or POINT in axes
        own_points = over_points and scene.places and scene.places(build(scene, {})).points
        if own_points and "refine" in content:
            allowed = "the runs of this scene have a dimension `point`, that of a refinement"
            raise StudyError("refine", content["refine"], allowed)
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
        if "goal" in content:
            goal = checked_goal(content["goal"], scene)
            other = "parameters" if goal.parameter in fixed else owners(axes).get(goal.parameter)
            if other is not None:
                where = "parameters" if goal.parameter in fixed else f"sweep.{other}"
                allowed = f"is what the goal searches: take it out of {where}"
                raise StudyError("goal.parameter", goal.parameter, allowed)
            own["goal"] = goal.content
        if "refine" in content:
            if "goal" in content:
                allowed = "chooses the runs, and so does the goal: keep one"
                raise StudyError("refine", content["refine"], allowed)
            own["refine"] = checked_refine(content["refine"], scene, axes).content
        if "fit" in content:
            if others := own.keys() & {"goal", "refine"}:
                allowed = f"chooses the runs, and so does {next(iter(others))}: keep one"
                raise StudyError("fit", "a table", allowed)
            fit = checked_fit(content["fit"], scene, axes)
            for name in fit.free.keys() & {*fixed, *owners(axes)}:
                where = "parameters" if name in fixed else f"sweep.{owners(axes)[name]}"
                allowed = f"is what the fit searches: take it out of {where}"
                raise StudyError(f"fit.ranges.{name}", content["fit"]["ranges"][name], allowed)
            own["fit"] = fit.content
        return own | labels

    def model_post_init(self, context: Any) -> None:
        """Store the scene that was found."""
        self._problem = context["found"] if context else scene_named(self.scene)

    @property
    def problem(self) -> Scene:
        """The scene that is swept."""
        return self._problem

    @cached_property
    def asks(self) -> Goal | Refine | Fit | None:
        """What chooses the runs by the outcomes of others: goals, a refinement, or a fit."""
        if self.fit:
            return checked_fit(self.fit, self.problem, self.sweep)
        if self.refine:
            return checked_refine(self.refine, self.problem, self.sweep)
        return checked_goal(self.goal, self.problem) if self.goal else None

    @cached_property
    def expansion(self) -> Expansion:
        """The runs, built when they are requested; of a goal the places of the axes.

        Of a refinement they are corners of its cells.
        """
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
        beside = [each for each in (labels, self.goal, self.refine, self.fit) if each]
        return content_id("study", self.name, self.scene, self.fixed, axes, source, *beside)

    @property
    def fixed(self) -> dict[str, Any]:
        """All parameters that are not swept, the scene's defaults included."""
        known = parameters_of(self.problem)
        swept = {
            *owners(self.sweep),
            *([self.asks.parameter] if isinstance(self.asks, Goal) else []),
            *(self.asks.free if isinstance(self.asks, Fit) else ()),
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
        if isinstance(self.asks, Refine | Fit):
            return self.asks.most
        return self.expansion.size * (self.asks.most[1] if self.asks else 1)

    @property
    def counted(self) -> str:
        """What the numbers by status at its end count."""
        return "searches" if self.goal else "fits" if self.fit else "runs"

    def stage(self, ended: int = 0, told: str = "") -> str:
        """Return how far a study that chooses its runs is, as text; empty for others.

        Parameters
        ----------
        ended : number of its programs that have ended, such as the searches of a goal
        told : what the program of a refinement or of a fit tells
        """
        if self.goal:
            return f"{ended} of {self.expansion.size} searches ended"
        return ("ended" if ended else told or f"at most {self.size} runs") if self.asks else ""

    def run_ids(self) -> Iterator[str]:
        """Yield the ids of the runs, in the order of `cases`, without building the cases.

        Those of a study that chooses its runs are not known: there are none.
        """
        return iter(()) if self.asks else self.expansion.run_ids()

    def cases(self) -> Iterator[Case]:
        """Yield the runs of the study, the last axis fastest; none is kept in memory.

        Those of a study with a goal have the default of its parameter: they tell the places. Those
        of a refinement are corners of its cells.
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
        del content["refine"]
        chosen = self.known(content, lambda name: self.problem)
        chosen.__dict__["id"] = self.id
        return chosen

    def to_dict(self) -> dict[str, Any]:
        """Return what `from_dict` reads."""
        return self.model_dump(exclude_defaults=True) | self.model_dump(
            include={"parameters", "sweep"}
        )


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
