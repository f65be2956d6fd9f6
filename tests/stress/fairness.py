"""One caller who asks for much, and the pages of another one meanwhile."""

from __future__ import annotations

import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx

from service.keys import Keys, Scope
from tests.service.servers import Server, fake_study
from tests.stress.measure import Figure, quantile, restarted

RUNS, PREDICTIONS, ESTIMATES, VIEWS = 600, 25, 25, 200

SAMPLE = {
    "method": "sobol",
    "num": RUNS,
    "ranges": {"load_ratio": [0.1, 0.9], "friction": [0.0, 0.9], "seconds": [0.0, 0.001]},
}
LARGE = {
    "name": "large",
    "scene": "punch",
    "sample": {
        "method": "sobol",
        "num": 99_999,
        "ranges": {"load_ratio": [0.1, 0.9], "friction": [0, 1]},
    },
}
ACCEPTED = LARGE | {"sample": LARGE["sample"] | {"num": 2000}}  # type: ignore[operator]
"""A study that is not too large: all its runs are gone through."""


def fairness(server: Server) -> list[Figure]:
    """25 predictions and 50 estimates of one key at once, and the pages of another one."""
    keys = Keys(server.data)
    headers = {
        name: {"authorization": f"Bearer {keys.add(name, Scope.ADMIN)}"}
        for name in ("anna", "bert")
    }
    restarted(server, RESIDUA_REQUIRE_KEYS="true")
    server.client.headers.update(headers["bert"])
    study = server.finished(server.post(fake_study("many") | {"sweep": {}, "sample": SAMPLE}))
    own, run = study["id"], study["runs"][0]["id"]
    small: dict[str, Any] = fake_study("small")
    asks: tuple[tuple[str, str, dict[str, Any]], ...] = (
        ("GET", f"/ui/studies/{own}", {}),
        ("GET", f"/ui/runs/{run}", {}),
        ("GET", f"/runs/{run}/fields", {}),
        ("GET", f"/studies/{own}/table.csv", {}),
        ("GET", "/runs", {}),
        ("POST", "/estimate", {"json": small}),
    )

    def seconds(count: int) -> list[float]:
        times = []
        for number in range(count):
            method, path, content = asks[number % len(asks)]
            began = time.monotonic()
            answer = server.client.request(method, path, **content, timeout=120.0)
            assert answer.status_code == 200, answer.text
            times.append(time.monotonic() - began)
        return times

    statuses = Counter[int]()

    def attack(number: int) -> None:
        with httpx.Client(base_url=server.client.base_url, headers=headers["anna"]) as client:
            if number < PREDICTIONS:
                at = {"load_ratio": 0.3 + number / 100, "friction": 0.4, "seconds": 0.0005}
                given: dict[str, Any] = {"params": {"of": "max_plastic_strain", **at}}
                request = "GET", f"/studies/{own}/predict"
            else:
                given = {"json": (LARGE, ACCEPTED)[number % 2]}
                request = "POST", "/estimate"
            statuses[client.request(*request, **given, timeout=600.0).status_code] += 1

    seconds(2 * len(asks))  # what is loaded once
    idle = quantile(seconds(VIEWS), 0.95)
    with ThreadPoolExecutor(PREDICTIONS + 2 * ESTIMATES) as pool:
        began = time.monotonic()
        asked = [pool.submit(attack, k) for k in range(PREDICTIONS + 2 * ESTIMATES)]
        time.sleep(0.5)
        beside = []
        while not all(each.done() for each in asked):
            beside += seconds(len(asks))
        for each in asked:
            each.result()
        took = time.monotonic() - began
    return [
        Figure("answers that the one key gets", statuses[200] + statuses[422]),
        Figure("put off, because its time is used (429)", statuses[429]),
        Figure(
            "other answers",
            sum(statuses.values()) - statuses[200] - statuses[422] - statuses[429],
            most=0,
        ),
        Figure("until the last of them", took, "s"),
        Figure("pages of the other key alone: 95 % within", idle, "s"),
        Figure("views meanwhile", len(beside)),
        Figure("beside them: 95 % within", quantile(beside, 0.95), "s", most=max(3 * idle, 0.5)),
        Figure("the slowest of them", max(beside, default=0.0), "s"),
    ]
