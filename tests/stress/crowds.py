"""Crowds at the door: connections that say nothing, and many who want pictures."""

from __future__ import annotations

import contextlib
import resource
import socket
import time
from concurrent.futures import ThreadPoolExecutor

import httpx

from tests.service.servers import Server, fake_study
from tests.service.test_description import PHASES, explore
from tests.stress.measure import Figure, quantile

SOCKETS = 940
PICTURES = 80


def health_seconds(server: Server, count: int) -> list[float]:
    """Return how long each of some questions for the health took."""
    times = []
    for _ in range(count):
        began = time.monotonic()
        with httpx.Client() as client:  # a new connection each time
            answer = client.get(f"http://127.0.0.1:{server.port}/health", timeout=60.0)
        assert answer.status_code == 200
        times.append(time.monotonic() - began)
    return times


def half_open(server: Server) -> list[Figure]:
    """940 connections that begin a request and do not end it."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    with contextlib.ExitStack() as opened:
        opened.callback(resource.setrlimit, resource.RLIMIT_NOFILE, (soft, hard))
        for _ in range(SOCKETS):
            one = opened.enter_context(socket.create_connection(("127.0.0.1", server.port)))
            one.sendall(b"GET /health HTTP/1.1\r\nHost: 127.0.0.1\r\n")
        times = health_seconds(server, 20)
    return [Figure("health answers within", max(times), "s", most=1.0)]


def description(server: Server) -> list[Figure]:
    """Requests that schemathesis makes from the description of the service."""
    server.finished(server.post(fake_study("computed")))
    found = explore(server, ["--max-examples", "5"], seed=7, whole=True)
    if found.returncode:
        print(found.stdout[-3000:])
    phases = sum(f"✅ {each}" in found.stdout for each in PHASES)
    return [
        Figure("schemathesis finds something", found.returncode, most=0),
        Figure("phases it did not come through", len(PHASES) - phases, most=0),
    ]


def pictures(server: Server) -> list[Figure]:
    """80 pictures asked for at once, and the health meanwhile."""
    study = server.finished(server.post(fake_study("drawn")))
    assert study["status"] == "successful"
    url = f"http://127.0.0.1:{server.port}/runs/{study['runs'][0]['id']}/map.png"

    def draw(number: int) -> int:
        return httpx.get(url, params={"zoom": 0.5 + number / 100}, timeout=120.0).status_code

    with ThreadPoolExecutor(PICTURES) as pool:
        drawn = [pool.submit(draw, number) for number in range(PICTURES)]
        time.sleep(0.3)
        times = health_seconds(server, 20)
        statuses = [each.result() for each in drawn]
    return [
        Figure("pictures drawn", statuses.count(200)),
        Figure("pictures put off (429)", statuses.count(429)),
        Figure("other answers", PICTURES - statuses.count(200) - statuses.count(429), most=0),
        Figure("health answers within", quantile(times, 1.0), "s", most=1.0),
    ]
