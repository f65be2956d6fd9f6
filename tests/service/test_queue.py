"""The queue alone, without processes."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from service.errors import Conflict, NotFound
from service.jobs import Jobs, State
from service.lock import DirectoryInUse, lock_directory

STUDY = {"name": "a", "scene": "fake", "parameters": {}, "sweep": {}}


@pytest.fixture
def jobs(tmp_path: Path) -> Jobs:
    """An empty queue."""
    return Jobs(tmp_path / "jobs.sqlite")


def taken(jobs: Jobs) -> str | None:
    """Return the id of the job whose turn it is."""
    job = jobs.take()
    return job.id if job else None


def test_first_come_first_served(jobs: Jobs) -> None:
    order = ["c", "a", "b"]
    for name in order:
        jobs.accept(name, STUDY, ["run"])
    served = []
    while (name := taken(jobs)) is not None:
        served.append(name)
        jobs.finish(name, State.SUCCESSFUL, "")
    assert served == order


def test_a_running_job_is_taken_again_by_the_next_service(jobs: Jobs) -> None:
    for name in "ab":
        jobs.accept(name, STUDY, ["run"])
    assert taken(jobs) == "a"
    assert taken(Jobs(jobs.path)) == "a"


def test_a_retried_job_waits_behind_the_others(jobs: Jobs) -> None:
    for name in "ab":
        jobs.accept(name, STUDY, ["run"])
    assert taken(jobs) == "a"
    jobs.note("a", 100.0)
    jobs.finish("a", State.FAILED, "reason")
    assert (jobs.retry("a").again, jobs.get("a").progress) == (True, 0)
    assert taken(jobs) == "b"


def test_a_job_dismissed_while_it_runs_stays_dismissed(jobs: Jobs) -> None:
    jobs.accept("a", STUDY, ["run"])
    jobs.take()
    jobs.dismiss("a")
    jobs.finish("a", State.SUCCESSFUL, "")
    jobs.note("a", 50.0, "late")
    job = jobs.get("a")
    assert (job.state, job.message, job.progress) == (State.DISMISSED, "", 0)
    assert taken(jobs) is None


def test_what_the_state_does_not_allow_is_refused(jobs: Jobs) -> None:
    jobs.accept("a", STUDY, ["run"])
    with pytest.raises(Conflict, match="accepted"):
        jobs.retry("a")
    jobs.take()
    jobs.finish("a", State.SUCCESSFUL, "")
    with pytest.raises(Conflict, match="successful"):
        jobs.dismiss("a")
    for act in (jobs.get, jobs.runs, jobs.dismiss, jobs.retry):
        with pytest.raises(NotFound, match="unknown"):
            act("unknown")


def test_of_many_simultaneous_acceptances_one_is_new(jobs: Jobs) -> None:
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda _: jobs.accept("a", STUDY, ["x", "y"])[1], range(32)))
    assert sum(found) == 1
    assert jobs.runs("a") == ["x", "y"] and jobs.get("a").size == 2


def test_a_directory_has_one_owner_at_a_time(tmp_path: Path) -> None:
    lock = lock_directory(tmp_path, 0.0)
    with pytest.raises(DirectoryInUse, match="another service"):
        lock_directory(tmp_path, 0.2)
    heirloom = os.dup(lock)
    os.close(lock)
    with pytest.raises(DirectoryInUse):
        lock_directory(tmp_path, 0.0)
    os.close(heirloom)
    os.close(lock_directory(tmp_path, 0.0))
