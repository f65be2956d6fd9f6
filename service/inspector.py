"""Check scene files before they are stored, and draw them; nothing in them is executed.

A scene is read in a process without a network, which writes in one folder.
"""

from __future__ import annotations

import errno
import json
import logging
from base64 import b64decode, b64encode
from collections.abc import Mapping
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from service.alone import CRASHED, FAILED, Answer, alone
from service.errors import TooMany
from service.maps import draw_scene
from service.schemas import KeptScene, SketchQuery
from service.turns import MINUTE, Share, beyond
from solver.files import LARGEST
from solver.results.quantities import QUANTITIES
from studies import Store, Study, StudyError
from studies.definition.parameters import read_values
from studies.errors import SceneError
from studies.scenes.file_scene import FileScene
from studies.scenes.formats import FORMATS, load_readers
from studies.scenes.registry import scene_named
from studies.scenes.table import FILE_NAME
from studies.scratch import scratch

if TYPE_CHECKING:
    from studies.scenes.description import Description

log = logging.getLogger(__name__)

SLOW = 10.0
"""Longest time of reading a scene, as a multiple of its processor time: others compute too."""
LONGEST = 1_000_000
"""Largest size of a scene file, without its meshes [bytes]."""
_FILE = "scene.toml"


class Inspector:
    """Checks scenes.

    Parameters
    ----------
    seconds : longest processor time of one [s]
    """

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self.reported = ""

    async def inspect(
        self, text: bytes, meshes: Mapping[str, bytes], share: Share
    ) -> tuple[KeptScene, Description]:
        """Return the scene of a file and its meshes, and their content.

        Raises
        ------
        StudyError
            with all its mistakes
        Busy
            if the budget of the caller is used, or the process was killed
        """
        from studies.scenes.description import Description  # loads scipy
        from studies.scenes.meshfile import TABLE, MeshFile

        if len(text) > LONGEST:
            raise StudyError("scene", f"{len(text)} bytes", f"must have at most {LONGEST} bytes")
        known = (*FORMATS, TABLE)
        for name in meshes:
            if not (FILE_NAME.fullmatch(name) and name.lower().endswith(known)):
                allowed = f"must be the name of a file and end in one of {', '.join(known)}"
                raise StudyError("meshes", name, allowed)
        slow = SLOW * self.seconds
        async with share.turn() as turn:
            most, files = min(turn.remaining, self.seconds), {**meshes, _FILE: text}
            answer = await turn.apart(
                inspected, files, most, field="scene", name=_FILE, seconds=slow
            )
        if answer.failed == errno.ETIME and most < self.seconds:
            share.turns.remaining(share.caller)
            raise TooMany("too little processor time remained: ask later", ceil(MINUTE))
        found = self._read(answer)
        if mistakes := found.get("mistakes"):
            raise SceneError(_FILE, [StudyError(*each) for each in mistakes], found["count"])
        arrays = {name: b64decode(text) for name, text in found["arrays"].items()}
        given = {name: MeshFile(name, data, arrays[name]) for name, data in meshes.items()}
        return KeptScene(**found["scene"]), Description(_FILE, found["content"], given)

    def _read(self, answer: Answer) -> dict[str, Any]:
        if answer.open != self.reported:
            self.reported = answer.open
            log.warning("this system does not take from a process that reads: %s", answer.open)
        if answer.failed == errno.ENOSPC:
            raise OSError(errno.ENOSPC, "no room is left for temporary files")
        if answer.failed == FAILED:
            raise RuntimeError("a scene could not be read")
        if answer.failed == CRASHED:
            allowed = "cannot be read: a library that reads its meshes fails with them"
            raise StudyError("scene", _FILE, allowed)
        if answer.failed:
            raise beyond("scene", _FILE, self.seconds)
        found: dict[str, Any] = json.loads(answer.text)
        return found


def inspected(files: Mapping[str, bytes], seconds: float) -> Answer:
    """Return what a copy of this process, which has loaded what a scene needs, finds in files."""
    import studies.scenes.building
    import studies.scenes.scene  # noqa: F401

    load_readers()
    list(QUANTITIES)  # loads all that declare some: the copy cannot compile what it loads
    with scratch() as folder:
        for name, data in files.items():
            (folder / name).write_bytes(data)
        return alone(_checked, folder, folder=folder, seconds=seconds)


def drawn(directory: Path, name: str, query: SketchQuery) -> bytes:
    """Return the picture of a scene of a store as PNG; called in a process.

    Its meshes may be those of a stranger, and its parameters are the caller's.
    """
    scene = Store(directory).scene(name) or scene_named(name)
    return draw_scene(scene, read_values(scene, query.selection), query)


def pictured(directory: Path, content: dict[str, Any]) -> bytes:
    """Return the scene of the first run of a study as PNG; called in a process."""
    first = next(iter(Study.known(content, Store(directory).scene).cases()))
    return draw_scene(first.scene, first.values, SketchQuery())


def _checked(folder: Path) -> str:
    """Return the scene in a folder and its content, or its mistakes, as JSON."""
    answer: dict[str, Any]
    try:
        scene = _read(folder)
        arrays = _arrays(scene.description)
        kept = {"id": scene.id, "name": scene.name, "summary": scene.summary}
        answer = {"scene": kept, "content": scene.description.content, "arrays": arrays}
    except StudyError as error:
        answer = {"mistakes": [_fields_of(each) for each in error.each], "count": error.count}
    return json.dumps(answer).replace(f"{folder}/", "")


def _read(folder: Path) -> FileScene:
    """Return the scene in a folder; every file must be needed and valid."""
    from studies.scenes.description import Description, file_names  # loads scipy
    from studies.scenes.scene import read_scene

    needed = file_names(Description.read(folder / _FILE).content)
    for name in sorted({each.name for each in folder.iterdir()} - {_FILE, *needed}):
        listed = ", ".join(needed) or "(it names none)"
        raise StudyError("meshes", name, f"must be a file that the scene names: {listed}")
    return read_scene(folder / _FILE)


def _arrays(description: Description) -> dict[str, str]:
    """Return the arrays of the meshes as text: nobody else reads the files themselves."""
    read = {name: mesh.read().arrays for name, mesh in (description.meshes or {}).items()}
    if sum(map(len, read.values())) > LARGEST:
        raise StudyError("meshes", ", ".join(read), f"must have at most {LARGEST} bytes of arrays")
    return {name: b64encode(arrays).decode() for name, arrays in read.items()}


def _fields_of(mistake: StudyError) -> tuple[str, object, str]:
    return mistake.field, _plain(mistake.value), mistake.allowed


def _plain(value: object) -> object:
    return value if isinstance(value, str | int | float | bool | None) else repr(value)
