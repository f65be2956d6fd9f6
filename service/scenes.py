"""Scenes by the names and ids by which callers and studies call them."""

from __future__ import annotations

from service.errors import NotFound
from solver.scenes import Scene
from studies.definition.identity import is_id
from studies.scenes.registry import known_names, scene_named
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
