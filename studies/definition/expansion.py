"""Iterate over the runs of a sweep; memory holds only the values of each axis, not the runs."""

from __future__ import annotations

import itertools
import math
import reprlib
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple

from solver.errors import ModelError
from solver.parameters import unmet
from solver.scenes import Scene
from studies.definition.cases import Case, LoadingPath
from studies.definition.identity import Namer, Places, written
from studies.definition.parameters import parameters_of
from studies.definition.sweep import Axes, Position, positions
from studies.errors import MOST_MISTAKES, StudyError


class _Setting(NamedTuple):
    """The values that one position of an axis sets, in the order of the names of the axis.

    ``values`` are JSON values, ``typed`` those of the parameter object, and ``entries`` the texts
    from which ids are made.
    """

    values: tuple[Any, ...]
    typed: tuple[Any, ...]
    entries: tuple[str, ...]


class _SweepAxis(NamedTuple):
    """An axis: the parameters it sets, and their places in the content of run and path ids."""

    names: tuple[str, ...]
    run: Places
    path: Places
    settings: list[_Setting]

    def together(self, branch: str) -> list[tuple[int, ...]]:
        """Return groups of positions that share a loading path: they differ only in `branch`."""
        groups: dict[tuple[str, ...], list[int]] = {}
        for position, setting in enumerate(self.settings):
            named = zip(self.names, setting.entries, strict=True)
            others = tuple(entry for name, entry in named if name != branch)
            groups.setdefault(others, []).append(position)
        return [tuple(group) for group in groups.values()]


