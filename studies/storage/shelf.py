"""Scenes from files, stored beside the runs: ``scenes/<scene id>/`` with scene.json and meshes."""

from __future__ import annotations

from pathlib import Path

from solver.scenes import Scene
from studies.errors import FileDamaged, StudyError
from studies.scenes.description import Description, mesh_names
from studies.scenes.meshfile import MeshFile
from studies.scenes.scene import FileScene, file_scene
from studies.storage.appearing import appearing
from studies.storage.seal import content_of, sealed_json, state_of

_FILE = "scene.json"


def keep(directory: Path, scene: Scene) -> None:
    """Store the content of a scene, if it comes from a file that is not part of the package."""
    if not (isinstance(scene, FileScene) and scene.posted):
        return
    folder = directory / "scenes" / scene.id
    folder.mkdir(parents=True, exist_ok=True)
    meshes = scene.description.meshes or {}
    written = {name: mesh.data for name, mesh in meshes.items()}
    content = {"file": scene.description.file, "content": scene.description.content}
    written |= {_FILE: sealed_json(f"scene {scene.id}", content)}  # last: then all is there
    for name, data in written.items():
        with appearing(folder / name) as part:
            part.write_bytes(data)


def kept(directory: Path, scene_id: str) -> FileScene | None:
    """Return the scene of this id, None if it is not stored.

    Raises
    ------
    FileDamaged
        if the stored content does not have this id
    """
    folder = directory / "scenes" / scene_id
    state = state_of(folder / _FILE) and state_of(folder)
    if state is None:
        return None
    try:
        saved = content_of(folder / _FILE, f"scene {scene_id}")
        names = mesh_names(saved["content"])
        meshes = {name: MeshFile(name, (folder / name).read_bytes()) for name in names}
        scene = file_scene(Description(saved["file"], saved["content"], meshes))
    except (FileDamaged, OSError, StudyError, AttributeError, LookupError, TypeError) as error:
        reason = error.reason if isinstance(error, FileDamaged) else f"{error}".partition("\n")[0]
    else:
        if scene.id == scene_id:
            return scene
        reason = "its content has changed"
    raise FileDamaged(folder, f"scene {scene_id}", reason, state)


def newest(directory: Path, count: int) -> list[str]:
    """Return the ids of the latest stored scenes, newest first."""
    files = {path: state_of(path) for path in (directory / "scenes").glob(f"*/{_FILE}")}
    there = {path: state[2] for path, state in files.items() if state}
    return [path.parent.name for path in sorted(there, key=lambda path: -there[path])[:count]]
