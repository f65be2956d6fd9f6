"""Own values of what records hold, with which every record that a test makes is compared."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from solver.results.record import Record, Status
from solver.scenes.scene import Scene


class RecordDiffers(AssertionError):
    """A record differs from its own values."""


@contextmanager
def compared() -> Iterator[None]:
    """Compare each record of a complete run that its audit passes, as soon as it is made."""
    record = Scene.record

    def checked(scene: Scene, run: Any) -> Record:
        from tests.recomputed.record import differences  # loads the solver

        found = record(scene, run)
        if run.complete and found.status is not Status.AUDIT_FAILED:
            p = run.parameters
            places = scene.places(p) if scene.places else None
            if wrong := list(differences(run, found, scene.view(p), places)):
                raise RecordDiffers(f"recomputed: {'; '.join(wrong)}")
        return found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Scene, "record", checked)
        yield
