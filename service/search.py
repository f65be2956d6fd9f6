"""Check of a query of runs against the parameters of the scenes."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import Any

from service.schemas import RunFilter, Window
from studies.definition.parameters import Parameter, parameters_of, plain
from studies.definition.vocabulary import MISSING, STATUSES
from studies.errors import StudyError, one_of
from studies.scenes.registry import built_in, known_names, scene_named
from studies.storage.store import Store

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
    posted = store.scenes(KEPT, name=which.scene)
    if which.scene is None:
        scenes = built_in()
    elif posted:
        scenes = []
    elif which.scene in known_names():
        scenes = [scene_named(which.scene)]
    else:
        names = [*known_names(), *(each.name for each in store.scenes(KEPT))]
        raise StudyError("scene", which.scene, one_of(which.scene, names))
    requested = which.model_dump(exclude_none=True)
    for name in requested.keys() - {*PLAIN}:
        read = [store.scene(each.id, whole=False) for each in posted if name in each.parameters]
        known = [parameters_of(scene) for scene in (*scenes, *filter(None, read))]
        if not any(name in each for each in known):
            names = [*PLAIN, *chain(*known, *(each.parameters for each in posted))]
            raise StudyError(name, requested[name], one_of(name, names))
        fitting = [each[name] for each in known if name in each]
        requested[name] = _value(name, requested[name], fitting)
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
