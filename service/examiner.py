"""Studies examined before they are accepted.

To check and name every run of a large study takes seconds of computing, and the memory that goes
with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from service.guarded import Guarded
from service.settings import Settings
from studies import Bounds, Estimate, Store, Study, estimate

WAITING = 100
"""Studies that may wait to be examined."""
SECONDS = 120
"""Time that the examination of a study may take."""


@dataclass(frozen=True, slots=True)
class Examined:
    """A study that may be accepted.

    Attributes
    ----------
    study : checked
    runs : ids of its runs in the order of its cases
    estimate : what it costs
    """

    study: Study
    runs: list[str]
    estimate: Estimate


class Examiner:
    """Examines studies, one after the other.

    Parameters
    ----------
    settings : what a study may cost
    """

    def __init__(self, settings: Settings) -> None:
        self.directory, self.bounds = settings.data.resolve(), settings.bounds
        self.process = Guarded("study", WAITING, SECONDS)

    async def examine(self, content: Mapping[str, Any]) -> Examined:
        """Return the study that ``content`` describes.

        Raises
        ------
        StudyError
            For anything wrong with it, or when it asks for more than the settings allow.
        Busy
            If too many others wait, or the process was killed.
        """
        what = dict(content), self.directory, self.bounds
        name = content.get("name")
        async with self.process.turn():
            return await self.process.call(examined, *what, name=name, advice=": sweep less")


def examined(content: dict[str, Any], directory: Path, bounds: Bounds) -> Examined:
    """Check a study, name its runs and tell what it costs; in a process of its own."""
    store = Store(directory)
    study = Study.known(content, store.scene)
    bounds.check_size(study)
    runs = list(study.checked().run_ids())
    cost = estimate(study, store)
    bounds.check(cost)
    return Examined(study, runs, cost)
