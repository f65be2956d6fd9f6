"""Scenes by the names and ids by which callers and studies call them; queries of their runs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import Any

from service.errors import NotFound
from service.schemas import RunFilter, Window
from solver.scenes import Scene
from studies.definition.identity import is_id
from studies.definition.parameters import Parameter, parameters_of, plain
from studies.definition.vocabulary import MISSING, STATUSES
from studies.errors import StudyError, one_of
from studies.scenes.registry import built_in, known_names, scene_named
from studies.storage.store import Store


def scene_of(store: Store, name: str) -> Scene | None:
    """Return a scene by its name, or by the id of a posted one; None if it is not known here.

    A posted one has no meshes.

    Raises
    ------
    StudyError
        if several posted scenes have this name
    """
    if scene := store.scene(store.scene_id(name), whole=False):
        return scene
    return scene_named(name) if name in known_names() else None


def known_scene(store: Store, name: str) -> Scene:
    """Return the same; raise `NotFound` if there is none."""
    scene = scene_of(store, name)
    if scene is None:
        raise NotFound(f"no scene has this name; there are {', '.join(known_names())}")
    return scene


def scene_name(store: Store, known: str) -> str:
    """Return the name of a scene that a study calls by its name or id; empty if it is gone."""
    if not is_id(known):
        return known
    scene = store.scene(known, whole=False)
    return scene.name if scene else ""


OUTCOMES = tuple(status for status in STATUSES if status != MISSING)
"""Statuses that a run in the catalogue may have."""

KEPT = 100
"""Number of posted scenes, the newest, whose parameters a query may use."""

PLAIN = ("scene", "status", *Window.model_fields)
"""Names in a query that are not parameters of scenes."""


def conditions(which: RunFilter, store: Store) -> dict[str, Any]:
    """Return the arguments of `Catalogue.runs` for a query.

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
