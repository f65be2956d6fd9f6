"""Check scene files before they are stored; nothing in them is executed."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator, Mapping
from contextlib import ExitStack, asynccontextmanager
from pathlib import Path
from typing import Any

from anyio import CancelScope
from anyio.to_thread import run_sync as run_in_thread

from service.guarded import Guarded
from service.schemas import KeptScene
from studies import StudyError
from studies.errors import SceneError
from studies.scenes.description import Description, mesh_names
from studies.scenes.meshfile import MeshFile
from studies.scenes.scene import FileScene, read_scene
from studies.scenes.table import FILE_NAME
from studies.scratch import scratch

SECONDS = 60
"""Longest time of reading a scene [s]."""
WAITING = 20
"""Number of scenes that may wait to be read."""
FORMATS = (".msh", ".vtk", ".vtu", ".mesh", ".bdf", ".nas")
"""Permitted endings of mesh files: formats that do not refer to other files."""
LONGEST = 1_000_000
"""Largest size of a scene file, without its meshes [bytes]."""
_FILE = "scene.toml"


class Inspector:
    """Checks scenes, one after the other."""

    def __init__(self) -> None:
        self.process = Guarded("scene", WAITING, SECONDS)

    async def inspect(
        self, text: bytes, meshes: Mapping[str, bytes]
    ) -> tuple[KeptScene, Description]:
        """Return the scene of a file and its meshes, and their content.

        Raises
        ------
        StudyError, SceneError
            with all its mistakes
        Busy
            if too many others wait, or the process was killed
        """
        if len(text) > LONGEST:
            raise StudyError("scene", f"{len(text)} bytes", f"must have at most {LONGEST} bytes")
        for name in meshes:
            if not (FILE_NAME.fullmatch(name) and name.lower().endswith(FORMATS)):
                allowed = f"must be the name of a file and end in one of {', '.join(FORMATS)}"
                raise StudyError("meshes", name, allowed)
        async with self.process.turn(), _written({**meshes, _FILE: text}) as folder:
            found = json.loads(await self.process.call(inspected, str(folder), name=_FILE))
        if mistakes := found.get("mistakes"):
            raise SceneError(_FILE, [StudyError(*each) for each in mistakes], found["count"])
        given = {name: MeshFile(name, data) for name, data in meshes.items()}
        return KeptScene(**found["scene"]), Description(_FILE, found["content"], given)


@asynccontextmanager
async def _written(files: Mapping[str, bytes]) -> AsyncIterator[Path]:
    """Give a temporary folder with these files; a disk may be slow, so threads work on it."""
    kept = ExitStack()

    def write() -> Path:
        folder = kept.enter_context(scratch())
        for name, data in files.items():
            (folder / name).write_bytes(data)
        return folder

    try:
        yield await run_in_thread(write)
    finally:
        with CancelScope(shield=True):
            await run_in_thread(kept.close)


def inspected(folder: str) -> str:
    """Return the scene in a folder and its content, or its mistakes, as JSON."""
    answer: dict[str, Any]
    try:
        scene = _read(Path(folder))
        kept = {"id": scene.id, "name": scene.name, "summary": scene.summary}
        answer = {"scene": kept, "content": scene.description.content}
    except SceneError as error:
        listed = [_fields_of(each) for each in error.mistakes]
        answer = {"mistakes": listed, "count": error.count}
    except StudyError as error:
        answer = {"mistakes": [_fields_of(error)], "count": 1}
    return json.dumps(answer).replace(f"{folder}/", "")


def _read(folder: Path) -> FileScene:
    """Return the scene in a folder; every file must be needed and valid."""
    needed = mesh_names(Description.read(folder / _FILE).content)
    for name in sorted({each.name for each in folder.iterdir()} - {_FILE, *needed}):
        listed = ", ".join(needed) or "(it names none)"
        raise StudyError("meshes", name, f"must be a file that the scene names: {listed}")
    return read_scene(folder / _FILE)


def _fields_of(mistake: StudyError) -> tuple[str, object, str]:
    return mistake.field, _plain(mistake.value), mistake.allowed


def _plain(value: object) -> object:
    return value if isinstance(value, str | int | float | bool | None) else repr(value)
