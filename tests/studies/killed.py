"""A command that computes a study, and is killed while it does."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil

from tests.architecture.sources import ROOT


def runs_before_a_kill(command: str, study: Path, out: Path, least: int) -> set[str]:
    """Return the ids of the runs that a command has stored when it is killed.

    Parameters
    ----------
    command : ``run`` or ``fit``
    study, out : the study file, and the output directory
    least : number of stored runs at which it is killed
    """
    more = ["-m", "tests.residua.command", command, str(study), "--out", str(out)]
    with subprocess.Popen(
        [sys.executable, *more, "--workers", "1"], cwd=ROOT,
        stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL, start_new_session=True,
    ) as parent:  # fmt: skip
        deadline = time.monotonic() + 60.0
        while len(list(out.glob("runs/*.nc"))) < least:
            assert time.monotonic() < deadline
            time.sleep(0.05)
        family = psutil.Process(parent.pid).children(recursive=True)
        parent.send_signal(signal.SIGKILL)
    assert psutil.wait_procs(family, timeout=10)[1] == []
    return {path.stem for path in out.glob("runs/*.nc")}
