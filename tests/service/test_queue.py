"""The queue alone, without processes."""

from __future__ import annotations

import os
import sqlite3
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import h5py
import pytest

from service.errors import Busy, Conflict, NotFound, QueueLost
from service.job import StudyState
from service.jobs import Jobs, forget
from service.overview import log_of
from service.recovery import open_queue
from studies import Store, StoreBusy, Study
from studies.storage.claims import lock
from studies.storage.seal import seal
from tests.studies.test_goal import search_here

STUDY = {"name": "a", "scene": "fake", "parameters": {}, "sweep": {}}
STEPS = {"name": "a", "scene": "punch", "parameters": {"load_ratio": 1.0}}


@pytest.fixture
def jobs(tmp_path: Path) -> Jobs:
    """An empty queue."""
    return Jobs(tmp_path / "jobs.sqlite")


def taken(jobs: Jobs, *busy: str) -> str | None:
    """Return the id of the job whose turn it is."""
    job = jobs.take(busy)
    return job.id if job else None


def test_a_reason_of_several_lines_is_one_line_of_the_log(jobs: Jobs, tmp_path: Path) -> None:
    jobs.accept("a", STUDY, [])
    jobs.take()
    jobs.finish("a", StudyState.FAILED, "no worker\nis left")
    log = log_of(jobs.get("a"), jobs, Store(tmp_path / "out")).splitlines()
    assert [line.split("  ", 1)[1] for line in log] == [
        "accepted", "running", "failed: no worker is left",
    ]  # fmt: skip


@pytest.mark.parametrize("column", ["name", "turn", "bytes", "study"])
def test_a_job_lacks_nothing_but_the_times_that_have_not_come(jobs: Jobs, column: str) -> None:
    jobs.accept("a", STUDY, [])
    with closing(sqlite3.connect(jobs.path)) as connection, connection:
        connection.execute("UPDATE job SET started = NULL, finished = NULL")
        with pytest.raises(sqlite3.IntegrityError, match=f"NOT NULL .* job.{column}"):
            connection.execute(f"UPDATE job SET {column} = NULL")


def test_first_come_first_served(jobs: Jobs) -> None:
    order = ["c", "a", "b"]
    for name in order:
        jobs.accept(name, STUDY, ["run"])
    served = []
    while (name := taken(jobs)) is not None:
        served.append(name)
        jobs.finish(name, StudyState.SUCCESSFUL, "")
    assert served == order


def test_the_greater_priority_comes_first(jobs: Jobs) -> None:
    for name, priority in (("a", 0), ("b", -1), ("c", 5), ("d", 5)):
        jobs.accept(name, STUDY, [name], priority)
    served = [taken(jobs)]
    while served[-1] is not None:
        served.append(taken(jobs, *served))
    assert served == ["c", "d", "a", "b", None]


def test_a_place_may_be_kept_for_a_small_study(jobs: Jobs) -> None:
    jobs.accept("large", STUDY, [f"{number}" for number in range(5)])
    jobs.accept("small", STUDY, ["run"])
    assert jobs.take(largest=4).id == "small"
    assert jobs.take(["small"], largest=4) is None
    assert jobs.take(["small"]).id == "large"


def test_studies_that_share_a_run_are_computed_one_after_the_other(jobs: Jobs) -> None:
    for name, runs in (("a", ["x", "y"]), ("b", ["y", "z"]), ("c", ["w"])):
        jobs.accept(name, STUDY, runs)
    assert taken(jobs) == "a"
    assert taken(jobs, "a") == "c"
    assert taken(jobs, "a", "c") is None
    jobs.finish("a", StudyState.SUCCESSFUL, "")
    assert taken(jobs, "c") == "b"


def test_no_more_studies_wait_than_may(tmp_path: Path) -> None:
    jobs = Jobs(tmp_path / "jobs.sqlite", longest=2)
    for name in "ab":
        jobs.accept(name, STUDY, ["run"])
    with pytest.raises(Busy, match="2 studies wait already"):
        jobs.accept("c", STUDY, ["run"])
    assert jobs.accept("a", STUDY, ["run"])[1] is False
    jobs.take()
    assert jobs.accept("c", STUDY, ["run"])[1] is True


