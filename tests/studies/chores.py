"""Small tasks for workers, without the solver."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from studies.execution.task import Unfit


def nap(
    seconds: float, report: Callable[[dict[str, Any]], None], should_stop: Callable[[], bool]
) -> None:
    """Sleep in small steps, as a loading path is walked."""
    end = time.monotonic() + seconds
    report({"pid": os.getpid(), "seconds": seconds})
    while time.monotonic() < end and not should_stop():
        time.sleep(0.02)


def freeze(
    task: tuple[str, float],
    report: Callable[[dict[str, Any]], None],
    should_stop: Callable[[], bool],
) -> None:
    """Sleep, or stop the process as a debugger would; `task` says which."""
    if task[0] == "freeze":
        report({"pid": os.getpid()})
        time.sleep(1.0)  # the report is on its way
        os.kill(os.getpid(), signal.SIGSTOP)
    nap(task[1], report, should_stop)


def chatter(
    seconds: float, report: Callable[[dict[str, Any]], None], should_stop: Callable[[], bool]
) -> None:
    """Report without end, unless told to stop."""
    while not should_stop():
        report({"pid": os.getpid()})
        time.sleep(0.05)


def need(
    file: str, report: Callable[[dict[str, Any]], None], should_stop: Callable[[], bool]
) -> None:
    """Refuse while a file is absent."""
    time.sleep(0.1)
    if not Path(file).exists():
        raise Unfit("lacks the file")
    report({"file": file})
