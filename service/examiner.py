"""The process that looks at studies before they are accepted.

To check and name every run of a large study takes seconds of computing, and the memory that goes
with it. A process of its own does it, so that other requests are answered meanwhile.
"""

from __future__ import annotations

import asyncio
import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import AsyncIterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from service.settings import Settings
from studies import Bounds, Estimate, Store, Study, estimate


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
        self._directory, self._bounds = settings.data.resolve(), settings.bounds
        self._process = self._start()

    @contextlib.asynccontextmanager
    async def working(self) -> AsyncIterator[None]:
        """Have the process ready while the context is open."""
        self._process.submit(int)  # imports what it needs before the first study comes
        try:
            yield
        finally:
            await asyncio.to_thread(self._process.shutdown, cancel_futures=True)

    async def examine(self, content: Mapping[str, Any]) -> Examined:
        """Return the study that ``content`` describes.

        Raises
        ------
        StudyError
            For anything wrong with it, or when it asks for more than the settings allow.
        """
        for last in (False, True):
            try:
                running = asyncio.get_running_loop()
                return await running.run_in_executor(
                    self._process, examined, dict(content), self._directory, self._bounds
                )
            except BrokenProcessPool:  # such as one that was killed
                self._process = self._start()
                if last:
                    raise
        raise AssertionError("unreachable")

    def _start(self) -> ProcessPoolExecutor:
        spawn = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(1, mp_context=spawn, initializer=_attend)


def examined(content: dict[str, Any], directory: Path, bounds: Bounds) -> Examined:
    """Check a study, name its runs and tell what it costs; in the examiner's process."""
    study = Study.known(content)
    bounds.check_size(study)
    runs = list(study.checked().run_ids())
    cost = estimate(study, Store(directory))
    bounds.check(cost)
    return Examined(study, runs, cost)


def _attend() -> None:
    """Leave an interrupt from a terminal to the service, and end when the service dies."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    service = multiprocessing.parent_process()
    assert service is not None

    def watch() -> None:
        service.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
