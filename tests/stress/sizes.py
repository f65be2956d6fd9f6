"""Large studies, and small ones beside them."""

from __future__ import annotations

import time
from typing import Any

from studies import Store
from tests.service.servers import Server, fake_study, wait_until
from tests.stress.measure import Figure, cpu_seconds, megabytes, process_of

RUNS = 20_000
REST = 4.0
"""Seconds in which the service has the process for the next study ready."""


def one_run(name: str, friction: float) -> dict[str, Any]:
    """Return a study of one run that takes no time."""
    study = fake_study(name)
    study["sweep"] = {"friction": [friction]}
    return study


def seconds_for(server: Server, study: dict[str, Any]) -> float:
    """Return how long a study takes from its submission to its end, some time after the last."""
    time.sleep(REST)
    began = time.monotonic()
    study_id = server.post(study)

    def ended() -> bool:
        return server.client.get(f"/studies/{study_id}").json()["status"] == "successful"

    wait_until(ended)
    return time.monotonic() - began


def large_study(server: Server) -> list[Figure]:
    """20 000 runs: how soon they begin, and a study of one run beside them."""
    process = process_of(server)
    seconds_for(server, one_run("warm", 0.99))  # the workers are there
    alone = min(seconds_for(server, one_run(f"alone-{i}", 0.98 - i / 100)) for i in range(3))
    time.sleep(REST)
    before, done, cpu = megabytes(process), len(server.computed()), cpu_seconds(process)
    study = fake_study("large", seconds=0.05)
    study["sweep"] = {
        "load_ratio": [0.1 * i for i in range(1, 11)],
        "friction": [i / (RUNS // 10) for i in range(RUNS // 10)],
    }
    began = time.monotonic()
    study_id = server.post(study)
    accepted = time.monotonic() - began
    taken = cpu_seconds(process) - cpu
    wait_until(lambda: len(server.computed()) > done)
    started = time.monotonic() - began
    beside = min(seconds_for(server, one_run(f"beside-{i}", 0.95 - i / 100)) for i in range(3))
    after = megabytes(process)
    children = [each for each in process.children(recursive=True) if each.name() == "service.child"]
    computing = max(megabytes(each) for each in children)
    server.client.delete(f"/studies/{study_id}")
    return [
        Figure("20 000 runs: accepted after", accepted, "s"),
        Figure("20 000 runs: CPU of the service itself", taken, "s"),
        Figure("20 000 runs: first run computed after", started, "s", most=2.0),
        Figure("one run alone", alone, "s"),
        Figure("one run beside them: more than alone", beside - alone, "s", most=3.0),
        Figure("memory the service has gained", after - before, "MB", most=30.0),
        Figure("memory of the process that computes them", computing, "MB"),
        Figure("processes beside it, one of which stands ready", len(children) - 1, most=1),
    ]


def last_page(server: Server) -> list[Figure]:
    """A catalogue of 100 000 runs: its last page."""
    server.finished(server.post(one_run("row", 0.5)))
    server.stop()
    store = Store(server.data)
    row = store.catalogue.runs(limit=1)[0][0]
    rows = ({**row, "id": f"{number:032x}"} for number in range(100_000))
    with store.writing():
        store.catalogue.put(rows)
        cpu = time.process_time()
        page, total = store.catalogue.runs(limit=100, offset=99_900)
        taken = time.process_time() - cpu
        store.catalogue.remove(f"{number:032x}" for number in range(100_000))
    server.start()
    assert total >= 100_000
    assert len(page) == 100
    return [Figure("last page of 100 000 runs: CPU", taken, "s", most=0.2)]
