"""Scenes from files, stored beside the runs: ``scenes/<scene id>/`` with scene.json and meshes.

The index ``scenes.sqlite`` has what lists need, and the names of parameters for searches. It
follows the files. A scene is read once for it, and otherwise when it is used, or when a search
names one of its parameters.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Collection
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from solver.scenes import Scene
from studies.definition.parameters import parameters_of
from studies.errors import CatalogueDamaged, FileDamaged, StoreBusy
from studies.scenes.file_scene import FileScene
from studies.storage.blobs import Folder
from studies.storage.database import Database
from studies.storage.seal import State, bytes_of, check, content_of, sealed, sealed_json, state_of

_FILE, _ARRAYS = "scene.json", ".arrays"


class Entry(NamedTuple):
    """A scene in the index.

    Attributes
    ----------
    id, name, summary, branch : content id, and as in `Scene`; no name if it is not allowed here
    size, owner, added : of its files [bytes], who posted it first, when [ns since 1970]
    parameters : names of its parameters
    """

    id: str
    name: str
    summary: str
    branch: str
    size: int
    owner: str
    added: int
    parameters: list[str]


_COLUMNS = ", ".join(Entry._fields)
_TABLE = f"CREATE TABLE IF NOT EXISTS shelf ({_COLUMNS}, state, PRIMARY KEY (id))"
"""A scene that this version does not allow has no name: its size counts, and no list has it."""


def keep(blobs: Folder, scene_id: str, description: Any, owner: str) -> None:
    """Store a scene of this content id."""
    seal, written = f"scene {scene_id}", {}
    for name, mesh in (description.meshes or {}).items():
        written[name] = mesh.data
        if mesh.arrays:
            written[f"{name}{_ARRAYS}"] = sealed(seal, mesh.arrays)
    content = {"file": description.file, "content": description.content, "owner": owner}
    written |= {_FILE: sealed_json(seal, content)}  # last: then all is there
    for name, data in written.items():
        with blobs.appearing(f"scenes/{scene_id}/{name}") as part:
            part.write_bytes(data)


def stored(blobs: Folder, scene_id: str, whole: bool) -> Scene | None:
    """Return the scene of this id, None if it is not stored.

    One that is not ``whole`` has parameters, but no meshes: no model can be built of it.

    Raises
    ------
    FileDamaged
        if the stored content is damaged, or that of a whole one does not have this id
    ValueError
        if it is not, and this version does not allow the scene
    """
    folder = blobs.path(f"scenes/{scene_id}/{_FILE}").parent
    if whole:
        for name in blobs.names(f"scenes/{scene_id}/*"):
            blobs.path(name)
        return _made(folder, whole=True)
    return _described(folder, state_of(folder / _FILE), state_of(folder))


@lru_cache(maxsize=16)
def _described(folder: Path, *states: State | None) -> Scene | None:
    """Return a scene without its meshes, read again when its folder or file has another state."""
    return _made(folder, whole=False) if all(states) else None


def _made(folder: Path, whole: bool) -> FileScene | None:
    """Return a scene made from the content of its file."""
    from studies.scenes.description import Description, file_names  # loads scipy
    from studies.scenes.scene import file_scene

    scene_id, name = folder.name, f"scene {folder.name}"
    state = state_of(folder / _FILE) and state_of(folder)
    if state is None:
        return None
    try:
        saved = content_of(folder / _FILE, name)
        names = file_names(saved["content"]) if whole else []
        meshes = {each: _mesh(folder / each, name) for each in names}
        found = Description(saved["file"], saved["content"], meshes if whole else None)
        if whole and found.digest != scene_id:
            raise FileDamaged(folder, name, "its content has changed", state)
        return file_scene(found)
    except (FileDamaged, AttributeError, LookupError, TypeError) as error:
        reason = error.reason if isinstance(error, FileDamaged) else f"{error}".partition("\n")[0]
        raise FileDamaged(folder, name, reason, state) from None


def _mesh(path: Path, name: str) -> Any:
    """Return a mesh of a scene, with its arrays if it was posted."""
    from studies.scenes.meshfile import MeshFile  # loads scipy

    arrays, data = path.with_name(f"{path.name}{_ARRAYS}"), bytes_of(path, name)[0]
    if state_of(arrays) is None:
        return MeshFile(path.name, data)
    check(arrays, name)
    return MeshFile(path.name, data, bytes_of(arrays, name)[0])


class Index(Database):
    """The index of the scenes of a directory; its file may be in another one."""

    def __init__(self, blobs: Folder, lists: Path) -> None:
        super().__init__(lists / "scenes.sqlite", CatalogueDamaged, StoreBusy)
        self.blobs = blobs

    def follow(self, read: Callable[[str], Scene | None], refused: Collection[str]) -> None:
        """Bring the index to the files.

        Parameters
        ----------
        read : gives a new scene; None for one that is not there or not allowed
        refused : scenes that are known not to be allowed: another version may have refused others
        """
        files = map(self.blobs.path, self.blobs.names(f"scenes/*/{_FILE}"))
        paths = {path.parent.name: state_of(path) for path in files}
        there = {name: (repr(state), state[2]) for name, state in paths.items() if state}
        mode = "rwc" if self.path.exists() or there else "memory"
        with self.connection("BEGIN", mode) as connection:
            connection.execute(_TABLE)
            rows = connection.execute("SELECT id, state, name FROM shelf").fetchall()
        known = {key: state for key, state, name in rows if name is not None or key in refused}
        gone = {key for key, *_ in rows} - there.keys()
        fresh = [name for name, (state, _) in there.items() if known.get(name) != state]
        rows = [row for name in fresh if (row := self._row(name, read, *there[name]))]
        if rows or gone:
            with self.connection("BEGIN IMMEDIATE", "rw") as connection:
                connection.executemany("DELETE FROM shelf WHERE id = ?", [[each] for each in gone])
                connection.executemany(
                    f"INSERT OR REPLACE INTO shelf VALUES ({', '.join('?' * 9)})", rows
                )

    def _row(
        self, name: str, read: Callable[[str], Scene | None], state: str, added: int
    ) -> tuple[object, ...] | None:
        """Return the row of a scene, or None where it is deleted or set aside meanwhile."""
        try:
            scene = read(name)
            size, owner = self._kept(name)
        except (OSError, FileDamaged):
            return None
        about = (scene.name, scene.summary, scene.branch) if scene else (None, "", "")
        names = json.dumps([*parameters_of(scene)] if scene else [])
        return name, *about, size, owner, added, names, state

    def _kept(self, scene_id: str) -> tuple[int, str]:
        """Return the size of the files of a scene, and its owner."""
        stamps = self.blobs.stamps(self.blobs.names(f"scenes/{scene_id}/*"))
        content = content_of(self.blobs.path(f"scenes/{scene_id}/{_FILE}"), f"scene {scene_id}")
        return sum(size for size, _ in stamps.values()), str(content.get("owner", ""))

    def page(self, limit: int, offset: int = 0, name: str | None = None) -> list[Entry]:
        """Return a page of the scenes, or of those of a name, the latest first."""
        latest = "WHERE name IS NOT NULL AND ? IN (name, '') ORDER BY added DESC, id"
        return self._entries(f"{latest} LIMIT ? OFFSET ?", name or "", limit, offset)

    def files(self) -> list[Entry]:
        """Return all scenes, the oldest first, also those that are not allowed here."""
        return self._entries("ORDER BY added, id")

    def _entries(self, rest: str, *values: Any) -> list[Entry]:
        with self.connection("BEGIN", "rw" if self.path.exists() else "memory") as connection:
            connection.execute(_TABLE)
            rows = connection.execute(f"SELECT {_COLUMNS} FROM shelf {rest}", values)
            return [Entry._make((*row[:-1], json.loads(row[-1]))) for row in rows]
