"""The entry ``fatigue`` of studies: a scene whose runs assess fatigue."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pydantic import ValidationError

from solver.errors import ModelError
from solver.results.fatigue import Fatigue
from solver.scenes import Scene
from studies.errors import StudyError
from studies.scenes.description import Description
from studies.scenes.file_scene import FileScene
from studies.scenes.refusals import mistakes_of
from studies.scenes.results import fatigue_of
from studies.scenes.scene import file_scene
from studies.scenes.tables import FatigueTable


def assessed(scene: Scene, table: Any) -> Scene:
    """Return a scene whose runs also assess fatigue; that of a file has the table in its content.

    Raises
    ------
    StudyError
        for a mistake of the table, below ``fatigue``
    """
    if not isinstance(table, Mapping):
        raise StudyError("fatigue", table, "must be a table with criterion and limits")
    if isinstance(scene, FileScene):
        own = scene.description
        content = {**own.content, "fatigue": dict(table)}
        return file_scene(Description(own.file, content, own.meshes, own.shipped))
    try:
        checked = FatigueTable.model_validate(table)
        view = scene.view(scene.parameters())
        made = fatigue_of(checked, view.stages, view.unloaded)
    except ValidationError as error:
        first = next(iter(mistakes_of(error, FatigueTable).values()))
        raise first.renamed(lambda field: f"fatigue.{field}") from None
    except ModelError as error:
        raise StudyError(f"fatigue.{error.field}", error.value, error.allowed) from None
    others = [each for each in scene.outputs if not isinstance(each, Fatigue)]
    source = json.dumps(checked.model_dump(mode="json"), sort_keys=True)
    return replace(scene, outputs=(*others, made), source=source)
