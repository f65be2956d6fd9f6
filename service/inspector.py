"""Scene files looked at before they are kept: ``python -m service.inspector FOLDER``.

What callers send is read in a process of its own, with limits of time and memory: a mesh can be
made so that reading it takes either without end. Nothing of it is executed.
"""

from __future__ import annotations

import asyncio
import json
import resource
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from anyio import CapacityLimiter

from service.errors import Busy
from studies import StudyError
from studies.errors import SceneError
from studies.scenes.description import Description, mesh_names
from studies.scenes.meshfile import MeshFile
from studies.scenes.scene import FileScene, file_scene, read_scene
from studies.toml import toml_of

SECONDS = 60
"""Time that reading a scene may take."""
BYTES = 8 * 2**30
"""Address space of the process that reads it; libraries alone take two thirds of it."""
WAITING = 20
"""Scenes that may wait to be read."""
FORMATS = (".msh", ".vtk", ".vtu", ".mesh", ".bdf", ".nas")
"""Endings of mesh files that callers may send: of formats that name no other file."""
_FILE = "scene.toml"


class Inspector:
    """Looks at scenes, one after the other."""

    def __init__(self) -> None:
        self.one = CapacityLimiter(1)

    async def inspect(self, text: bytes, meshes: Mapping[str, bytes]) -> FileScene:
        """Return the scene of a file and its meshes.

        Raises
        ------
        StudyError, SceneError
            with all that is wrong with it
        Busy
            if too many others wait
        """
        if self.one.statistics().tasks_waiting >= WAITING:
            raise Busy(f"{WAITING} scenes wait to be read already: ask later")
        needed = mesh_names(toml_of(text, "scene", _FILE))
        for name in meshes:
            if not name.lower().endswith(FORMATS):
                raise StudyError("meshes", name, f"must end in one of {', '.join(FORMATS)}")
            if name not in needed:
                listed = ", ".join(needed) or "(it names none)"
                raise StudyError("meshes", name, f"must be a file that the scene names: {listed}")
        async with self.one:
            with tempfile.TemporaryDirectory() as folder:
                for name, data in {**meshes, _FILE: text}.items():
                    (Path(folder) / Path(name).name).write_bytes(data)
                found = await _answer(folder)
        if mistakes := found.get("mistakes"):
            raise SceneError(_FILE, [StudyError(*each) for each in mistakes])
        given = {name: MeshFile(name, data) for name, data in meshes.items()}
        return file_scene(Description(_FILE, toml_of(text, "scene", _FILE), given))


async def _answer(folder: str) -> dict[str, Any]:
    """Return what the process says of the scene in a folder."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "service.inspector", folder,
        stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.DEVNULL,
    )  # fmt: skip
    try:
        told, _ = await asyncio.wait_for(process.communicate(), SECONDS + 10)
    except TimeoutError:
        told = b""
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    try:
        answer: dict[str, Any] = json.loads(told)
    except ValueError:
        allowed = f"must be read within {SECONDS} s and {BYTES >> 30} GiB of memory"
        raise StudyError("scene", _FILE, allowed) from None
    return answer


def main() -> None:
    """Read the scene of a folder, and print its mistakes as JSON."""
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    folder = Path(sys.argv[1])
    mistakes: list[StudyError] = []
    try:
        read_scene(folder / _FILE)
    except SceneError as error:
        mistakes += error.mistakes
    except StudyError as error:
        mistakes.append(error)
    told = [(each.field, _plain(each.value), each.allowed) for each in mistakes]
    print(json.dumps({"mistakes": told}).replace(f"{folder}/", ""))


def _plain(value: object) -> object:
    return value if isinstance(value, str | int | float | bool | None) else repr(value)


if __name__ == "__main__":
    main()
