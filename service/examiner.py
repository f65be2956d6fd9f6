"""Check studies before they are accepted, in a separate process.

To check every run of a large study and to make its id takes seconds, and memory.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from service.guarded import Guarded
from service.settings import Settings
from solver.scenes import Scene
from studies import Bounds, Estimate, Store, Study, estimate
from studies.definition.extending import EXTENDS
from studies.scenes.registry import scene_named

WAITING = 100
"""Number of studies that may wait to be checked."""
SECONDS = 120
"""Longest time of the check of a study [s]."""


@dataclass(frozen=True, slots=True)
class Examined:
    """A study that may be accepted.

    Attributes
    ----------
    study : the checked study
    runs : ids of its runs in the order of its cases; one that chooses them has none yet
    estimate : its estimated cost
    """

    study: Study
    runs: list[str]
    estimate: Estimate


class Examiner:
    """Checks studies, one after the other.

    Parameters
    ----------
    settings : with the bounds on the cost of a study
    """

    def __init__(self, settings: Settings) -> None:
        self.directory, self.bounds = settings.data.resolve(), settings.bounds
        self.process = Guarded("study", WAITING, SECONDS)

    async def examine(self, content: Mapping[str, Any]) -> Examined:
        """Return the study that ``content`` describes.

        Raises
        ------
        StudyError
            If it has a mistake, or its cost exceeds the settings.
        Busy
            If too many others wait, or the process was killed.
        """
        what = dict(content), self.directory, self.bounds
        name = content.get("name")
        async with self.process.turn():
            return await self.process.call(examined, *what, name=name, advice=": sweep less")


def examined(content: dict[str, Any], directory: Path, bounds: Bounds) -> Examined:
    """Return a checked study with its run ids and its cost; called in a separate process."""
    store = Store(directory)

    def find(name: str) -> Scene | None:
        return store.scene(store.scene_id(name))

    if EXTENDS not in content:
        bounds.check_count(content, scene_named(content.get("scene"), find), store)
    study = Study.known(content, find, store.definition)
    bounds.check_size(study)
    cost = estimate(study.checked(), store, bounds)
    return Examined(study, list(study.run_ids()), cost)
