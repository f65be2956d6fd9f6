"""A process that computes a study, and is killed while it does."""

from __future__ import annotations

import multiprocessing
import time
from pathlib import Path

from studies import Store, Study, open_study, run_study

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


def see_it_taken_up(study: Study, out: Path, least: int, runs: str = "tried_run") -> None:
    """Kill the process of a study, compute the study, and see that no run is computed twice.

    `runs` is the variable of its data set that names the runs.
    """
    before = runs_before_a_kill(study, out, least)
    outcome = run_study(study, Store(out), workers=0)
    assert outcome.ok
    assert outcome.computed
    assert not before & set(outcome.computed)
    with open_study(out) as dataset:
        found = {each for each in dataset[runs].to_numpy().flat if each}
    assert found == before | set(outcome.computed)
