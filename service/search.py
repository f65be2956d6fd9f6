"""Check of a query of runs against the parameters of the scenes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from service.schemas import RunFilter, Window
from solver.scenes import Scene
from studies import Store, StudyError
from studies.definition.parameters import Parameter, parameters_of, plain
from studies.definition.vocabulary import MISSING, STATUSES
from studies.errors import one_of
from studies.scenes.registry import built_in, known_names, scene_named

OUTCOMES = tuple(status for status in STATUSES if status != MISSING)
"""Statuses that a run in the catalogue may have."""

KEPT = 100
"""Number of posted scenes, the newest, whose parameters a query may use."""

PLAIN = ("scene", "status", *Window.model_fields)
"""Names in a query that are not parameters of scenes."""


def conditions(which: RunFilter, store: Store) -> dict[str, Any]:
    """Return the arguments of `Catalogue.runs` for a query.

    Parameters
    ----------
    which : the query
    store : the store, which may have posted scenes

    Raises
    ------
    StudyError
        for a scene, a status, a parameter or a value that no run can have
    """
    if which.status not in (None, *OUTCOMES):
        raise StudyError("status", which.status, one_of(which.status, OUTCOMES))
    posted = store.newest_scenes(KEPT)
    scenes: list[Scene] = [*built_in(), *posted]
    if which.scene is not None:
        own = [scene for scene in posted if scene.name == which.scene]
        names = [*known_names(), *(scene.name for scene in posted)]
        if which.scene not in names:
            raise StudyError("scene", which.scene, one_of(which.scene, names))
        scenes = [*own] or [scene_named(which.scene)]
    known: dict[str, list[Parameter]] = {}
    for scene in scenes:
        for name, parameter in parameters_of(scene).items():
            known.setdefault(name, []).append(parameter)
    requested = which.model_dump(exclude_none=True)
    for name in requested.keys() - {*PLAIN}:
        if name not in known:
            raise StudyError(name, requested[name], one_of(name, (*PLAIN, *known)))
        requested[name] = _value(name, requested[name], known[name])
    return requested


def _value(name: str, given: Any, parameters: Sequence[Parameter]) -> Any:
    """Return a value in the type of the first of these parameters that allows it.

    Scenes may have different parameters of one name.
    """
    for parameter in parameters:
        try:
            value = parameter.normalise(plain(given, parameter.default), name)
        except StudyError as error:
            refusal = error
        else:
            if parameter.in_range(value):
                return value
            refusal = parameter.refusal(name, given)
    raise refusal
