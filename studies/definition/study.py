"""A study: one scene, some fixed parameters, some swept ones; checked before anything runs."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property, reduce
from operator import getitem
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    Field,
    GetJsonSchemaHandler,
    PrivateAttr,
    StringConstraints,
)

from solver.late import Late
from solver.scenes import Scene
from studies.definition.cases import Case, LoadingPath
from studies.definition.expansion import Expansion
from studies.definition.extending import EXTENDS, Extended
from studies.definition.files import read_study
from studies.definition.identity import content_id
from studies.definition.parameters import build, parameters_of
from studies.definition.points import ENTRIES, POINT, Points
from studies.definition.sampling import Sample
from studies.definition.schema import Context, Settings, StudyTable, Text, parsed
from studies.definition.sweep import Axes, Sweep, labels, linked_values, owners, run_count
from studies.definition.vocabulary import taken
from studies.errors import Mistakes, SceneError, StudyError
from studies.kinds import KINDS, kind_of
from studies.kinds.kind import Kind, SweepStudy
from studies.scenes.names import in_use
from studies.scenes.registry import Find, beside, name_of, nothing, scene_named

Kept = Callable[[str], Mapping[str, Any] | None]
"""Returns the content of a study that is known by its name or its id; None if there is none."""

_assessed: Callable[[Scene, Any], Scene] = Late("studies.scenes.entries:assessed")
_derived: Callable[[Scene, Any], Scene] = Late("studies.scenes.entries:derived")

Count = Callable[[int, Scene, Any], None]
"""Accepts a number of runs of a scene, which keep what the entry ``keep`` says, or raises."""


def _none(name: str) -> None:
    """Know no study."""
    return


def _any_count(runs: int, scene: Scene, keep: Any) -> None:
    """Accept any number of runs."""


def _printable(text: str) -> str:
    if all(letter.isprintable() or letter in "\n\t" for letter in text):
        return text
    raise StudyError("", text, "must have no control characters")


def _distinct(tags: list[str]) -> list[str]:
    for k, tag in enumerate(tags):
        if tag in tags[:k]:
            raise StudyError(f"[{k}]", tag, "is there already")
    return tags


def _doi(text: str) -> str:
    if text and not re.fullmatch(r"10\.\d{4,9}/[!-~]+", text):
        raise StudyError("", text, "must be a DOI without its address, such as 10.5281/zenodo.123")
    return text


def _named(files: dict[str, str]) -> dict[str, str]:
    for name in files:
        if not re.fullmatch(r"(?!\.{1,2}$)[^/\\\x00-\x1f]{1,200}", name):
            raise StudyError("", name, "must be the name of a file, without its folder")
    return files


Line = Annotated[str, StringConstraints(max_length=1000), AfterValidator(_printable)]
"""A short text, empty if it is not given."""


class Written(StudyTable):
    """Entries of studies that `Study` keeps as others.

    Attributes
    ----------
    points : tables of parameters: the axis ``point`` of the sweep
    sample : points that fill ranges of parameters evenly, instead of these
    extends : name, id or content of a study whose runs are kept; axes and points add to it
    """

    points: list[dict[str, Any]] = Field(min_length=1)
    sample: Sample
    extends: str | dict[str, Any]


class Study(StudyTable):
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
    fatigue : criterion, limits and cycle, by which every run is assessed (see `assessed`)
    derivatives : numbers of every run and parameters by which they are derived (see `derived`)
    licence, cite, doi : of its data: a licence, such as ``CC-BY-4.0`` or its address; how to cite
        them; their DOI, such as ``10.5281/zenodo.123``. They do not count for the id
    files : text of each file that the study was read from, by name, the study file first
    """

    name: Text
    scene: str
    parameters: Settings = Field(default_factory=dict)
    sweep: Sweep = Field(default_factory=dict)
    note: Annotated[str, StringConstraints(max_length=4000), AfterValidator(_printable)] = ""
    tags: Annotated[list[Text], Field(max_length=20), AfterValidator(_distinct)] = Field(
        default_factory=list
    )
    keep: Literal["", "fields"] = ""
    allow: Annotated[list[Literal["large_strain"]], Field(max_length=1)] = Field(
        default_factory=list
    )
    fatigue: dict[str, Any] | None = None
    derivatives: dict[str, Any] | None = None
    licence: Line = ""
    cite: Line = ""
    doi: Annotated[str, StringConstraints(max_length=200), AfterValidator(_doi)] = ""
    files: Annotated[dict[str, str], Field(max_length=50), AfterValidator(_named)] = Field(
        default_factory=dict
    )
    _problem: Scene = PrivateAttr()
    _kind: Kind = PrivateAttr()

    @classmethod
    def __get_pydantic_json_schema__(cls, core: Any, handler: GetJsonSchemaHandler) -> Any:
        """Describe the entries of kinds too, and those that are kept as others."""
        found = handler.resolve_ref_schema(whole := handler(core))
        others = handler.resolve_ref_schema(handler(Written.__pydantic_core_schema__))
        of_kinds = {name: handler(kind.__pydantic_core_schema__) for name, kind in KINDS.items()}
        found["properties"] |= others["properties"] | of_kinds
        found["required"].remove("scene")
        found |= {"if": {"required": ["extends"]}, "else": {"required": ["scene"]}}
        return whole

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
        cls,
        content: Mapping[str, Any],
        scenes: Find = nothing,
        studies: Kept = _none,
        count: Count = _any_count,
    ) -> Self:
        """Return the study without checking its combinations; the rest is checked.

        Use it for content that `from_dict` has accepted before, and to get the size of a study
        before `checked`. ``count`` can refuse it before the values of its axes are read.
        """
        if not isinstance(content, Mapping):
            raise StudyError("study", content, "must be a table with name, scene and sweep")
        if EXTENDS in content:
            content = cls._extended(content, scenes, studies, count)
        runs = run_count(content)
        given, wrong, context = {**content}, Mistakes(), Context(None)
        try:
            context.found = scene_named(given.get("scene"), scenes)
            if "fatigue" in given:
                context.found = _assessed(context.found, given["fatigue"])
            if "derivatives" in given:
                context.found = _derived(context.found, given["derivatives"])
            given["scene"] = name_of(context.found)
        except SceneError:
            raise
        except StudyError as error:
            wrong.add("", error)
            given["scene"] = ""
        if context.found is not None and kind_of(given).everywhere:  # else its axes are no runs
            count(runs, context.found, given.get("keep", ""))
        entries = {name: given.pop(name) for name in KINDS if name in given}
        of_points = {entry: given.pop(entry) for entry in ENTRIES if entry in given}
        context.varied = frozenset(_words([given.get("sweep"), of_points, entries]))
        with wrong.at():
            given["sweep"] = _with_points(given.get("sweep", {}), of_points, context)
        lacks, study = wrong.failed, None
        with wrong.at():
            try:
                study = parsed(cls, given, context)
            except StudyError as error:
                own = "points" if "points" in of_points else f"sweep.{POINT}"
                raise error.renamed(lambda field: _POINT.sub(own, field)) from None
        if lacks:
            context.swept = None
        kind: Kind = SweepStudy()
        for name, entry in list(entries.items())[:1]:
            with wrong.at(name):
                kind = KINDS[name].read(entry, context.found, context.swept)
        for other in list(entries)[1:]:
            allowed = f"chooses the runs, and so does the {next(iter(entries))}: keep one"
            wrong.add("", StudyError(other, entries[other], allowed))
        wrong.report()
        assert study is not None and context.found is not None
        study._problem, study._kind = context.found, kind
        study._check_together(wrong)
        wrong.report()
        if context.found.allow:
            return study.model_copy(update={"allow": [*context.found.allow]})
        return study

    def _check_together(self, wrong: Mistakes) -> None:
        """Find the entries that do not go together."""
        scene, kind, swept = self.problem, self.kind, owners(self.sweep)

        def add(field: str, value: Any, allowed: str) -> None:
            wrong.add("", StudyError(field, value, allowed))

        _check_names(scene, self.sweep, kind, add)
        chosen = kind.chooses and kind.of_runs
        points = chosen or POINT in self.sweep
        if points and scene.places is not None and scene.places(build(scene, {})).points:
            allowed = "the runs of this scene have a dimension `point`, that of "
            if chosen:
                add(kind.name, kind.content, f"{allowed}the runs chosen")
            else:
                allowed += "the scene file: give the points of the study another one, [sweep.NAME]"
                add(f"sweep.{POINT}", f"{len(self.sweep[POINT])} points", allowed)
        for parameter, axis in swept.items():
            if parameter in self.parameters:
                allowed = "the points" if axis == POINT else f"sweep.{axis}"
                allowed = f"is swept too, by {allowed}: keep one"
                add(f"parameters.{parameter}", self.parameters[parameter], allowed)
        for name, field in kind.searched(kind.content).items():
            if name in self.parameters or name in swept:
                where = "parameters" if name in self.parameters else f"sweep.{swept[name]}"
                allowed = f"is what the {kind.name} searches: take it out of {where}"
                value: Any = reduce(getitem, field.split(".")[1:], kind.content)
                add(field, value, allowed)

    @classmethod
    def _extended(
        cls, content: Mapping[str, Any], scenes: Find, studies: Kept, count: Count
    ) -> dict[str, Any]:
        """Return the content of a study that extends another one, in full."""
        named = content[EXTENDS]
        theirs = studies(named) if isinstance(named, str) else named
        if not isinstance(theirs, Mapping):
            allowed = "must be a study file, or name or id of a study of the output directory"
            raise StudyError(EXTENDS, named, allowed)
        base = cls.known(theirs, scenes, studies, count)
        if not base.kind.everywhere:
            raise StudyError(EXTENDS, base.name, "chooses its runs itself: extend another study")
        own, wrong, more = content.get("scene", base.scene), Mistakes(), {}
        if own != base.scene and name_of(scene_named(own, scenes)) != base.scene:
            allowed = f"must be that of {base.name}, which is extended, or left out"
            wrong.add("", StudyError("scene", own, allowed))
        if parameters := content.get("parameters"):
            allowed = "cannot be changed when a study is extended: add values under sweep"
            wrong.add("", StudyError("parameters", parameters, allowed))
        adds = ("sweep", *ENTRIES)
        added = {key: content[key] for key in adds if key in content}
        if wrong.failed:  # else they are found in the whole study
            beside = ("name", "note", "tags", "keep", "allow")
            added |= {key: content[key] for key in beside if key in content}
        with wrong.at():
            whole = {"name": base.name, **added, "scene": base.scene}
            more = cls.known(whole, scenes, count=count).sweep
        wrong.report()
        axes = Extended(base.name, base.sweep, base.fixed).with_axes(more)
        rest = {key: each for key, each in content.items() if key not in (EXTENDS, *adds)}
        fixed = {key: value for key, value in base.parameters.items() if key not in owners(axes)}
        own = {"scene": base.scene, "parameters": fixed, "sweep": axes}
        kept = {"fatigue": base.fatigue, "derivatives": base.derivatives}
        own |= {key: table for key, table in kept.items() if table}
        return {**base.choice, **rest, **own}

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

    @property
    def problem(self) -> Scene:
        """The scene that is swept."""
        return self._problem

    @property
    def kind(self) -> Kind:
        """What kind of study it is, with what chooses its runs."""
        return self._kind

    @property
    def choice(self) -> dict[str, dict[str, Any]]:
        """The entry of its kind, by the name of the kind; empty for a plain sweep."""
        return {self.kind.name: self.kind.content} if self.kind.chooses else {}

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
        own = self.model_dump(include={"note", "tags", "keep", "allow"})
        labels = {name: each for name, each in own.items() if each}
        beside = [each for each in (labels, *self.choice.values()) if each]
        return content_id("study", self.name, self.scene, self.fixed, axes, source, *beside)

    @property
    def fixed(self) -> dict[str, Any]:
        """All parameters that are not swept, the scene's defaults included."""
        known = parameters_of(self.problem)
        swept = {*owners(self.sweep), *self.kind.searched(self.kind.content)}
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

    @property
    def usual_runs(self) -> int:
        """Number of runs; of a study that chooses them the expected one."""
        return self.kind.usual_runs(self.expansion.size)

    def stage(self, ended: int = 0, told: str = "") -> str:
        """Return how far a study that chooses its runs is, as text; empty for others."""
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
        """Return this study with other runs under its id and texts: those that it has chosen."""
        content = self.to_dict() | {"sweep": {POINT: points}}
        del content[self.kind.name]
        chosen = self.known(content, lambda name: self.problem)
        chosen.__dict__ |= {"id": self.id, "texts": self.texts}
        return chosen

    @cached_property
    def texts(self) -> dict[str, str]:
        """Texts of its files by name; of a study that was not read from one its entries as JSON."""
        return self.files or {"study.json": json.dumps(self.to_dict(), indent=2)}

    @property
    def published(self) -> dict[str, Any]:
        """The entries that the data set holds, and that do not count for the id."""
        return self.model_dump(include={"licence", "cite", "doi", "files"})

    def to_dict(self, files: bool = False) -> dict[str, Any]:
        """Return what `from_dict` reads.

        The texts of the ``files`` are left out, as they would not be those of a study that is made
        of the entries with others: ``study.to_dict() | {"sweep": ...}``.
        """
        whole = self.model_dump(include={"parameters", "sweep"})
        left_out = None if files else {"files"}
        return self.model_dump(exclude_defaults=True, exclude=left_out) | whole | self.choice


