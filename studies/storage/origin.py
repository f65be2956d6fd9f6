"""What a data set says of the study that it was made of: its files, its licence, how to cite it."""

from __future__ import annotations

import datetime
import json
from collections.abc import Mapping
from typing import Any

import solver
from solver.files import read_file
from studies.definition.files import texts_with
from studies.definition.study import Study
from studies.scenes.file_scene import FileScene
from studies.scenes.shipped import SHIPPED
from studies.storage.provenance import NONE
from studies.storage.ran import lock
from studies.storage.seal import digest_of

PROGRAM = f"Residua contributors: Residua, version {solver.__version__}"
"""How to cite the program (CITATION.cff)."""


def origin(study: Study) -> dict[str, Any]:
    """Return the attributes of a data set on its study."""
    words = {"note": study.note, "tags": " ".join(study.tags)}
    time = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    return {
        **{name: text for name, text in words.items() if text},
        "license": study.licence or NONE,
        "cite": study.cite or NONE,
        "doi": study.doi or NONE,
        "references": PROGRAM,
        "history": f"{time} data set written by Residua {solver.__version__}",
        "files": json.dumps(files_of(study)),
        "mesh_sha256": json.dumps({name: digest_of(data) for name, data in meshes_of(study)}),
        "lock": lock(),
    }


def files_of(study: Study) -> dict[str, str]:
    """Return the texts of the study file and of the scene files as they were read, by name.

    The first one is the study; of one that was not read from a file it is the JSON of its entries.
    """
    scene = study.problem
    if isinstance(scene, FileScene) and not scene.posted and scene.name in SHIPPED:
        path = SHIPPED[scene.name]
        return texts_with(study.texts, {path.name: read_file(path).decode()})
    return study.texts


def meshes_of(study: Study) -> list[tuple[str, bytes]]:
    """Return the names and contents of the meshes and tables that the scene file names."""
    scene = study.problem
    meshes: Mapping[str, Any] = {}
    if isinstance(scene, FileScene):
        meshes = scene.description.meshes or {}
    return [(name, each.data) for name, each in meshes.items()]
