"""A process that computes a study, and is killed while it does."""

from __future__ import annotations

import multiprocessing
import time
from pathlib import Path

from studies import Store, Study, run_study

FORK = multiprocessing.get_context("fork")


def runs_before_a_kill(study: Study, out: Path, least: int) -> set[str]:
    """Return the ids of the runs that a process has stored when it is killed.

    Parameters
    ----------
    study, out : the study, and the output directory
    least : number of stored runs at which it is killed
    """
    process = FORK.Process(target=run_study, args=(study, Store(out)), kwargs={"workers": 0})
    process.start()
    deadline = time.monotonic() + 60.0
    while len(list(out.glob("runs/*.nc"))) < least:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    process.kill()
    process.join()
    return {path.stem for path in out.glob("runs/*.nc")}
