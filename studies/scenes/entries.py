"""The entries ``fatigue`` and ``derivatives`` of studies: scenes whose runs have more results."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, TypeVar

from pydantic import ValidationError

from solver.derivatives.asked import Derivatives
from solver.errors import ModelError
from solver.results.fatigue import Fatigue
from solver.scenes import Scene
from studies.errors import StudyError
from studies.scenes.description import Description
from studies.scenes.file_scene import FileScene
from studies.scenes.refusals import mistakes_of
from studies.scenes.results import fatigue_of
from studies.scenes.scene import file_scene
from studies.scenes.table import SceneTable
from studies.scenes.tables import DerivativesTable, FatigueTable

T = TypeVar("T", bound=SceneTable)


def assessed(scene: Scene, table: Any) -> Scene:
    """Return a scene whose runs also assess fatigue.

    Raises
    ------
    StudyError
        for a mistake of the table, below ``fatigue``
    """

    def with_output(checked: FatigueTable, source: str) -> Scene:
        made = fatigue_of(checked, scene.view(scene.parameters()))
        others = [each for each in scene.outputs if not isinstance(each, Fatigue)]
        return replace(scene, outputs=(*others, made), source=source)

    return _with("fatigue", scene, table, FatigueTable, with_output)


def derived(scene: Scene, table: Any) -> Scene:
    """Return a scene whose runs also have derivatives.

    Raises
    ------
    StudyError
        for a mistake of the table, below ``derivatives``
    """
    if scene.method is not None and not scene.derives:
        allowed = f"must be left out: runs of {scene.name} have none"
        raise StudyError("derivatives", table, allowed)

    def with_derivatives(checked: DerivativesTable, source: str) -> Scene:
        asked = Derivatives(**checked.model_dump())
        own = asked.quantities(scene.parameters, scene.known_quantities)
        return replace(
            scene,
            derivatives=asked,
            quantities=(*scene.quantities, *own),
            source=scene.source + source,
        )

    return _with("derivatives", scene, table, DerivativesTable, with_derivatives)


def _with(
    entry: str, scene: Scene, table: Any, kind: type[T], changed: Callable[[T, str], Scene]
) -> Scene:
    """Return a scene with an entry; that of a file has it in its content.

    Parameters
    ----------
    changed : (checked table, its content as text) -> the scene with what the entry asks for
    """
    if not isinstance(table, Mapping):
        first, second, *_ = kind.model_fields
        raise StudyError(entry, table, f"must be a table with {first} and {second}")
    if isinstance(scene, FileScene):
        own = scene.description
        content = {**own.content, entry: dict(table)}
        return file_scene(Description(own.file, content, own.meshes, own.shipped))
    try:
        checked = kind.model_validate(table)
        return changed(checked, json.dumps(checked.model_dump(mode="json"), sort_keys=True))
    except ValidationError as error:
        mistake = next(iter(mistakes_of(error, kind).values()))
        raise mistake.renamed(lambda field: f"{entry}.{field}") from None
    except ModelError as error:
        raise StudyError(f"{entry}.{error.field}", error.value, error.allowed) from None
