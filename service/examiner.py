"""Studies looked at before they are accepted.

To check and name every run of a large study takes seconds of computing, and the memory that goes
with it. A process of its own does it, so that other requests are answered meanwhile.
"""

from __future__ import annotations

import resource
import signal
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from anyio import BrokenWorkerProcess, CapacityLimiter, fail_after
from anyio.to_process import run_sync

from service.errors import Busy
from service.settings import Settings
from studies import Bounds, Estimate, Store, Study, StudyError, estimate

WAITING = 100
"""Studies that may wait to be examined."""
SECONDS = 120
"""Time that the examination of a study may take."""
BYTES = 8 * 2**30
"""Address space of the process that examines."""


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
        self.one = CapacityLimiter(1)

    async def examine(self, content: Mapping[str, Any]) -> Examined:
        """Return the study that ``content`` describes.

        Raises
        ------
        StudyError
            For anything wrong with it, or when it asks for more than the settings allow.
        Busy
            If too many others wait, or the process was killed.
        """
        if self.one.statistics().tasks_waiting >= WAITING:
            raise Busy(f"{WAITING} studies wait to be examined already: ask later")
        what = dict(content), self.directory, self.bounds
        try:
            async with self.one:
                with fail_after(SECONDS):
                    return await run_sync(examined, *what, cancellable=True)
        except BrokenWorkerProcess:
            raise Busy("the process that examines studies has ended: ask again") from None
        except (TimeoutError, MemoryError):
            allowed = f"must be examined within {SECONDS} s and {BYTES >> 30} GiB of memory"
            raise StudyError("study", content.get("name"), f"{allowed}: sweep less") from None


def examined(content: dict[str, Any], directory: Path, bounds: Bounds) -> Examined:
    """Check a study, name its runs and tell what it costs; in a process of its own."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is the service's to handle
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    store = Store(directory)
    study = Study.known(content, store.scene)
    bounds.check_size(study)
    runs = list(study.checked().run_ids())
    cost = estimate(study, store)
    bounds.check(cost)
    return Examined(study, runs, cost)
