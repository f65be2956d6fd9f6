"""A sweep expanded: cases (one run each) and loading paths (one task each)."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from solver.errors import ModelError
from solver.scenes import Scene
from studies.definition.identity import content_id, written
from studies.definition.parameters import build, parameters_of
from studies.errors import StudyError

USUAL_AXES = ("load_ratio", "friction", "hardening")
"""Parameters that every data set carries as dimensions, of size one where they are not swept."""


@dataclass(frozen=True, slots=True)
class Case:
    """One run: what to compute, under which name, and where it lies in the sweep.

    Attributes
    ----------
    id : content id of the run, the same in every study
    parameters : the scene's parameter object
    values : all parameters by name, as JSON holds them
    index : position on each axis of the study
    """

    id: str
    parameters: Any
    values: Mapping[str, Any]
    index: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class LoadingPath:
    """Cases that the solver computes by walking one loading path.

    They differ in the scene's branch parameter only. One task computes them together.

    Attributes
    ----------
    id : content id of what the cases share
    parameters : the scene's parameter object of the first case
    cases : in increasing order of the branch parameter
    """

    id: str
    parameters: Any
    cases: tuple[Case, ...]


def cases_of(
    scene: Scene, fixed: Mapping[str, Any], axes: Mapping[str, Sequence[Any]]
) -> Iterator[Case]:
    """Yield every point of the sweep, the last axis running fastest.

    Raises
    ------
    StudyError
        when the scene refuses a combination of parameters
    """
    defaults = {name: known.default for name, known in parameters_of(scene).items()}
    positions = [range(len(values)) for values in axes.values()]
    source = written(scene)
    for index in itertools.product(*positions):
        point = {name: values[i] for (name, values), i in zip(axes.items(), index, strict=True)}
        given = {**defaults, **fixed, **point}
        try:
            parameters = build(scene, given)
        except ModelError as error:
            raise _located(scene, error, point, dict(zip(axes, index, strict=True))) from error
        yield Case(content_id("run", scene.name, given, source), parameters, given, index)


def loading_paths(scene: Scene, points: Iterable[Case]) -> list[LoadingPath]:
    """Group `points` that differ in nothing but the branch parameter of the scene."""
    groups: dict[str, list[Case]] = {}
    source = written(scene)
    for case in points:
        shared = {name: value for name, value in case.values.items() if name != scene.branch}
        groups.setdefault(content_id("path", scene.name, shared, source), []).append(case)
    return [
        LoadingPath(
            key, group[0].parameters, tuple(sorted(group, key=lambda c: c.values[scene.branch]))
        )
        for key, group in groups.items()
    ]


def _located(
    scene: Scene,
    error: ModelError,
    point: Mapping[str, Any],
    index: Mapping[str, int],
) -> StudyError:
    """Return what the scene refused, named as the study file names it.

    A value out of its own range is told with that range, and with its unit. Otherwise the values
    of the sweep that come together there are told too, since another combination may do.
    """
    swept = error.field in index
    field = f"sweep.{error.field}[{index[error.field]}]" if swept else f"parameters.{error.field}"
    parameter = parameters_of(scene).get(error.field)
    if parameter is not None and not parameter.in_range(error.value):
        return parameter.refusal(field, error.value)
    at = ", ".join(f"{name} = {value}" for name, value in point.items())
    return StudyError(field, error.value, f"{error.allowed} (at {at})" if at else error.allowed)
