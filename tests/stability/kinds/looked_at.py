"""A run of a scene, and what its record was taken from."""

from __future__ import annotations

from typing import Any

import pytest

from solver import Record, Scene
from solver.results.run import FinishedRun


def looked_at(scene: Scene, parameters: Any) -> tuple[FinishedRun, Record]:
    """Run a scene once; return what its outputs looked at, and its record."""
    seen: list[FinishedRun] = []
    record_of = Scene.record

    def watched(self: Scene, run: FinishedRun) -> Record:
        seen.append(run)
        return record_of(self, run)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Scene, "record", watched)
        value = getattr(parameters, scene.branch) if scene.branch else 0.0
        (record,) = scene.path(parameters, [value], lambda share: None)
    (run,) = seen
    return run, record
