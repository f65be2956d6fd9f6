"""A run of a scene, and what its record was taken from."""

from __future__ import annotations

from typing import Any

import pytest

from solver import Record, Scene
from solver.results.look import Look


def looked_at(scene: Scene, parameters: Any) -> tuple[Look, Record]:
    """Run a scene once; return what its outputs looked at, and its record."""
    seen: list[Look] = []
    record_of = Scene.record

    def watched(self: Scene, look: Look) -> Record:
        seen.append(look)
        return record_of(self, look)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Scene, "record", watched)
        value = getattr(parameters, scene.branch)
        (record,) = scene.path(parameters, [value], lambda share: None)
    (look,) = seen
    return look, record
