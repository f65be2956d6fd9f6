"""What is called in a process that is shut in: it reads a scene that was posted."""

from __future__ import annotations

import json
from base64 import b64encode
from pathlib import Path
from typing import Any

from solver.files import LARGEST
from solver.results.quantities import QUANTITIES
from studies.errors import StudyError
from studies.scenes import building  # noqa: F401  (needed for a model, and loaded with this)
from studies.scenes.description import Description, file_names
from studies.scenes.file_scene import FileScene
from studies.scenes.formats import load_readers
from studies.scenes.scene import read_scene

FILE = "scene.toml"

load_readers()
list(QUANTITIES)  # loads all that declare some: a process that is shut in cannot compile them


def checked(folder: Path) -> str:
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
    needed = file_names(Description.read(folder / FILE).content)
    for name in sorted({each.name for each in folder.iterdir()} - {FILE, *needed}):
        listed = ", ".join(needed) or "(it names none)"
        raise StudyError("meshes", name, f"must be a file that the scene names: {listed}")
    return read_scene(folder / FILE)


def _arrays(description: Description) -> dict[str, str]:
    """Return the arrays of the meshes as text: nobody else reads the files themselves."""
    read = {name: mesh.read().arrays for name, mesh in (description.meshes or {}).items()}
    if sum(map(len, read.values())) > LARGEST:
        raise StudyError("meshes", ", ".join(read), f"must have at most {LARGEST} bytes of arrays")
    return {name: b64encode(arrays).decode() for name, arrays in read.items()}


def _fields_of(mistake: StudyError) -> tuple[str, object, str]:
    value = mistake.value
    plain = value if isinstance(value, str | int | float | bool | None) else repr(value)
    return mistake.field, plain, mistake.allowed
