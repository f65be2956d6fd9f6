"""Scenes from files, stored beside the runs: ``scenes/<scene id>/`` with scene.json and meshes.

The index ``scenes.sqlite`` has what lists need, and the names of parameters for searches. It
follows the files. A scene is read once for it, and otherwise when it is used, or when a search
names one of its parameters.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from solver.scenes import Scene
from studies.appearing import appearing
from studies.definition.parameters import parameters_of
from studies.errors import CatalogueDamaged, FileDamaged, StoreBusy
from studies.scenes.description import Description, mesh_names
from studies.scenes.meshfile import MeshFile
from studies.scenes.scene import FileScene, file_scene
from studies.storage.database import Database
from studies.storage.seal import bytes_of, content_of, sealed_json, state_of

_FILE = "scene.json"
_COLUMNS = "id, name, summary, branch, parameters"
_TABLE = f"CREATE TABLE IF NOT EXISTS scenes ({_COLUMNS}, state, added, PRIMARY KEY (id))"


@dataclass(frozen=True, slots=True)
class Entry:
    """A scene in the index: its content id, name, summary, branch, and names of parameters."""

    id: str
    name: str
    summary: str
    branch: str
    parameters: list[str]


def keep(directory: Path, scene_id: str, description: Description) -> None:
    """Store a scene of this content id."""
    folder = directory / "scenes" / scene_id
    folder.mkdir(parents=True, exist_ok=True)
    written = {name: mesh.data for name, mesh in (description.meshes or {}).items()}
    content = {"file": description.file, "content": description.content}
    written |= {_FILE: sealed_json(f"scene {scene_id}", content)}  # last: then all is there
    for name, data in written.items():
        with appearing(folder / name) as part:
            part.write_bytes(data)


def described(directory: Path, scene_id: str) -> Scene | None:
    """Return the scene of this id without its meshes, None if it is not stored.

    It has parameters, but no model can be built of it.

    Raises
    ------
    FileDamaged
        if scene.json is damaged
    ValueError
        if it is not, and this version does not allow the scene
    """
    return _made(directory, scene_id, whole=False)


def kept(directory: Path, scene_id: str) -> Scene | None:
    """Return the scene of this id, None if it is not stored.

    Raises
    ------
    FileDamaged
        if the stored content does not have this id
    ValueError
        if it has, and this version does not allow the scene
    """
    return _made(directory, scene_id, whole=True)


def _made(directory: Path, scene_id: str, whole: bool) -> FileScene | None:
    """Return a scene made from the content of its file."""
    folder, name = directory / "scenes" / scene_id, f"scene {scene_id}"
    state = state_of(folder / _FILE) and state_of(folder)
    if state is None:
        return None
    try:
        saved = content_of(folder / _FILE, name)
        names = mesh_names(saved["content"]) if whole else []
        meshes = {each: MeshFile(each, bytes_of(folder / each, name)[0]) for each in names}
        found = Description(saved["file"], saved["content"], meshes if whole else None)
        if whole and found.digest != scene_id:
            raise FileDamaged(folder, name, "its content has changed", state)
        return file_scene(found)
    except (FileDamaged, AttributeError, LookupError, TypeError) as error:
        reason = error.reason if isinstance(error, FileDamaged) else f"{error}".partition("\n")[0]
        raise FileDamaged(folder, name, reason, state) from None


class Index(Database):
    """The index of the scenes of a directory."""

    def __init__(self, directory: Path) -> None:
        super().__init__(directory / "scenes.sqlite", CatalogueDamaged, StoreBusy)
        self.scenes = directory / "scenes"

    def follow(self, read: Callable[[str], Scene | None]) -> None:
        """Bring the index to the files; ``read`` gives a new scene, or None for one without."""
        paths = {path.parent.name: state_of(path) for path in self.scenes.glob(f"*/{_FILE}")}
        there = {name: (repr(state), state[2]) for name, state in paths.items() if state}
        mode = "rwc" if self.path.exists() or there else "memory"
        with self.connection("BEGIN", mode) as connection:
            connection.execute(_TABLE)
            known = dict(connection.execute("SELECT id, state FROM scenes").fetchall())
        fresh = [name for name, (state, _) in there.items() if known.get(name) != state]
        rows = [
            (name, scene.name, scene.summary, scene.branch,
             json.dumps([*parameters_of(scene)]), *there[name])
            for name in fresh if (scene := read(name))
        ]  # fmt: skip
        gone = known.keys() - there.keys()
        if rows or gone:
            with self.connection("BEGIN IMMEDIATE", "rw") as connection:
                connection.executemany("DELETE FROM scenes WHERE id = ?", [[each] for each in gone])
                connection.executemany(
                    "INSERT OR REPLACE INTO scenes VALUES (?, ?, ?, ?, ?, ?, ?)", rows
                )

    def page(self, limit: int, offset: int = 0, name: str | None = None) -> list[Entry]:
        """Return a page of the scenes, or of those of a name, the latest first."""
        with self.connection("BEGIN", "rw" if self.path.exists() else "memory") as connection:
            connection.execute(_TABLE)
            rows = connection.execute(
                f"SELECT {_COLUMNS} FROM scenes WHERE ? IN (name, '') "
                "ORDER BY added DESC, id LIMIT ? OFFSET ?",
                [name or "", limit, offset],
            )
            return [Entry(i, n, text, at, json.loads(names)) for i, n, text, at, names in rows]
