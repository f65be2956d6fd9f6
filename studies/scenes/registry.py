"""Scenes by name: of the package, of installed packages, and of scene files."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from solver.late import Late
from solver.scenes import Scene
from solver.shipped import SCENES
from studies.errors import StudyError, one_of
from studies.scenes.file_scene import FileScene
from studies.scenes.shipped import SHIPPED
from studies.toml import read_toml

GROUP = "residua.scenes"
"""Entry-point group of installed packages: each gives a `Scene`, or the path of a scene file."""

Find = Callable[[str], Scene | None]
"""Returns the scene of a name or content id, or None."""

_Make = Callable[..., FileScene]
_read_scene: _Make = Late("studies.scenes.scene:read_scene")
_shipped_scene: _Make = Late("studies.scenes.scene:shipped_scene")
_stored_scene: _Make = Late("studies.scenes.scene:stored_scene")


def nothing(name: str) -> Scene | None:
    """Find no scene."""
    del name
    return None


def scene_named(name: Any, find: Find = nothing) -> Scene:
    """Return the scene of this name.

    Parameters
    ----------
    name : name of a scene of the package or of an installed package, or one that ``find`` knows
    find : function that finds scenes of files

    Raises
    ------
    StudyError
        with the names that exist
    """
    if isinstance(name, str):
        found = SCENES.get(name) or _shipped(name) or find(name)
        if found is None and (entry := _installed().get(name)):
            found = _loaded(entry)
        if found is not None:
            return found
    raise StudyError("scene", name, one_of(name, known_names()))


def known_names() -> list[str]:
    """Return the names of the scenes of the package and of installed packages."""
    return list(dict.fromkeys((*SCENES, *SHIPPED, *_installed())))


def built_in() -> list[Scene]:
    """Return the scenes of the package."""
    return [scene_named(name) for name in (*SCENES, *SHIPPED)]


def known_scenes() -> Iterator[Scene]:
    """Yield the scenes of the package and of installed packages."""
    return map(scene_named, known_names())


def summaries() -> dict[str, str]:
    """Return the summaries of the known scenes by name; of scene files nothing else is read."""
    own = {name: read_toml(path, "scene") for name, path in SHIPPED.items()}
    return {
        name: own[name]["summary"] if name in own else scene_named(name).summary
        for name in known_names()
    }


def name_of(scene: Scene) -> str:
    """Return the name of a scene in a study: its own, or the content id of one from a file."""
    return scene.id if isinstance(scene, FileScene) and scene.posted else scene.name


def beside(folder: Path) -> Find:
    """Return a function that finds scenes by the names of their files in a folder."""

    def find(name: str) -> Scene | None:
        if not name.endswith(".toml"):
            return None
        return _read_scene(folder / name)

    return find


def attributes(scene: Scene) -> dict[str, str]:
    """Return the attributes of a data set that hold its scene, so that it needs no scene file."""
    if not (isinstance(scene, FileScene) and scene.posted):
        return {"scene": scene.name}
    content = scene.description.content
    return {"scene": scene.name, "scene_id": scene.id, "scene_file": json.dumps(content)}


def scene_of(attributes: Mapping[str, Any]) -> Scene:
    """Return the scene from the attributes of a data set, without its mesh files.

    Raises
    ------
    StudyError
        if there is no scene of this name
    """
    if "scene_file" not in attributes:
        return scene_named(attributes["scene"])
    return _stored_scene(str(attributes["scene"]), json.loads(attributes["scene_file"]))


def _shipped(name: str) -> Scene | None:
    """Return the scene of this name from a file of the package, or None."""
    return _shipped_scene(SHIPPED[name]) if name in SHIPPED else None


def _installed() -> dict[str, EntryPoint]:
    return {entry.name: entry for entry in entry_points(group=GROUP)}


def _loaded(entry: EntryPoint) -> Scene:
    """Return the scene that an installed package gives."""
    given = entry.load()
    if isinstance(given, str | Path):
        return _read_scene(given)
    if isinstance(given, Scene):
        return given
    allowed = f"must be a Scene or the path of a scene file, not {type(given).__name__}"
    raise StudyError("scene", entry.name, f"{allowed}: entry point {entry.value}")