def spoil(jobs: Jobs, job_id: str, column: str, value: object) -> None:
    """Write nonsense into the row of a job."""
    with closing(sqlite3.connect(jobs.path)) as connection, connection:
        connection.execute(f"UPDATE job SET {column} = ? WHERE id = ?", (value, job_id))


@pytest.mark.parametrize("nonsense", [("state", "odd"), ("state", b"\xff"), ("study", "{")])
def test_a_row_that_cannot_be_read_is_damage_of_the_queue(
    tmp_path: Path, nonsense: tuple[str, object]
) -> None:
    store, study = Store(tmp_path), Study.from_dict(STEPS)
    store.save_study(study)
    jobs, (column, value) = open_queue(tmp_path / "jobs.sqlite", store, None), nonsense
    spoil(jobs, study.id, column, value)
    with pytest.raises(QueueLost, match="damaged"):
        jobs.check()
    (job,), _ = open_queue(jobs.path, store, None).page(limit=9, offset=0)
    assert (job.id, job.state) == (study.id, StudyState.ACCEPTED)
    assert (tmp_path / "unreadable" / "jobs.sqlite").exists()


@pytest.mark.parametrize("form", [0, 4, 99])
def test_a_queue_of_another_form_is_set_aside_and_made_anew(tmp_path: Path, form: int) -> None:
    store, study = Store(tmp_path), Study.from_dict(STEPS)
    store.save_study(study)
    jobs = open_queue(tmp_path / "jobs.sqlite", store, None)
    with closing(sqlite3.connect(jobs.path)) as connection, connection:
        connection.execute(f"PRAGMA user_version = {form}")
    with pytest.raises(QueueLost, match=f"it has form {form}, not"):
        Jobs(jobs.path)
    (job,), _ = open_queue(jobs.path, store, None).page(limit=9, offset=0)
    assert (job.id, job.state) == (study.id, StudyState.ACCEPTED)
    assert (tmp_path / "unreadable" / "jobs.sqlite").exists()


def test_a_queue_that_is_gone_is_not_made_anew_behind_the_back_of_its_users(jobs: Jobs) -> None:
    jobs.accept("a", STUDY, ["run"])
    jobs.path.unlink()
    with pytest.raises(QueueLost, match=r"jobs\.sqlite is missing or damaged"):
        jobs.get("a")
    assert not jobs.path.exists()


def test_a_damaged_page_is_told(jobs: Jobs) -> None:
    for number in range(200):
        jobs.accept(f"{number}", STUDY, [f"{number}-{run}" for run in range(20)])
    content = bytearray(jobs.path.read_bytes())
    content[4096:] = b"\xff" * (len(content) - 4096)
    jobs.path.write_bytes(content)
    with pytest.raises(QueueLost):
        jobs.page(limit=1000, offset=0)


def test_a_queue_with_one_damaged_page_is_made_anew(tmp_path: Path) -> None:
    path = tmp_path / "jobs.sqlite"
    jobs = Jobs(path)
    for number in range(200):
        jobs.accept(f"{number}", STUDY, [f"{number}-{run}" for run in range(20)])
    content = bytearray(path.read_bytes())
    content[8 * 4096 : 9 * 4096] = b"\xff" * 4096
    path.write_bytes(content)
    assert open_queue(path, Store(tmp_path), None).page(limit=9, offset=0) == ([], 0)
    assert (tmp_path / "unreadable" / "jobs.sqlite").read_bytes() == content


@pytest.mark.parametrize("damage", ["deleted", "overwritten", "emptied", "directory"])
def test_a_queue_that_is_lost_is_made_anew(tmp_path: Path, damage: str) -> None:
    path = tmp_path / "jobs.sqlite"
    Jobs(path).accept("0" * 32, STUDY, ["a"])
    path.unlink()
    if damage == "overwritten":
        path.write_text("no queue" * 1000)
    if damage == "emptied":
        path.touch()
    if damage == "directory":
        path.mkdir()
    store = Store(tmp_path)
    study = Study.from_dict({"name": "a", "scene": "punch", "parameters": {"load_ratio": 1.0}})
    store.save_study(study)
    (job,), _ = open_queue(path, store, None).page(limit=9, offset=0)
    assert (job.id, job.state) == (study.id, StudyState.ACCEPTED)
    assert (tmp_path / "unreadable" / "jobs.sqlite").exists() == (damage != "deleted")


