"""Many at a time, and clients that never end: nobody else has to wait for them."""

from __future__ import annotations

import asyncio
import contextlib
import re
import resource
import shutil
import socket
import threading
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import anyio.to_thread
import httpx
import psutil
import pytest
from fastapi import FastAPI

from service import metrics
from service.app import create_app
from service.connections import limited
from service.errors import Busy, NoRoom, status_of
from service.examined import examined
from service.jobs import Jobs
from service.maps import Pictures
from service.settings import Settings
from service.turns import Share, Turn, Turns
from studies import Store, StoreFull, Study, StudyError
from studies.errors import Unusable
from tests.counted import counted
from tests.service.servers import COARSE_PUNCH, PATIENCE, Server, fake_study

CONNECTIONS = 120
SECONDS = 1.0
"""Time that the service gives a request to arrive, and a client to read."""

UNFINISHED = (
    b"",
    b"GET /health HTTP/1.1\r\nHost: localhost\r\n",
    b"POST /studies HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
    b"Content-Length: 100\r\n\r\n{",
)
"""Beginnings of requests."""


@pytest.fixture(scope="module")
def strict(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A service with tight limits."""
    limits = {
        "RESIDUA_CONNECTIONS": str(CONNECTIONS),
        "RESIDUA_ARRIVAL_SECONDS": str(SECONDS),
        "RESIDUA_ANSWER_SECONDS": str(SECONDS),
        "RESIDUA_POLL_SECONDS": "1",
    }
    server = Server(tmp_path_factory.mktemp("load"), settings=limits)
    files, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(files, most // 2), most))
    server.start()
    resource.setrlimit(resource.RLIMIT_NOFILE, (files, most))
    yield server
    server.close()


@pytest.fixture(scope="module")
def study(strict: Server) -> dict[str, Any]:
    """A study that was computed there."""
    return strict.finished(strict.post(fake_study("load")))


def connected(server: Server) -> socket.socket:
    """Return a connection of its own."""
    return socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE)


def healthy(server: Server) -> bool:
    """Return whether a stranger is told so in time."""
    answer = httpx.get(f"http://127.0.0.1:{server.port}/health", timeout=20.0)
    return answer.status_code == 200


def rest(connection: socket.socket) -> bytes:
    """Return what the service still sends before it closes a connection."""
    received = b""
    try:
        while part := connection.recv(65536):
            received += part
    except ConnectionResetError:
        pass
    return received


def test_half_open_connections_keep_nobody_out_and_are_closed(strict: Server) -> None:
    with ExitStack() as opened:
        connections = [opened.enter_context(connected(strict)) for _ in range(2 * CONNECTIONS)]
        for position, connection in enumerate(connections):
            with contextlib.suppress(ConnectionError):
                connection.sendall(UNFINISHED[position % 3])
        assert healthy(strict)
        ends = Counter(rest(connection)[:12] for connection in connections)
    assert set(ends) == {b"", b"HTTP/1.1 408"}
    assert ends[b"HTTP/1.1 408"] >= CONNECTIONS // 2, "those that began and were not pushed out"


def test_streams_of_events_keep_nobody_out(strict: Server) -> None:
    study_id = strict.post(fake_study("followed", seconds=30.0))
    asked = f"GET /studies/{study_id}/events HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()
    with ExitStack() as opened:
        for _ in range(CONNECTIONS):
            connection = opened.enter_context(connected(strict))
            connection.sendall(asked)
            assert connection.recv(12) == b"HTTP/1.1 200"
        for _ in range(3):
            assert healthy(strict)
    strict.client.delete(f"/studies/{study_id}")


def test_the_service_may_open_as_many_files_as_the_system_allows(strict: Server) -> None:
    assert strict.process is not None
    now, most = psutil.Process(strict.process.pid).rlimit(psutil.RLIMIT_NOFILE)
    assert now == most


def test_connections_leave_files_for_all_else(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda which: (256, 1024))
    monkeypatch.setattr(resource, "setrlimit", lambda which, limits: None)
    for wanted, given in ((500, 384), (10, 10)):
        assert limited(Settings(connections=wanted)).settings.connections == given


def test_a_system_that_allows_less_than_it_says_gives_what_it_has(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def at_most(which: int, limits: tuple[int, int]) -> None:
        if limits[0] > 10_240:
            raise ValueError("not allowed to raise maximum limit")

    monkeypatch.setattr(resource, "getrlimit", lambda which: (256, 2**63 - 1))
    monkeypatch.setattr(resource, "setrlimit", at_most)
    assert limited(Settings(connections=500)).settings.connections == 500


@pytest.mark.parametrize("begun", UNFINISHED[1:], ids=["head", "body"])
def test_a_request_that_trickles_in_is_ended_with_a_problem(strict: Server, begun: bytes) -> None:
    with connected(strict) as connection:
        connection.sendall(begun)
        start = time.monotonic()
        connection.settimeout(0.1)
        while time.monotonic() < start + 10 * SECONDS:
            try:
                answer = connection.recv(65536)
                break
            except TimeoutError:
                connection.sendall(b"x")
        took = time.monotonic() - start
        connection.settimeout(15.0)
        answer += rest(connection)
    head, _, body = answer.partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 408 ") and b"application/problem+json" in head
    assert b"the request took more than 1.0 s" in body
    assert 0.5 * SECONDS < took < 8 * SECONDS


def test_a_client_that_stops_reading_is_cut_off(strict: Server) -> None:
    asked = b"GET /docs/swagger-ui-bundle.js HTTP/1.1\r\nHost: localhost\r\n\r\n"
    with socket.socket() as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.settimeout(15.0)
        connection.connect(("127.0.0.1", strict.port))
        connection.sendall(20 * asked)
        time.sleep(4 * SECONDS)
        size = len(rest(connection))
    one = len(strict.client.get("/docs/swagger-ui-bundle.js").content)
    assert 0 < size < 20 * one


def test_a_long_answer_and_a_quiet_client_are_no_offence(strict: Server) -> None:
    study_id = strict.post(fake_study("long", seconds=3 * SECONDS) | {"sweep": {}})
    with strict.client.stream("GET", f"/studies/{study_id}/events") as stream:
        story = [line for line in stream.iter_lines() if line.startswith("data:")]
    assert "successful" in story[-1]
    time.sleep(1.5 * SECONDS)
    assert strict.client.get("/health").status_code == 200


def test_health_does_not_wait_for_pictures(strict: Server, study: dict[str, Any]) -> None:
    url = f"/runs/{study['runs'][0]['id']}/map.png"
    # one thread of httpx may close an idle connection that another has just taken: none is kept
    once = {"connection": "close"}

    def draw(zoom: int) -> httpx.Response:
        return strict.client.get(url, params={"zoom": zoom}, headers=once, timeout=120.0)

    with ThreadPoolExecutor(4) as pool:
        asked = [pool.submit(draw, zoom) for zoom in range(1, 5)]
        waited, begun = [], time.monotonic()
        while not all(each.done() for each in asked):
            start = time.monotonic()
            assert strict.client.get("/health", headers=once).status_code == 200
            waited.append(time.monotonic() - start)
            time.sleep(0.05)
        took = time.monotonic() - begun
        answers = [each.result() for each in asked]
    assert max(waited) < max(5.0, took / 2)
    assert {answer.status_code for answer in answers} == {200}


def test_a_picture_is_drawn_once_for_who_asks_again(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[int] = []

    async def apart(self: Turn, draw: object, zoom: int, **limits: object) -> bytes:
        await asyncio.sleep(0.0)
        drawn.append(zoom)
        return bytes(10)

    async def ask() -> None:
        pictures, share = Pictures(memory=25), Share(Turns(2, 60.0), "anna")

        async def get(zoom: int) -> bytes:
            return await pictures.get(str(zoom), share, bytes, zoom, name="a")

        await asyncio.gather(*map(get, (1, 2, 1, 2, 3)))
        assert drawn == [1, 2, 3]
        assert list(pictures.kept) == ["2", "3"], "the bytes are bounded"
        await asyncio.gather(get(2), get(3))
        assert len(drawn) == 3
        await asyncio.gather(get(1), get(3))
        assert len(drawn) == 4
        assert await Pictures(memory=0).get("1", share, bytes, 1, name="a") == bytes(10)

    monkeypatch.setattr(Turn, "apart", apart)
    asyncio.run(ask())


@pytest.fixture
def app(tmp_path: Path) -> FastAPI:
    """An application that has not been started."""
    return create_app(Settings(data=tmp_path / "data"))


async def told(app: FastAPI) -> bool:
    """Return whether the data directory is said to take files."""
    transport = httpx.ASGITransport(app)
    async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
        answer = await asyncio.wait_for(client.get("/health"), 5.0)
    writable: bool = answer.json()["data_writable"]
    return writable


def test_health_needs_no_thread_that_others_use(app: FastAPI) -> None:
    async def crowded() -> bool:
        threads = anyio.to_thread.current_default_thread_limiter()
        for position in range(int(threads.total_tokens)):
            await threads.acquire_on_behalf_of(position)
        return await told(app)

    assert asyncio.run(crowded())


def test_a_directory_that_hangs_is_told(app: FastAPI, monkeypatch: pytest.MonkeyPatch) -> None:
    hanging = threading.Event()
    monkeypatch.setattr(metrics, "SECONDS", 0.2)
    asked: list[Any] = []
    monkeypatch.setattr(
        metrics, "look", lambda *given: (asked.append(given), (hanging.wait(20.0), {}))[1]
    )

    async def twice() -> list[bool]:
        answers = [await told(app), await told(app)]
        hanging.set()
        return answers

    assert asyncio.run(twice()) == [False, False]
    assert len(asked) == 1


@pytest.mark.parametrize(
    ("failed", "status", "detail"),
    [
        (StoreFull("/srv/anna"), 507, "no room is left on the disk of the data directory"),
        (Unusable("directory", "/srv/anna", "must be one"), 503, "directory: must be one"),
    ],
    ids=["full", "read-only"],
)
def test_a_directory_that_cannot_be_written_in_is_told_without_its_path(
    app: FastAPI, monkeypatch: pytest.MonkeyPatch, failed: Exception, status: int, detail: str
) -> None:
    def save(self: Store, study: Study, keep: bool) -> Path:
        raise failed

    async def post() -> httpx.Response:
        study = {"name": "a", "scene": "punch", "sweep": {"friction": [0.0]}}
        transport = httpx.ASGITransport(app)
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
            return await client.post("/studies", json=study)

    monkeypatch.setattr(Store, "save_study", save)
    answer = asyncio.run(post())
    assert (answer.status_code, answer.json()["detail"]) == (status, detail)
    assert "anna" not in answer.text and int(answer.headers["retry-after"]) > 0


def test_a_full_disk_is_not_writable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store, jobs = Store(tmp_path), Jobs(tmp_path / "jobs.sqlite")
    assert metrics.look(store, jobs)["data_writable"]
    full = Path("/dev/full")
    monkeypatch.setattr(metrics.tempfile, "TemporaryFile", lambda dir: full.open("r+b"))
    assert "data_writable" not in metrics.look(store, jobs)


def test_a_study_larger_than_the_free_disk_or_the_default_limits_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    free = 66_000_000_000
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=free))
    bounds = Settings(data=tmp_path).bounds
    axes = {"friction": [i / 1000 for i in range(200)], "load_ratio": [0.2, 0.3, 0.4, 0.5]}
    study = {"name": "a", "scene": "punch", "parameters": COARSE_PUNCH, "sweep": axes}
    one = examined(study, tmp_path, bounds)
    two = examined(study | {"parameters": COARSE_PUNCH | {"load_step": 0.07}}, tmp_path, bounds)
    app = create_app(Settings(data=tmp_path))
    keeper, jobs, found = app.state.keeper, app.state.jobs, one.estimate
    free = 1_500_000_000
    with pytest.raises(NoRoom, match=r"takes about 1\.58 GB, and 1\.5 GB are free on the disk of"):
        keeper.accept(one, 0)
    assert status_of(NoRoom("")) == 507
    free = round(found.bytes) - 1
    with pytest.raises(NoRoom, match=r"takes about 1\.58\d+ GB, and 1\.58\d+ GB are free") as told:
        keeper.accept(one, 0)
    assert len(set(re.findall(r"[\d.]+ GB", str(told.value)))) == 2
    free = 3_000_000_000
    keeper.accept(one, 0)
    for check in (keeper.check_room, lambda found: keeper.accept(found, 0)):
        with pytest.raises(NoRoom, match=r"3 GB are free .* studies before it take 1\.58 GB"):
            check(two)
    assert keeper.accept(one, 0)[1] is False, "it is promised once"
    jobs.take()
    jobs.note(one.study.id, 80.0)
    assert jobs.promised("") == pytest.approx(0.6 * found.bytes)
    jobs.longest = 0
    with pytest.raises(Busy):
        keeper.accept(two, 0)
    assert keeper.store.study_ids() == [one.study.id], "what is refused does not stay"
    jobs.longest = None
    keeper.accept(two, 0)
    jobs.dismiss(one.study.id)
    assert jobs.promised(two.study.id) == 0.0
    with pytest.raises(StudyError, match="cpu_seconds = 61000: at most 50000: use fewer runs"):
        bounds.check(replace(found, cpu_seconds=(1.0, 61_000.0, 1e9)))
    with pytest.raises(StudyError, match=r"bytes = 198000000000: at most 5e\+10: use fewer runs"):
        bounds.check(replace(found, bytes=198_000_000_000))


MANY = {"start": 0.1, "stop": 0.5, "num": 2000}
SAMPLE = {"method": "sobol", "num": 99_999, "ranges": {"friction": [0.0, 0.5]}}
BASE: dict[str, Any] = {"name": "b", "scene": "punch", "parameters": COARSE_PUNCH}
EXTENDING = {"extends": BASE | {"sweep": {"friction": [0.1, 0.2, 0.3, 0.4]}}, "parameters": {}}
HALF = {"start": 0.1, "stop": 0.5, "num": 24_997}


@pytest.mark.parametrize(
    ("content", "allowed", "most"),
    [
        ({"sample": SAMPLE}, r"estimate\.bytes = 197998020000: at most 5e\+10", 10_000),
        ({"sweep": {"a": SAMPLE, "load_ratio": [0.2, 0.3]}}, "at most 100000 runs", 10_000),
        ({"sweep": {"friction": MANY}}, r"estimate\.cpu_seconds = 100: at most 100", 1_300_000),
        (EXTENDING | {"sample": SAMPLE}, r"estimate\.bytes = 197998020000", 10_000),
        (
            {"extends": BASE | {"sample": SAMPLE}, "sweep": {"friction": [0.1]}},
            "bytes = 1979",
            10_000,
        ),
        (EXTENDING | {"sweep": {"load_ratio": HALF}}, r"estimate\.bytes = 1979", 2_500_000),
    ],
    ids=["bytes", "axes", "time", "added", "extended", "both"],
)
def test_a_study_too_large_is_refused_before_its_runs_are_made(
    tmp_path: Path, content: dict[str, Any], allowed: str, most: int
) -> None:
    """All 2000 paths would take 1.6 million calls, those up to the bound take a million."""
    bounds = Settings(data=tmp_path, max_cpu_seconds=100.0).bounds
    study = {"name": "a", "scene": "punch", "parameters": COARSE_PUNCH}
    with contextlib.suppress(StudyError):
        examined(study | {"sweep": {"friction": [0.0, 0.1]}}, tmp_path, bounds)  # loads once
    with counted() as calls, pytest.raises(StudyError, match=allowed):
        examined(study | content, tmp_path, bounds)
    assert calls < most
