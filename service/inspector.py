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
from studies.scenes.table import FILE_NAME

SECONDS = 60
"""Time that reading a scene may take."""
BYTES = 8 * 2**30
"""Address space of the process that reads it."""
WAITING = 20
"""Scenes that may wait to be read."""
FORMATS = (".msh", ".vtk", ".vtu", ".mesh", ".bdf", ".nas")
"""Endings of mesh files that callers may send: of formats that name no other file."""
LONGEST = 1_000_000
"""Bytes that a scene file may have, beside its meshes."""
_FILE = "scene.toml"
_TOO_MUCH = 3
"""Exit status when memory did not suffice."""


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
        if len(text) > LONGEST:
            raise StudyError("scene", f"{len(text)} bytes", f"must have at most {LONGEST} bytes")
        for name in meshes:
            if not (FILE_NAME.fullmatch(name) and name.lower().endswith(FORMATS)):
                allowed = f"must be the name of a file and end in one of {', '.join(FORMATS)}"
                raise StudyError("meshes", name, allowed)
        async with self.one:
            with tempfile.TemporaryDirectory() as folder:
                for name, data in {**meshes, _FILE: text}.items():
                    (Path(folder) / name).write_bytes(data)
                found = await _answer(folder)
        if mistakes := found.get("mistakes"):
            raise SceneError(_FILE, [StudyError(*each) for each in mistakes])
        given = {name: MeshFile(name, data) for name, data in meshes.items()}
        description = Description(_FILE, found["content"], given)
        return await asyncio.to_thread(file_scene, description)


async def _answer(folder: str) -> dict[str, Any]:
    """Return what the process says of the scene in a folder."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "service.inspector", folder,
        stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE,
    )  # fmt: skip
    try:
        told, failed = await asyncio.wait_for(process.communicate(), SECONDS + 10)
    except TimeoutError:
        told = failed = b""
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    if process.returncode == 0:
        answer: dict[str, Any] = json.loads(told)
        return answer
    if process.returncode == 1:  # Python's own, with a traceback: a defect, and no limit
        raise RuntimeError(f"a scene could not be read: {failed.decode(errors='replace')}")
    allowed = f"must be read within {SECONDS} s and {BYTES >> 30} GiB of memory"
    raise StudyError("scene", _FILE, allowed)


def main() -> None:
    """Read the scene of a folder; print its content or its mistakes, as JSON."""
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    folder = Path(sys.argv[1])
    try:
        answer = {"content": _read(folder)}
    except SceneError as error:
        answer = {"mistakes": [_told(each) for each in error.mistakes]}
    except StudyError as error:
        answer = {"mistakes": [_told(error)]}
    except MemoryError:
        sys.exit(_TOO_MUCH)
    print(json.dumps(answer).replace(f"{folder}/", ""))


def _read(folder: Path) -> Any:
    """Return the content of the scene of a folder, in which all files are needed and sound."""
    content = Description.read(folder / _FILE).content
    needed = mesh_names(content)
    for name in sorted({each.name for each in folder.iterdir()} - {_FILE, *needed}):
        listed = ", ".join(needed) or "(it names none)"
        raise StudyError("meshes", name, f"must be a file that the scene names: {listed}")
    read_scene(folder / _FILE)
    return content


def _told(mistake: StudyError) -> tuple[str, object, str]:
    return mistake.field, _plain(mistake.value), mistake.allowed


def _plain(value: object) -> object:
    return value if isinstance(value, str | int | float | bool | None) else repr(value)


if __name__ == "__main__":
    main()
