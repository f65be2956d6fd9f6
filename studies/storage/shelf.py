"""Scenes from files, stored beside the runs: ``scenes/<scene id>/`` with scene.json and meshes."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path

from solver.scenes import Scene
from studies.errors import StudyError
from studies.scenes.description import Description, mesh_names
from studies.scenes.meshfile import MeshFile
from studies.scenes.scene import FileScene, file_scene
from studies.storage.appearing import appearing

_FILE = "scene.json"


def keep(directory: Path, scene: Scene) -> None:
    """Store the content of a scene, if it comes from a file that is not part of the package."""
    if not (isinstance(scene, FileScene) and scene.posted):
        return
    folder = directory / "scenes" / scene.id
    with suppress(StudyError):  # a damaged one is written again
        if kept(directory, scene.id):
            return
    folder.mkdir(parents=True, exist_ok=True)
    meshes = scene.description.meshes or {}
    written = {name: mesh.data for name, mesh in meshes.items()}
    content = {"file": scene.description.file, "content": scene.description.content}
    written |= {_FILE: (json.dumps(content, indent=2) + "\n").encode()}  # last: then all is there
    for name, data in written.items():
        with appearing(folder / name) as part:
            part.write_bytes(data)


def kept(directory: Path, scene_id: str) -> FileScene | None:
    """Return the scene of this id, None if it is not stored.

    Raises
    ------
    StudyError
        if the stored content does not have this id
    """
    folder = directory / "scenes" / scene_id
    path = folder / _FILE
    if len(Path(scene_id).parts) != 1 or not path.is_file():
        return None
    try:
        saved = json.loads(path.read_bytes())
        names = mesh_names(saved["content"])
        meshes = {name: MeshFile(name, (folder / name).read_bytes()) for name in names}
        scene = file_scene(Description(saved["file"], saved["content"], meshes))
    except (OSError, ValueError, KeyError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise StudyError("scene", scene_id, f"is stored damaged, post it again: {reason}") from None
    if scene.id != scene_id:
        allowed = "is stored damaged, post it again: its content has changed"
        raise StudyError("scene", scene_id, allowed)
    return scene


def named(directory: Path, name: str) -> list[FileScene]:
    """Return the stored scenes of this name, without those that cannot be read."""
    word, found = json.dumps(name).encode(), []
    for file in sorted((directory / "scenes").glob(f"*/{_FILE}")):
        with suppress(OSError, StudyError):
            if word in file.read_bytes():  # else its meshes need not be read
                found.append(kept(directory, file.parent.name))
    return [scene for scene in found if scene and scene.name == name]


def newest(directory: Path, count: int) -> list[FileScene]:
    """Return the latest stored scenes, newest first, without those that cannot be read."""
    files = sorted((directory / "scenes").glob(f"*/{_FILE}"), key=lambda f: -f.stat().st_mtime_ns)
    found = []
    for each in files[:count]:
        with suppress(StudyError):
            found.append(kept(directory, each.parent.name))
    return [scene for scene in found if scene]