def test_a_study_computed_without_the_service_is_found_when_it_starts(tmp_path: Path) -> None:
    path, store = tmp_path / "jobs.sqlite", Store(tmp_path)
    known = Study.from_dict(STEPS)
    Jobs(path).accept(known.id, known.to_dict(), known.run_ids())
    ended = Study.from_dict(STEPS | {"name": "by-hand", "tags": ["own"]})
    begun = Study.from_dict(STEPS | {"name": "begun"})
    for study in (known, ended, begun):
        store.save_study(study)
    with h5py.File(store.dataset_path(ended.id), "w") as file:
        file["status"] = ["ok"]
    seal(store.dataset_path(ended.id), f"dataset {ended.id}")
    for _ in range(2):
        jobs, total = open_queue(path, store, None).page(limit=9, offset=0)
        assert total == 2
        states = {job.id: job.state for job in jobs}
        assert states == {known.id: StudyState.ACCEPTED, ended.id: StudyState.SUCCESSFUL}
    for which in ({"tag": "own"}, {"name": "by-hand"}):
        (job,), _ = open_queue(path, store, None).page(limit=9, offset=0, **which)
        assert job.name == "by-hand"


def test_in_a_queue_made_anew_what_is_computed_is_running(tmp_path: Path) -> None:
    store = Store(tmp_path)
    punch = {"scene": "punch", "parameters": {"load_ratio": 1.0}}
    studies = [Study.from_dict({"name": name} | punch) for name in ("computed", "waiting")]
    for study in studies:
        store.save_study(study)
    jobs = open_queue(tmp_path / "jobs.sqlite", store, None, [studies[0].id])
    states = [jobs.get(study.id).state for study in studies]
    assert states == [StudyState.RUNNING, StudyState.ACCEPTED]


@pytest.mark.parametrize("end", ["ok", "error"])
def test_a_retry_that_is_computed_forgets_its_old_end_in_a_queue_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: str
) -> None:
    store = Store(tmp_path)
    study = Study.from_dict({"name": "a", "scene": "punch", "parameters": {"load_ratio": 1.0}})
    store.save_study(study)
    monkeypatch.setattr(Store, "outcomes", lambda self, study_id: Counter({end: 1}))
    store.write_run(next(study.cases()), "reason")
    jobs = open_queue(tmp_path / "jobs.sqlite", store, None, [study.id])
    job = jobs.get(study.id)
    assert (job.state, job.message, job.progress) == (StudyState.RUNNING, "", 0)
    left = StudyState.SUCCESSFUL if end == "ok" else StudyState.DISMISSED
    assert jobs.dismiss(study.id).state is left


def test_turns_of_layouts_are_kept_until_their_study_is_deleted(tmp_path: Path) -> None:
    jobs = Jobs(tmp_path / "jobs.sqlite")
    for name in "ab":
        jobs.accept(name, STUDY, [name])
    for turns in ([0, 0, 1], [2, 2, 3], [4, 4, 5]):
        assert [jobs.layout_turn("a", layout) for layout in "xxy"] == turns
    assert jobs.layout_turn("b", "x") == 0
    with jobs.transaction() as connection:
        forget(connection, "a")
    jobs = Jobs(jobs.path)
    assert [jobs.layout_turn(name, "y") for name in "ab"] == [0, 1]


def test_of_two_studies_that_choose_runs_in_a_scene_one_waits(jobs: Jobs) -> None:
    goal = STUDY | {"goal": {"parameter": "load_ratio"}}
    refine = STUDY | {"refine": {"of": ["peak_contact_pressure"]}}
    jobs.accept("a", goal, [], most=12, stage="0 of 1 searches ended")
    jobs.accept("b", refine, [], most=12, stage="at most 12 runs")
    jobs.accept("c", goal | {"scene": "punch"}, [], most=12, stage="0 of 1 searches ended")
    jobs.accept("d", STUDY, ["run"])
    assert [taken(jobs), taken(jobs, "a"), taken(jobs, "a", "c")] == ["a", "c", "d"]
    assert taken(jobs, "a", "c", "d") is None
    assert jobs.searches() == {"a": "fake", "b": "fake", "c": "punch"}
    for runs in (["x", "y"], ["y", "z"]):
        jobs.asked("a", runs, "1 of 1 searches ended")
    assert (jobs.runs("a"), jobs.get("a").stage) == (["x", "y", "z"], "1 of 1 searches ended")
    jobs.finish("a", StudyState.SUCCESSFUL, "")
    assert taken(jobs, "c", "d") == "b"


