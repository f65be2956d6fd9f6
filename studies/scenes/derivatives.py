"""The entry ``derivatives`` of studies: a scene whose runs have derivatives of their numbers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pydantic import ValidationError

from solver.derivatives.asked import Derivatives
from solver.errors import ModelError
from solver.scenes import Scene
from studies.errors import StudyError
from studies.scenes.description import Description
from studies.scenes.file_scene import FileScene
from studies.scenes.refusals import mistakes_of
from studies.scenes.scene import file_scene
from studies.scenes.tables import DerivativesTable


def derived(scene: Scene, table: Any) -> Scene:
    """Return a scene whose runs also have derivatives; that of a file has them in its content.

    Raises
    ------
    StudyError
        for a mistake of the table, below ``derivatives``
    """
    if not isinstance(table, Mapping):
        raise StudyError("derivatives", table, "must be a table with by and of")
    if isinstance(scene, FileScene):
        own = scene.description
        content = {**own.content, "derivatives": dict(table)}
        return file_scene(Description(own.file, content, own.meshes, own.shipped))
    if scene.method is not None:
        allowed = f"must be left out: runs of {scene.name} are not computed by increments alone"
        raise StudyError("derivatives", dict(table), allowed)
    try:
        checked = DerivativesTable.model_validate(table)
    except ValidationError as error:
        first = next(iter(mistakes_of(error, DerivativesTable).values()))
        raise first.renamed(lambda field: f"derivatives.{field}") from None
    asked = Derivatives(**checked.model_dump())
    try:
        own = asked.quantities(scene.parameters, scene.known_quantities)
    except ModelError as error:
        raise StudyError(f"derivatives.{error.field}", error.value, error.allowed) from None
    source = scene.source + json.dumps(checked.model_dump(mode="json"), sort_keys=True)
    return replace(scene, derivatives=asked, quantities=(*scene.quantities, *own), source=source)
