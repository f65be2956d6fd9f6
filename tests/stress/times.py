"""A clock that is set back, and results that are too old or too large while others are computed."""

from __future__ import annotations

import os
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Any

from service.jobs import Jobs, put
from tests.service.servers import Server, fake_study, wait_until
from tests.stress.measure import Figure, restarted

AHEAD = timedelta(days=2)


def clock(server: Server) -> list[Figure]:
    """A clock that is set back by two days: all that is stored is of the day after tomorrow."""
    before = [server.finished(server.post(study(name))) for name in ("first", "second")]
    waiting = server.post(study("waiting", seconds=0.5))
    wait_until(lambda: server.study(waiting)["counts"].get("ok", 0) >= 1)
    server.stop()
    for path in server.data.rglob("*"):
        ahead = path.stat().st_mtime + AHEAD.total_seconds()
        os.utime(path, (ahead, ahead))
    jobs = Jobs(server.data / "jobs.sqlite")
    with jobs.transaction() as queue:
        for job in jobs.page(limit=10, offset=0)[0]:
            times: dict[str, Any] = {
                name: (datetime.fromisoformat(value) + AHEAD).isoformat()
                for name in ("submitted", "started", "finished")
                if (value := getattr(job, name))
            }
            put(queue, replace(job, **times))
    restarted(server, RESIDUA_KEEP_DAYS="1")
    after = server.finished(server.post(study("after")))
    ends = [server.finished(each) for each in (*(b["id"] for b in before), waiting)]
    sent = [server.client.get(f"/studies/{each['id']}/dataset.nc") for each in (*ends, after)]
    listed = server.client.get("/studies").json()["items"]
    return [
        Figure("studies that are not successful", bad([*ends, after]), most=0),
        Figure("data sets not sent", sum(each.status_code != 200 for each in sent), most=0),
        Figure(
            "the latest study is not the first of the list", listed[0]["name"] != "after", "", 0
        ),
    ]


def retention(server: Server) -> list[Figure]:
    """Studies beyond age and size, which share runs with one that is computed."""
    old = server.finished(server.post(study("old")))
    running = server.post(study("running", seconds=0.5) | {"sweep": {"friction": FRICTIONS}})
    shared = server.post(fake_study("shared") | {"sweep": {"friction": [0.0, 0.3]}})
    server.finished(shared)
    figures = []
    for name, value in (("RESIDUA_KEEP_DAYS", "1e-9"), ("RESIDUA_KEEP_BYTES", "0")):
        restarted(server, **{name: value})  # it looks at once
        wait_until(lambda: server.client.get(f"/studies/{old['id']}").status_code == 404)
        figures.append(Figure(f"{name}: the running study is gone", gone(server, running), most=0))
        server.settings.pop(name)
    end = server.finished(running)
    lost = len(FRICTIONS) - end["counts"].get("ok", 0)
    return [*figures, Figure("runs of it that are lost", lost, most=0)]


FRICTIONS = [k / 20 for k in range(20)]


def study(name: str, seconds: float = 0.0) -> dict[str, Any]:
    """Return a study of four runs."""
    return fake_study(name, seconds=seconds)


def bad(ended: list[dict[str, Any]]) -> int:
    """Return how many studies have not ended well."""
    return sum(each["status"] != "successful" for each in ended)


def gone(server: Server, study_id: str) -> bool:
    """Whether the service does not know a study."""
    return server.client.get(f"/studies/{study_id}").status_code == 404