class Expansion:
    """The runs of a sweep, built one by one when they are requested.

    Parameters
    ----------
    scene : the scene that is swept
    fixed : parameters that are not swept, as JSON values; the rest are the scene's defaults
    axes : as `checked_axes` returns them

    Attributes
    ----------
    source : the sources of the scene, see `written`; read once
    size : number of runs
    """

    def __init__(self, scene: Scene, fixed: Mapping[str, Any], axes: Axes) -> None:
        self._scene, self._fixed, self._axes = scene, fixed, axes
        known = parameters_of(scene)
        self._values = {name: parameter.default for name, parameter in known.items()}
        self._values |= fixed
        self._typed = {name: known[name].typed(value) for name, value in self._values.items()}
        self.source = written(scene)
        shared = {name: value for name, value in self._values.items() if name != scene.branch}
        self._run = Namer("run", scene.name, self._values, self.source)
        self._path = Namer("path", scene.name, shared, self.source)
        self._sets = [self._axis(positions(name, axis)) for name, axis in axes.items()]
        self._together = [axis.together(scene.branch) for axis in self._sets]
        self.size = math.prod(len(axis.settings) for axis in self._sets)

    def check(self) -> None:
        """Build the parameter object of every run: it checks itself.

        Raises
        ------
        StudyError
            if the scene refuses combinations of parameters: of each field the first one; else if
            some that are given have no effect
        """
        given = self._given()
        idle = dict.fromkeys(given, "")
        refused: dict[str, StudyError] = {}
        for index in self._indices():
            try:
                parameters = self._parameters(index)
                for output in self._scene.outputs:
                    if hasattr(output, "fits"):
                        output.fits(parameters, partial(self._scene.view, parameters))
            except ModelError as error:
                if error.field not in refused:
                    refused[error.field] = self.located(error, index)
                if len(refused) == MOST_MISTAKES:
                    break
                continue
            idle = {name: needs for name in idle if (needs := unmet(parameters, name))}
        mistakes = list(refused.values()) or [
            StudyError(*given[name], f"changes nothing in any run of this study: {needs}")
            for name, needs in idle.items()
        ]
        if mistakes:
            first, *others = mistakes[:MOST_MISTAKES]
            raise StudyError(first.field, first.value, first.allowed, others)

    def _given(self) -> dict[str, tuple[str, Any]]:
        """Return the field and the value of each parameter that is given.

        The default is not given, and nor is one zero: it says that something is absent. Of a linked
        axis it is the first value given.
        """
        known = parameters_of(self._scene)
        found: dict[str, tuple[str, Any]] = {}

        def add(name: str, field: str, value: Any, told: Any) -> None:
            if value and value != known[name].default:
                found.setdefault(name, (field, told))

        for name, value in self._fixed.items():
            add(name, f"parameters.{name}", value, value)
        for axis, values in self._axes.items():
            for at in positions(axis, values):
                for name, value in at.sets.items():
                    if axis in known:
                        add(name, f"sweep.{axis}", value, values)
                    else:
                        add(name, f"{at.field}.{name}", value, value)
        return found

    def run_ids(self) -> Iterator[str]:
        """Yield the ids of the runs, the last axis running fastest."""
        return (self._run_id(index) for index in self._indices())

    def cases(self) -> Iterator[Case]:
        """Yield the runs, the last axis running fastest."""
        return map(self._case, self._indices())

    def paths(self) -> Iterator[LoadingPath]:
        """Yield the loading paths, in the order in which `cases` comes upon them."""
        branch = self._scene.branch
        for choice in itertools.product(*self._together):
            indices = list(itertools.product(*choice))
            yield LoadingPath(
                self._path.id_of((axis.path, each.entries) for axis, each in self._at(indices[0])),
                self._parameters(indices[0]),
                tuple(
                    sorted(map(self._case, indices), key=lambda case: case.values.get(branch, 0))
                ),
            )

    def _indices(self) -> Iterator[tuple[int, ...]]:
        return itertools.product(*(range(len(axis.settings)) for axis in self._sets))

    def _at(self, index: tuple[int, ...]) -> list[tuple[_SweepAxis, _Setting]]:
        return [(axis, axis.settings[i]) for axis, i in zip(self._sets, index, strict=True)]

    def _case(self, index: tuple[int, ...]) -> Case:
        values = dict(self._values)
        for axis, setting in self._at(index):
            values.update(zip(axis.names, setting.values, strict=True))
        return Case(self._run_id(index), self._scene, values, index)

    def _run_id(self, index: tuple[int, ...]) -> str:
        return self._run.id_of((axis.run, each.entries) for axis, each in self._at(index))

    def _parameters(self, index: tuple[int, ...]) -> Any:
        values = dict(self._typed)
        for axis, setting in self._at(index):
            values.update(zip(axis.names, setting.typed, strict=True))
        return self._scene.parameters(**values)

    def _axis(self, axis: Iterator[Position]) -> _SweepAxis:
        known = parameters_of(self._scene)
        every = [at.sets for at in axis]
        names = tuple(every[0])
        settings = [
            _Setting(
                tuple(values.values()),
                tuple(known[name].typed(value) for name, value in values.items()),
                tuple(itertools.starmap(Namer.entry, values.items())),
            )
            for values in every
        ]
        return _SweepAxis(names, self._run.places(names), self._path.places(names), settings)

    def located(self, error: ModelError, index: tuple[int, ...]) -> StudyError:
        """Return the error of the scene, with the field name of the study file.

        For a value outside its own range the error gives that range, with its unit. Otherwise it
        names the combination of swept values: another combination may be allowed.
        """
        known = parameters_of(self._scene)
        of_scene = error.field.partition("[")[0].partition(".")[0] in known
        field, at, where = f"parameters.{error.field}" if of_scene else error.field, [], []
        for (name, axis), i in zip(self._axes.items(), index, strict=True):
            position = next(itertools.islice(positions(name, axis), i, None))
            one = position.at
            if name in known:
                at.append(f"{name} = {reprlib.repr(one) if isinstance(one, list) else one}")
            else:
                where.append(f"{name} = {one if position.case is None else position.case}")
            if error.field in position.sets:
                field = position.field if name in known else f"{position.field}.{error.field}"
        parameter = known.get(error.field)
        # of a list the scene tells what in it is wrong
        a_list = isinstance(self._case(index).values.get(error.field), list)
        if parameter is not None and not a_list and not parameter.in_range(error.value):
            allowed = parameter.refusal(field, error.value).allowed
        else:
            allowed = f"{error.allowed} (at {', '.join(at)})" if at else error.allowed
        labels = f", where {', '.join(where)}" if where else ""
        return StudyError(field, error.value, allowed + labels)
