"""Several studies at once, and a queue that is lost."""

from __future__ import annotations

from typing import Any

import psutil
import pytest

from tests.service.servers import NOWHERE, Server, fake_study, wait_until


def large_study(name: str, paths: int = 60, seconds: float = 0.5, **more: Any) -> dict[str, Any]:
    """Return a study of many paths, each of one run."""
    study = fake_study(name, seconds=seconds)
    study["sweep"] = {"friction": [round(i / 100, 2) for i in range(paths)]}
    return study | more


def test_a_small_study_does_not_wait_for_the_end_of_a_large_one(lively: Server) -> None:
    large = lively.post(large_study("large"))
    wait_until(lambda: lively.study(large)["progress"] > 0)
    small = fake_study("small")
    small["sweep"] = {"load_ratio": [0.75]}
    assert lively.finished(lively.post(small))["status"] == "successful"
    assert lively.study(large)["status"] == "running"
    assert lively.study(large)["progress"] < 90.0
    lively.client.delete(f"/studies/{large}")
    # Gone for good: a lost queue would have it computed to its end.
    wait_until(lambda: lively.client.delete(f"/studies/{large}?purge=true").status_code == 204)


def test_what_two_studies_share_is_computed_once(lively: Server) -> None:
    names = [lively.post(large_study(name, paths=6, seconds=0.4)) for name in ("one", "two")]
    for study_id in names:
        assert lively.finished(study_id)["counts"] == {"ok": 6}
    assert len([line for line in lively.computed() if '"seconds": 0.4' in line]) == 6


@pytest.mark.long
def test_the_greater_priority_goes_first(mortal: Server, service: Server) -> None:
    """Both services have one worker, which tells what it computes where the first one has it."""
    mortal.settings = service.settings | {"RESIDUA_STUDIES_AT_ONCE": "1"}
    mortal.start()
    first = mortal.post(large_study("first", paths=3))
    wait_until(lambda: mortal.study(first)["status"] == "running")
    ids = {}
    for friction, priority in ((0.91, 0), (0.92, 7)):
        study = fake_study(f"priority-{priority}", seconds=0.1)
        study["sweep"] = {"friction": [friction]}
        ids[priority] = mortal.post(study | {"priority": priority})
        assert mortal.study(ids[priority])["priority"] == priority
    for study_id in ids.values():
        mortal.finished(study_id)
    assert ["0.92" in line for line in service.computed()[-2:]] == [True, False]
    for route in ("/studies", "/estimate"):
        refused = mortal.client.post(route, json=study | {"priority": 1000})
        assert refused.status_code == 422
        assert refused.json()["errors"][0]["field"] == "priority"


@pytest.mark.long
def test_the_death_of_the_workers_process_is_made_good(lively: Server) -> None:
    before = len(lively.computed())
    study_id = lively.post(large_study("orphaned", paths=12, seconds=0.3))
    wait_until(lambda: len(lively.computed()) >= before + 2)
    assert lively.process is not None
    family = psutil.Process(lively.process.pid).children(recursive=True)
    (pool,) = (each for each in family if each.name() == "service.pool" != each.parent().name())
    pool.kill()
    assert lively.finished(study_id)["counts"] == {"ok": 12}


def test_a_lost_queue_is_made_anew_from_the_studies(lively: Server) -> None:
    done, failed = lively.post(fake_study("done")), lively.post(fake_study("f", behaviour="limit"))
    ends = {study_id: lively.finished(study_id) for study_id in (done, failed)}
    ended = len(lively.computed())
    running = lively.post(large_study("running", paths=12, seconds=0.25))
    wait_until(lambda: lively.study(running)["progress"] > 0)
    queue = lively.data / "jobs.sqlite"
    queue.unlink()
    queue.write_text("no queue" * 1000)
    seen = [lively.client.get("/health")]
    wait_until(lambda: seen.append(lively.client.get("/health")) or seen[-1].status_code == 200)
    if seen[0].status_code != 200:
        assert seen[0].json()["queue_readable"] is False
    for study_id, end in ends.items():  # the first that needs the queue may find it lost
        wait_until(lambda s=study_id: lively.client.get(f"/studies/{s}").status_code != 503)
        found = lively.study(study_id)
        for part in ("status", "message", "counts", "runs", "sweep"):
            assert found[part] == end[part]
    assert lively.finished(running)["counts"] == {"ok": 12}
    more = lively.computed()[ended:]
    assert len([line for line in more if '"seconds": 0.25' in line]) == len(more) <= 12 + 2


def test_a_study_that_nobody_computes_says_so(mortal: Server) -> None:
    """A scheduler that nobody answers for. `test_runner` shows that patience has an end."""
    mortal.settings = NOWHERE | {"RESIDUA_GRACE_SECONDS": "1"}
    mortal.start()
    study_id = mortal.post(fake_study("alone"))
    waiting = wait_until(lambda: mortal.client.get("/health").json()["waiting"])
    assert "no scheduler answers" in waiting[study_id]
    assert mortal.client.get("/health").json()["status"] == "waiting"
    assert mortal.client.delete(f"/studies/{study_id}").json()["status"] == "dismissed"