def test_a_search_without_the_service_is_found_when_it_starts(tmp_path: Path) -> None:
    path, store = tmp_path / "jobs.sqlite", Store(tmp_path)
    goal = {"of": "peak_contact_pressure", "at": 120.0, "between": [0.1, 4.0]}
    ended = Study.from_dict({"name": "ended", "scene": "fake", "goal": goal})
    begun = Study.from_dict({"name": "begun", "scene": "fake", "goal": goal | {"at": 200.0}})
    Jobs(path)
    tried = search_here(ended, store)
    search_here(begun, store, most=2)
    for damaged in (False, True):
        if damaged:
            path.write_text("no queue" * 1000)
        jobs = open_queue(path, store, None)
        job = jobs.get(ended.id)
        assert (job.state, job.stage) == (StudyState.SUCCESSFUL, "1 of 1 searches ended")
        assert {*jobs.runs(ended.id)} == {*tried}
        job = jobs.get(begun.id)
        assert job.stage == "0 of 1 searches ended"
        asked_for = StudyState.ACCEPTED if damaged else StudyState.FAILED
        assert job.state is asked_for, "nobody posted it to the queue that was there"


def test_a_dismissed_retry_of_a_successful_study_leaves_it_successful(jobs: Jobs) -> None:
    jobs.accept("a", STUDY, ["run"])
    for end, left in (
        (StudyState.SUCCESSFUL, StudyState.SUCCESSFUL),
        (StudyState.FAILED, StudyState.DISMISSED),
    ):
        jobs.take()
        jobs.finish("a", end, "")
        jobs.retry("a")
        assert jobs.dismiss("a").state is left
        jobs.retry("a")
        assert taken(jobs) == "a"
        assert jobs.dismiss("a").state is (
            left if left is StudyState.SUCCESSFUL else StudyState.DISMISSED
        )
        jobs.retry("a")


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
    jobs.finish("a", StudyState.FAILED, "reason")
    asked = time.time_ns()
    assert asked <= jobs.retry("a").since <= time.time_ns()
    assert jobs.get("a").progress == 0
    assert taken(jobs) == "b"


def test_a_job_dismissed_while_it_runs_stays_dismissed(jobs: Jobs) -> None:
    jobs.accept("a", STUDY, ["run"])
    jobs.take()
    jobs.dismiss("a")
    jobs.finish("a", StudyState.SUCCESSFUL, "")
    jobs.note("a", 50.0, "late")
    job = jobs.get("a")
    assert (job.state, job.message, job.progress) == (StudyState.DISMISSED, "", 0)
    assert taken(jobs) is None


def test_what_the_state_does_not_allow_is_refused(jobs: Jobs) -> None:
    jobs.accept("a", STUDY, ["run"])
    with pytest.raises(Conflict, match="accepted"):
        jobs.retry("a")
    jobs.take()
    jobs.finish("a", StudyState.SUCCESSFUL, "")
    with pytest.raises(Conflict, match="successful"):
        jobs.dismiss("a")
    for act in (jobs.get, jobs.study, jobs.dismiss, jobs.retry):
        with pytest.raises(NotFound, match="unknown"):
            act("unknown")


def test_of_many_simultaneous_acceptances_one_is_new(jobs: Jobs) -> None:
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda _: jobs.accept("a", STUDY, ["x", "y"])[1], range(32)))
    assert sum(found) == 1
    assert jobs.runs("a") == ["x", "y"] and jobs.get("a").size == 2


def test_a_directory_has_one_owner_at_a_time(tmp_path: Path) -> None:
    path = tmp_path / "service.lock"
    held = lock(path, "is here")
    with pytest.raises(StoreBusy, match=rf"another process \(id {os.getpid()}\) is here"):
        lock(path, "is here", 0.2)
    heirloom = os.dup(held)
    os.close(held)
    with pytest.raises(StoreBusy):
        lock(path, "is here")
    os.close(heirloom)
    os.close(lock(path, "is here"))