def _words(tree: Any) -> Iterator[str]:
    """Yield the names and words of a part of a study; a name has no unit."""
    if isinstance(tree, str):
        yield tree.partition("[")[0].strip()
    elif isinstance(tree, Mapping):
        for key, each in tree.items():
            yield from _words(key)
            yield from _words(each)
    elif isinstance(tree, list | tuple):
        for each in tree:
            yield from _words(each)


_POINT = re.compile(rf"^sweep\.{POINT}(?=$|[.[])")
"""The axis of the entries `ENTRIES`, in the name of a field."""


def _with_points(sweep: Any, given: Mapping[str, Any], context: Context) -> Any:
    """Return the sweep of a study, in which ``points`` or ``sample`` is an axis."""
    if not given or not isinstance(sweep, Mapping):
        return sweep
    (entry, points), *others = given.items()
    if others or POINT in sweep:
        other, value = others[0] if others else (f"sweep.{POINT}", sweep[POINT])
        allowed = f"{entry} is given too: keep one, or give one a name, [sweep.NAME]"
        raise StudyError(other, value, allowed)
    if entry == "sample":
        try:
            points = parsed(Sample, points, context).points
        except StudyError as error:
            raise error.under(entry) from None
    elif isinstance(points, Mapping) and "file" not in points:
        allowed = "must be a list of points; a sample is [sample], labels are [sweep.NAME]"
        raise StudyError(entry, dict(points), allowed)
    return {POINT: points, **sweep}


def _check_names(
    scene: Scene, axes: Axes, kind: Kind, add: Callable[[str, Any, str], None]
) -> None:
    """Refuse a parameter, a number or an axis if data sets have its name for something else."""
    known, numbers = parameters_of(scene), {each.name for each in scene.quantities}
    if kind.chooses and (state := kind.ends[0]) in {*known, *numbers, *axes}:
        add(kind.name, state, "the data set has a variable of this name: rename that of the scene")
    ours = scene.parameters.__module__.startswith("solver.")  # a test checks their names
    for name in known if not ours else ():
        if in_use(name, {*known, *numbers}):
            allowed = f"has a parameter {name}: data sets have something else of this name"
            add("scene", name_of(scene), allowed)
    for axis in numbers & axes.keys():
        allowed = "the data set has a variable of this name: give the axis another one"
        add(f"sweep.{axis}", f"{len(axes[axis])} values", allowed)
