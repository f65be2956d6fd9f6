"""What looks like a mistake in the parameters of a scene, before anything is computed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from solver.materials.doubts import doubts
from solver.scenes import Scene
from studies.definition.parameters import build


def doubts_of(scene: Scene, values: Mapping[str, Any]) -> tuple[str, ...]:
    """Return messages on materials whose numbers are probably in a wrong unit.

    Raises
    ------
    ModelError
        if a parameter is refused
    """
    parameters = build(scene, values)
    drawn = scene.sketch(parameters) if scene.sketch else None
    try:
        bodies = (drawn or scene.model(parameters)).bodies
    except NotImplementedError:  # no bodies are known before it is computed
        return ()
    return doubts({body.name: body.material for body in bodies})
